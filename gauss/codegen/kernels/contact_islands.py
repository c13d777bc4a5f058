"""Islands of contacts in machine code: groups of bodies that touch each other are problems of their own.

Bodies that do not move connect nothing. Each island has its own matrix, order of elimination, tolerance and number of Newton
steps, so that the cost of a step is the sum over its islands.
"""

from llvmlite import ir

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.block_contacts import CONTACT, MASS
from gauss.codegen.kernels.step_memory import RESULTS, StepMemory
from gauss.codegen.kernels.vectors import WIDTH

ISLANDS = (
    *("parent", "number", "contacts_before", "bodies_before", "slots_before", "contact_place", "body_place", "blocks_of"),
)


class ContactIslands:
    """Emitter of the contact problems of a step.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    order, solver : llvmlite.ir.Function
        Order of elimination, and solution of a problem.
    """

    def __init__(self, memory: StepMemory, order: ir.Function, solver: ir.Function):
        self.at, self.r, self.order, self.solver = memory, memory.r, order, solver
        names = "touching", "ordered", "within", "ordered_count", "needed"
        self.touching, self.ordered, self.within, self.count, self.needed = (memory.table(name) for name in names)
        self.parent, self.number, self.contacts, self.bodies, self.slots, self.contact, self.body, self.blocks = (
            memory.table(name) for name in ISLANDS
        )
        self.islands = self.count.after(1)

    def divide(self, m: Value):
        """Islands of contacts; those of the last step where these touch the same bodies."""
        with self.r.when(self._is_other(m)):
            self._divide(m)
            self._arrange(m)

    def solve(self) -> Value:
        """Impulses that obey the laws, and the velocities that they add; returned is whether they do."""
        r, at, error = self.r, self.at, RESULTS.index("error")
        at["results"][error] = 0.0
        solved = r.variable(1, INTEGER)
        solved[0] = r.as_integer(self.needed[0] <= at.n["blocks"])
        with r.when(solved[0] > 0):
            self._gather()
            with r.each(self.islands[0]) as k:
                at["results"][error] = r.maximum(at["results"][error], self._solve_one(k))
            self._scatter()
        return (solved[0] > 0) & (at["results"][error] <= at.settings["unsolved"])

    def _is_other(self, m: Value) -> Value:
        """Whether contacts touch other bodies than in the last step."""
        r, touching, ordered, other = self.r, self.touching, self.ordered, self.r.variable(0, INTEGER)
        other[0] = r.as_integer(_differ(self.count[0], m))
        with r.when(other[0] < 1), r.each(m * 2) as i, r.when(_differ(touching[i], ordered[i])):
            other[0] = 1
        return other[0] > 0

    def _root(self, body: Value) -> Value:
        place = self.r.variable(0, INTEGER)
        place[0] = body
        with self.r.loop() as leave_if:
            leave_if(~_differ(self.parent[place[0]], place[0]))
            place[0] = self.parent[place[0]]
        return place[0]

    def _moving(self, c: Value) -> Value:
        """Body of a contact that moves."""
        body = self.r.variable(0, INTEGER)
        body[0] = self.touching[c * 2]
        with self.r.when(body[0] < 0):
            body[0] = self.touching[c * 2 + 1]
        return body[0]

    def _divide(self, m: Value):
        """Numbers of islands by the roots of their bodies, in the order of their contacts."""
        r, n = self.r, self.at.n["n"]
        with r.each(n) as k:
            self.parent[k], self.number[k] = k, -1
        with r.each(m) as c:
            one, other = self.touching[c * 2], self.touching[c * 2 + 1]
            with r.when((one >= 0) & (other >= 0)):
                first, second = self._root(one), self._root(other)
                self.parent[second] = first
        self.islands[0] = 0
        with r.each(m) as c:
            root = self._root(self._moving(c))
            with r.when(self.number[root] < 0):
                self.number[root] = self.islands[0]
                self.islands[0] = self.islands[0] + 1

    def _arrange(self, m: Value):
        """Places of contacts and bodies, island after island, and the order of elimination of each."""
        r, n = self.r, self.at.n["n"]
        with r.each(self.islands[0] + 1) as k:
            self.contacts[k], self.bodies[k], self.slots[k] = 0, 0, 0
        with r.each(m) as c:
            own = self.number[self._root(self._moving(c))]
            self.contact[c] = self.contacts[own + 1]
            self.contacts[own + 1] = self.contacts[own + 1] + 1
        with r.each(n) as k:
            own = self.number[self._root(k)]
            with r.when(own >= 0):
                self.body[k] = self.bodies[own + 1]
                self.bodies[own + 1] = self.bodies[own + 1] + 1
        with r.each(self.islands[0]) as k:
            size = self.bodies[k + 1]
            self.slots[k + 1] = self.slots[k] + size * size
            self.contacts[k + 1], self.bodies[k + 1] = self.contacts[k] + self.contacts[k + 1], self.bodies[k] + size
        with r.each(m) as c:
            own = self.number[self._root(self._moving(c))]
            place = self.contacts[own] + self.contact[c]
            self.contact[c] = place
            for side in range(2):
                body, at = self.touching[c * 2 + side], place * 2 + side
                self.ordered[c * 2 + side], self.within[at] = body, -1
                with r.when(body >= 0):
                    self.within[at] = self.body[body]
        self.count[0], self.needed[0] = m, 0
        with r.each(self.islands[0]) as k:
            tables = self._tables(k)
            arrays = *tables, self.at.table("degree").after(self.bodies[k]), self.blocks.after(k)
            r.call(self.order, self.bodies[k + 1] - self.bodies[k], self.contacts[k + 1] - self.contacts[k], *arrays)
            with r.when(self.blocks[k] > self.needed[0]):
                self.needed[0] = self.blocks[k]

    def _tables(self, k: Value) -> list[Array]:
        """Bodies of the contacts of an island, slots, order, starts and lists of its elimination."""
        body, at = self.bodies[k], self.at
        places = self.contacts[k] * 2, self.slots[k], body, body + k, self.slots[k] + k
        arrays = self.within, at.table("slot"), at.table("order"), at.table("start"), at.table("list")
        return [array.after(place) for array, place in zip(arrays, places, strict=True)]

    def _gather(self):
        """Copy inertias of bodies to their places in islands."""
        r, at = self.r, self.at
        with r.each(at.n["n"]) as k:
            own = self.number[self._root(k)]
            with r.when(own >= 0):
                at.copy(at["island:mass"].after((self.bodies[own] + self.body[k]) * MASS), at["mass"].after(k * MASS), MASS)

    def _scatter(self):
        """Copy velocities from there."""
        r, at = self.r, self.at
        with r.each(at.n["n"]) as k:
            own = self.number[self._root(k)]
            with r.when(own >= 0):
                place = (self.bodies[own] + self.body[k]) * WIDTH
                at.copy(at["added"].after(k * WIDTH), at["island:added"].after(place), WIDTH)

    def _solve_one(self, k: Value) -> Value:
        """Solve the problem of an island; returned is the error of its laws, relative to its own rates."""
        r, at, s, scale = self.r, self.at, self.at.settings, self.r.variable(0.0)
        first, body = self.contacts[k], self.bodies[k]
        m = self.contacts[k + 1] - first
        with r.each(m * 3) as i:
            scale[0] = r.maximum(r.absolute(at["b"][first * 3 + i]), scale[0])
        scale[0] = scale[0] + s["unit"]
        at["result"][0] = s["tolerance"] * scale[0]
        places = ("J", first * CONTACT), ("island:mass", body * MASS), ("b", first * 3), ("mu", first), ("f", first * 3)
        arrays = [at[name].after(place) for name, place in (*places, ("island:added", body * WIDTH))]
        sizes = self.bodies[k + 1] - body, m, self.blocks[k]
        r.call(self.solver, *sizes, *self._tables(k), *arrays, at["A"], at["room"], at["result"])
        return at["result"][0] / scale[0]


def _differ(one: Value, other: Value) -> Value:
    return (one < other) | (one > other)
