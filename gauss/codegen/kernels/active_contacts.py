"""Contact problem of the active rows: W = h Y Yᵀ, Y = K Z; further gaps become active until none closes."""

from llvmlite import ir

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.contact_rows import ContactRows
from gauss.codegen.kernels.free_motion import FreeMotion
from gauss.codegen.kernels.interleaved_sums import each_sum
from gauss.codegen.kernels.step_memory import StepMemory

ROUNDS = 20  # of activating gaps


class ActiveContacts:
    """Emitter of the contact problem of a step.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    free : FreeMotion
        Emitter of accelerations.
    rows : ContactRows
        Emitter of the rows.
    functions : StepFunctions
        Traced functions of a step.
    """

    def __init__(self, memory: StepMemory, free: FreeMotion, rows: ContactRows, functions, solver: ir.Function):
        self.at, self.r = memory, memory.r
        self.free, self.rows, self.functions, self.solver = free, rows, functions, solver

    def solve(self, m: Value) -> Value:
        """Forces of the active rows; returned is whether they obey their laws, and no other gap closes."""
        r, n, s, g = self.r, self.at.n, self.at.settings, self.at.n["g"]
        rows = m * 3 + g + n["s"]
        scale = r.variable(0.0)
        push = self.rows.products(rows, self.at["a"])
        with r.each(rows) as i:
            self.at["after"][i] = self.at["rate"][i] + s["h"] * (push[i] + self.at.remaining * self.at["bias"][i])
            scale[0] = r.maximum(r.absolute(self.at["rate"][i]), scale[0])
        removal = r.maximum(s["h"], s["removal"])
        with r.each(m + g) as i:
            closed = r.choose(s["removal"] > 0.0, self.at["force"][i], 0.0)
            curved = self.at["bias"][i], s["h"] * self.at.remaining, s["most_bent"]
            (left,) = r.inline(self.functions.to_close, self.at["gap"][i], *curved)
            gap = r.choose(s["removal"] > 0.0, self.at["gap"][i], left)
            given = gap, self.at["rate"][i], s["h"], s["rest"], s["share"], removal, closed
            (plastic,) = r.inline(self.functions.plastic, *given)
            (elastic,) = r.inline(self.functions.elastic, *given[:2], self.at["e"][i], *given[2:])
            self.at["after"][i] = self.at["after"][i] - r.choose(self.at["e"][i] > 0.0, elastic, plastic)
            self.at["active"][i] = r.choose((self.at["after"][i] < 0.0) | (self.at["force"][i] > 0.0), 1.0, 0.0)
        again, tries, solved = r.variable(1, INTEGER), r.variable(0, INTEGER), r.variable(1.0)
        with r.loop() as leave_if:
            leave_if((again[0] < 1) | (tries[0] > ROUNDS) | (solved[0] < 0.0))
            self._solve_active(m, solved)
            again[0], tries[0] = 0, tries[0] + 1
            push = self.rows.products(m + g, self.at["added"])
            with r.each(m + g) as i:
                closes = self.at["after"][i] + s["h"] * push[i] < s["missed"] * (scale[0] + 1.0) * -1.0
                with r.when(closes & (self.at["active"][i] < 1.0)):
                    self.at["active"][i], again[0] = 1.0, 1
        return (solved[0] >= 0.0) & (again[0] < 1)

    def _solve_active(self, m: Value, solved: Array):
        """Problem of the active rows, its forces, and the accelerations that they add."""
        r, n, k, n_v, g = self.r, self.at.n, self.at.n["r"], self.at.n["n_v"], self.at.n["g"]
        z_begin, z_end = self.at.table("z_begin"), self.at.table("z_end")
        under, which = self.at.table("under"), self.at.table("under").after(n["capacity"] * 2)
        normals, rough, count = (r.variable(0, INTEGER) for _ in range(3))
        order = which.after(n["capacity"] * 3 + g + n["s"])
        with r.each(m + g) as i, r.when(self.at["active"][i] > 0.0):
            which[normals[0]], order[i] = i, normals[0]
            normals[0] = normals[0] + 1
        count[0] = normals[0]
        with r.each(m) as c, r.when((self.at["active"][c] > 0.0) & (self.at["mu"][c] > 0.0)):
            under[rough[0]], self.at["active_mu"][rough[0]] = order[c], self.at["mu"][c]
            which[count[0]], which[count[0] + 1] = m + g + c * 2, m + g + c * 2 + 1
            rough[0], count[0] = rough[0] + 1, count[0] + 2
        with r.each(n["s"]) as j:
            which[count[0]] = m * 3 + g + j
            count[0] = count[0] + 1
        total = count[0]
        with r.each(total) as i:
            row, Y = which[i], self.at["Y"].after(i * k)
            self.at["b"][i], self.at["f"][i] = self.at["after"][row], self.at["force"][row]
            with r.each(k) as j:
                Y[j] = 0.0
            begin, end = self.rows.bounds.around([row])
            with r.each(end, begin) as p:
                entry = self.at["K"][row * n_v + p]
                with r.when(r.absolute(entry) > 0.0), r.each(z_end[p], z_begin[p]) as j:
                    Y[j] = Y[j] + entry * self.at["Z"][p * k + j]

            def respond(j: Value, product: Value):
                value = product * self.at.settings["h"]
                self.at["W"][i * total + j], self.at["W"][j * total + i] = value, value

            every = Value(r.b, INTEGER(0)), k
            each_sum(r, i + 1, lambda lanes: every, lambda sum_, j, p: sum_ + Y[p] * self.at["Y"][j * k + p], respond)
        self.at["residual"][0] = 0.0
        with r.when(total > 0):
            sizes = normals[0], rough[0], n["s"]
            r.call(
                self.solver,
                *(*sizes, self.at["W"], self.at["b"], under, self.at["active_mu"], self.at["limit"]),
                *(self.at["f"], self.at["residual"], self.at["room"]),
            )
        solved[0] = self.at["residual"][0]
        with r.each(m * 3 + g + n["s"]) as i:
            self.at["force"][i] = 0.0
        with r.each(k) as j:
            self.at["z"][j] = 0.0
        with r.each(total) as i:
            self.at["force"][which[i]] = self.at["f"][i]
            with r.each(k) as j:
                self.at["z"][j] = self.at["z"][j] + self.at["f"][i] * self.at["Y"][i * k + j]
        self._jams(normals[0], total, which, solved)
        self.free.spread(self.at["added"])

    def _jams(self, normals: Value, total: Value, which: Array, solved: Array):
        """Leave the step to Python if a normal force moves nothing, because the loop constraints forbid it."""
        r, s, n_v = self.r, self.at.settings, self.at.n["n_v"]
        with r.when(self.at.n["loops"] > 0), r.each(normals) as i:
            alone = r.variable(0.0)
            with r.each(n_v) as j:
                inertia, entry = self.at["flat:M"][j * n_v + j], self.at["K"][which[i] * n_v + j]
                with r.when(inertia > 0.0):
                    alone[0] = alone[0] + entry * entry / inertia
            response = self.at["W"][i * total + i]
            with r.when((r.absolute(self.at["f"][i]) > 0.0) & (response <= s["jammed"] * s["h"] * alone[0])):
                solved[0] = -1.0
