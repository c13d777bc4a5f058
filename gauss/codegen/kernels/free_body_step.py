"""Step of free bodies with contacts in machine code: poses, near contacts, block-sparse contact problem, end of the step.

The equations are those of :mod:`gauss.dynamics.contact.free_body_step`, whose Python code repeats the steps that are not
finished here: where pairs of kinds of shapes are met for the first time, arrays are too short, laws have no solution, or
bodies asleep are pushed.
"""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function
from gauss.codegen.kernels.arrays import Routine, Value
from gauss.codegen.kernels.asleep import pushes_asleep
from gauss.codegen.kernels.block_contacts import CONTACT, ELIMINATED, MASS, BlockContactLaws, write_block_contacts
from gauss.codegen.kernels.block_lu import write_order
from gauss.codegen.kernels.contact_islands import ISLANDS, ContactIslands
from gauss.codegen.kernels.contact_modes import SLIDING, STICKING, ContactModes
from gauss.codegen.kernels.mechanism_loop import CompiledSteps
from gauss.codegen.kernels.near_pairs import BODY, INTEGERS, NEAR_INTEGERS, NEAR_NUMBERS, ROW, parts_of, write_near
from gauss.codegen.kernels.step_memory import (
    CHANGE,
    CHANGES_ROOM,
    FINISHED,
    IMPACT,
    LOOP_SETTINGS,
    REPEATED,
    RESULTS,
    MemoryLayout,
    StepMemory,
)
from gauss.codegen.kernels.vectors import BLOCK, SIX, WIDTH

SIZES = ("n_q", "n_v", "n", "bodies", "parts", "pairs", "capacity", "blocks", "laws", "constants", "sleepers")
ADDRESSES = (
    *NEAR_INTEGERS,
    *NEAR_NUMBERS,
    *("known_found", "known_count", "status", "q_start", "v_start"),
    *("touching", "ordered", "within", "ordered_count", "slot", "order", "start", "list", "degree", "needed"),
    *ISLANDS,
    *("modes", "next_modes", "closed", "fresh", "counts"),
)
SETTINGS = ("t", "h", "share", "rest", "slow", "margin", "unit", "tolerance", "unsolved", "removal")
POSE, COORDINATES, RATES = 24, 7, 6  # pose and velocities of a body, coordinates and rates of its joint


def slots(n: dict[str, int]) -> dict[str, int]:
    """Lengths of the arrays of working memory by name."""
    bodies, m = n["n"], n["capacity"]
    return {
        "settings": len(SETTINGS),
        "results": len(RESULTS),
        "q": n["n_q"],
        "v": n["n_v"],
        "end_q": n["n_q"],
        "end_v": n["n_v"],
        "own": n["n_v"],
        "loop": len(LOOP_SETTINGS),
        "work": 3,
        "constants": bodies * n["constants"],
        "gravity": 3,
        "reach": bodies,
        "bodies": POSE * n["bodies"],
        "at": COORDINATES * bodies,
        "mass": MASS * bodies,
        "first": WIDTH * bodies,
        "free": WIDTH * bodies,
        "added": WIDTH * bodies,
        "expected": SIX * bodies,
        "friction": n["laws"] + 1,
        "restitution": n["laws"] + 1,
        "hit": n["laws"],
        "lost": n["laws"],
        "changes": CHANGE * (CHANGES_ROOM + 2 * n["laws"]),
        "J": CONTACT * m,
        "before": 3 * m,
        "after": 3 * m,
        "b": 3 * m,
        "mu": m,
        "f": 3 * m,
        "known": 3 * m,
        "island:mass": MASS * bodies,
        "island:added": WIDTH * bodies,
        "A": BLOCK * n["blocks"],
        "room": (9 + ELIMINATED) * m + WIDTH * bodies,
        "result": 3,
    }


FREE_BODIES = MemoryLayout(SIZES, ADDRESSES, slots)


@dataclass(frozen=True, eq=False)
class FreeBodyFunctions:
    """Traced functions of a step.

    Parameters
    ----------
    place : Function
        As of :class:`gauss.codegen.kernels.NearPairs`.
    begin, end : Function
        Of one body, as of :class:`gauss.dynamics.contact.free_bodies.FreeBodyKernels`.
    laws : BlockContactLaws
        Laws of contact and friction.
    impact, plastic, elastic : Function
        As of :class:`gauss.codegen.kernels.StepFunctions`.
    rest_steps : float
        Steps: a gap that closes no faster than by its acceleration in so many is at rest, without impact.
    """

    place: Function
    begin: Function
    end: Function
    laws: BlockContactLaws
    impact: Function
    plastic: Function
    elastic: Function
    rest_steps: float


class _PointModes(ContactModes):
    """Record of changes of the contact mode, of points by their forces and rates."""

    def write_points(self, m: Value, hits, rates, drift):
        """Compare the modes after a step with those before it.

        Parameters
        ----------
        hits, rates, drift : callable
            Of a contact: whether it has an impact, its velocities (3,) after the step, and what the laws add to them (3,).
        """
        r, law, found, place = self.r, self.at.table("law"), self.at.table("found"), self.at.table("contact_place")
        self.counts[1] = 0
        with r.each(m) as c, r.when(self.at["f"][place[c] * 3] > 0.0):
            mode, u = r.variable(STICKING, INTEGER), rates(c)
            one, other = (velocity + more for velocity, more in zip(u[1:], drift(c)[1:], strict=True))
            slides = r.square_root(one * one + other * other) > self.at.settings["slow"]
            with r.when((self.at["mu"][place[c]] > 0.0) & slides):
                mode[0] = SLIDING
            work = r.number(0.0)
            for q in range(3):
                work = work + self.at["f"][place[c] * 3 + q] * (self.at["before"][c * 3 + q] + u[q]) * 0.5
            self._mark(law[found[c * 2]] - 1, mode[0], hits(c), work / self.at.settings["h"])
        self._compare()


class _FreeBodyStepWriter:
    def __init__(self, functions: FreeBodyFunctions, module: ir.Module):
        self.functions, self.module = functions, module
        self.near, order = write_near(functions.place, module), write_order(module)
        solver = write_block_contacts(functions.laws, module)
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGERS, INTEGERS, POINTER]), "step"))
        self.at = StepMemory(r, r.arrays, FREE_BODIES)
        self.settings = {name: self.at["settings"][k] for k, name in enumerate(SETTINGS)}
        self.at.settings = self.settings
        self.islands = ContactIslands(self.at, order, solver)
        self.remaining = self.settings["share"] * -1.0 + 1.0
        self.status, self.modes = self.at.table("status"), _PointModes(self.at, functions.impact)

    def write(self) -> ir.Function:
        r, s, at = self.r, self.settings, self.at
        self.status[0] = REPEATED
        with r.each(at.n["n"]) as k:
            self._begin(k)
        speed = r.maximum(self._speed(None), self._speed("free"))
        at.table("near_settings", POINTER)[0] = s["margin"] * 2.0 * self.remaining * s["h"] * speed
        self._find()
        count = at.table("count")
        m = count[0]
        with r.when(~((count[1] > 0) | (count[2] > 0) | (m > at.n["capacity"]))):
            with r.each(m) as c:
                self._touch(c)
            self.islands.divide(m)
            self._known(m)
            with r.each(m) as c:
                self._row(c)
            with r.when(~(self._impact(m) > 0.0)):
                solved = self.islands.solve()
                with r.when(solved & (self._speed("added") <= s["margin"] * speed)), r.when(~(self._wakes(m) > 0)):
                    self._finish(m)
        return r.done()

    def _begin(self, k: Value):
        """Pose, velocities, free accelerations and inertia of a body after the share of the step."""
        at, s, n = self.at, self.settings, self.at.n
        q, v, own = self._joint("q", k, COORDINATES), self._joint("v", k, RATES), at["constants"].after(k * n["constants"])
        constants = len(self.functions.begin.inputs) - COORDINATES - RATES - 3 - SIX - 2
        given = [*q, *v, *(own[i] for i in range(constants)), *(at["gravity"][i] for i in range(3))]
        given += [at["expected"][k * SIX + i] for i in range(SIX)]
        found = self.r.inline(self.functions.begin, *given, s["h"], s["share"])
        for i in range(COORDINATES):
            at["at"][k * COORDINATES + i] = found[i]
        pose = found[COORDINATES : COORDINATES + POSE]
        for i, value in enumerate(pose):
            at["bodies"][n["bodies"] * i + k] = value
        rest = found[COORDINATES + POSE :]
        for i in range(SIX):
            at["first"][k * WIDTH + i] = pose[12 + i]
            at["free"][k * WIDTH + i] = pose[12 + i] + s["h"] * rest[i]
            at["added"][k * WIDTH + i] = 0.0
        for i in range(18):
            at["mass"][k * MASS + i] = rest[SIX + i]
        at["mass"][k * MASS + 18] = own[constants - 1]
        at["mass"][k * MASS + 19] = self.r.number(1.0) / own[constants - 1]

    def _joint(self, name: str, k: Value, count: int) -> list[Value]:
        start = self.at.table(f"{name}_start")[k]
        return [self.at[name][start + i] for i in range(count)]

    def _twist(self, name: str | None, k: Value) -> list[Value]:
        """Velocities (6,) of a body before the step, after it without contacts ("free"), and with them ("added")."""
        first = self.at["first" if name is None else "free"].after(k * WIDTH)
        return [first[i] + self.at["added"][k * WIDTH + i] if name == "added" else first[i] for i in range(SIX)]

    def _speed(self, name: str | None) -> Value:
        """Largest speed of a point of a shape."""
        r, largest = self.r, self.r.variable(0.0)
        with r.each(self.at.n["n"]) as k:
            x = self._twist(name, k)
            turning, moving = (r.square_root(a * a + b * b + c * c) for a, b, c in (x[:3], x[3:]))
            largest[0] = r.maximum(moving + turning * self.at["reach"][k], largest[0])
        return largest[0]

    def _find(self):
        at, n = self.at, self.at.n
        integers = [at.table(name) for name in NEAR_INTEGERS]
        others = [at.table(name, POINTER) for name in NEAR_NUMBERS]
        self.r.call(self.near, n["parts"], n["pairs"], n["capacity"], n["bodies"], *integers, at["bodies"], *others)

    def _touch(self, c: Value):
        """Bodies of a contact that move, −1 for others."""
        at = self.at
        found, touching, body = (at.table(name) for name in ("found", "touching", "body"))
        for side, part in enumerate(parts_of(found[c * 2], at.n["parts"])):
            column = body[part * BODY]
            touching[c * 2 + side] = -1
            with self.r.when(column < at.n["n"]):
                touching[c * 2 + side] = column

    def _row(self, c: Value):
        """Jacobian, relative velocities and friction of a contact at its place in islands, velocities to be reached."""
        r, at, s = self.r, self.at, self.settings
        row, p, place = at.table("rows", POINTER).after(c * ROW), at.table("found")[c * 2], self.islands.contact[c]
        at.copy(at["J"].after(place * CONTACT), row.after(4), CONTACT)
        first, free = self._rates(c, None), self._rates(c, "free")
        law = at.table("law")[p] - 1
        at["mu"][place], e = at["friction"][law], at["restitution"][law]
        gap = row[0]
        closed = r.choose(s["removal"] > 0.0, at["f"][place * 3], 0.0)
        given = gap, first[0], s["h"], s["rest"], s["share"], r.maximum(s["h"], s["removal"]), closed
        (plastic,) = r.inline(self.functions.plastic, *given)
        (elastic,) = r.inline(self.functions.elastic, *given[:2], e, *given[2:])
        for q in range(3):
            at["before"][c * 3 + q], at["after"][c * 3 + q] = first[q], free[q]
            least = r.choose(e > 0.0, elastic, plastic) if q == 0 else r.number(0.0)
            at["b"][place * 3 + q] = free[q] + self._drift(c)[q] - least

    def _drift(self, c: Value) -> list[Value]:
        """Changes (3,) of the velocities of a contact in the rest of a step at constant rates of the bodies."""
        row = self.at.table("rows", POINTER).after(c * ROW)
        return [self.settings["h"] * self.remaining * row[52 + q] for q in range(3)]

    def _rates(self, c: Value, name: str | None) -> list[Value]:
        """Relative velocities (3,) of a contact by the twists of its bodies."""
        r, at = self.r, self.at
        found = [r.variable(0.0) for _ in range(3)]
        for side in range(2):
            body = at.table("touching")[c * 2 + side]
            with r.when(body >= 0):
                twist = self._twist(name, body)
                for q in range(3):
                    J = at["J"].after(self.islands.contact[c] * CONTACT + (side * 3 + q) * WIDTH)
                    total = found[q][0]
                    for i in range(SIX):
                        total = total + J[i] * twist[i]
                    found[q][0] = total
        return [entry[0] for entry in found]

    def _hits(self, c: Value) -> Value:
        """Whether a gap has an impact in the rest of the step."""
        r, at, s, row = self.r, self.at, self.settings, self.at.table("rows", POINTER).after(c * ROW)
        before, after = at["before"][c * 3], at["after"][c * 3]
        speed = r.absolute(after - before + s["h"] * row[52]) * self.functions.rest_steps + s["rest"]
        (hit,) = r.inline(self.functions.impact, row[0], before, speed, s["h"], s["share"])
        return hit

    def _impact(self, m: Value) -> Value:
        """Whether a gap has an impact in a step of which the bodies moved a share; then it begins anew."""
        r, found = self.r, self.r.variable(0.0)
        with r.when(self.settings["share"] > 0.0), r.each(m) as c:
            found[0] = r.maximum(self._hits(c), found[0])
        with r.when(found[0] > 0.0):
            self.status[0] = IMPACT
        return found[0]

    def _wakes(self, m: Value) -> Value:
        """Whether a contact pushes a body asleep; their columns follow those of the moving bodies."""
        at, first = self.at, self.at.n["n"]
        force = lambda c: at["f"][self.islands.contact[c] * 3]  # noqa: E731
        return pushes_asleep(at, m, force, lambda column: (column >= first) & (column < first + at.n["sleepers"]))

    def _known(self, m: Value):
        """Initial impulses, those of the last step: contacts of both steps come in the same order."""
        r, at, h = self.r, self.at, self.settings["h"]
        found, known, count, k = (
            at.table("found"),
            at.table("known_found"),
            at.table("known_count")[0],
            r.variable(0, INTEGER),
        )
        with r.each(m) as c:
            p, feature = found[c * 2], found[c * 2 + 1]
            with r.loop() as leave_if:
                leave_if(k[0] >= count)
                pair, other = known[k[0] * 2], known[k[0] * 2 + 1]
                leave_if((pair > p) | (~(pair < p) & (other >= feature)))
                k[0] = k[0] + 1
            same = r.variable(0, INTEGER)
            with r.when(k[0] < count):
                pair, other = known[k[0] * 2] - p, known[k[0] * 2 + 1] - feature
                same[0] = r.as_integer(~((pair > 0) | (pair < 0) | (other > 0) | (other < 0)))
            f = at["f"].after(self.islands.contact[c] * 3)
            for q in range(3):
                f[q] = 0.0
            with r.when(same[0] > 0):
                for q in range(3):
                    f[q] = h * at["known"][k[0] * 3 + q]

    def _finish(self, m: Value):
        """State at the end of the step, power, changes of the contact mode, and the forces known in the next step."""
        r, at, s, power = self.r, self.at, self.settings, self.r.variable(0.0)
        with r.each(at.n["n"]) as k:
            self._end(k)
        with r.when(at["loop"][LOOP_SETTINGS.index("recorded")] > 0.0):
            self.modes.write_points(m, self._hits, lambda c: self._rates(c, "added"), self._drift)
        found, known = at.table("found"), at.table("known_found")
        with r.each(m) as c:
            u = self._rates(c, "added")
            known[c * 2], known[c * 2 + 1] = found[c * 2], found[c * 2 + 1]
            for q in range(3):
                force = at["f"][self.islands.contact[c] * 3 + q] / s["h"]
                at["known"][c * 3 + q] = force
                power[0] = power[0] + force * (at["before"][c * 3 + q] + u[q])
        at.table("known_count")[0] = m
        for name, value in (("power0", 0.0), ("power1", 0.0), ("power2", power[0] * -0.5), ("doubtful", 0.0)):
            at["results"][RESULTS.index(name)] = value
        self.status[0] = FINISHED

    def _end(self, k: Value):
        at, s = self.at, self.settings
        q, own = at["at"].after(k * COORDINATES), at["constants"].after(k * at.n["constants"])
        first, last = self._twist(None, k), self._twist("added", k)
        constants = len(self.functions.end.inputs) - COORDINATES - RATES - SIX - 2
        given = [*(q[i] for i in range(COORDINATES)), *self._joint("v", k, RATES), *(own[i] for i in range(constants))]
        given += [b - a for a, b in zip(first, last, strict=True)]
        found = self.r.inline(self.functions.end, *given, s["h"], s["share"])
        starts = at.table("q_start")[k], at.table("v_start")[k]
        for target, start, values in zip(
            ("end_q", "end_v"), starts, (found[:COORDINATES], found[COORDINATES:]), strict=True
        ):
            for i, value in enumerate(values):
                at[target][start + i] = value
        for i in range(SIX):
            acceleration = at["added"][k * WIDTH + i] / s["h"]
            at["expected"][k * SIX + i] = self.r.choose(s["share"] > 0.0, acceleration, 0.0)


class CompiledFreeBodyStep(CompiledSteps):
    """Python interface.

    Parameters
    ----------
    functions : FreeBodyFunctions
        Traced functions.
    """

    def __init__(self, functions: FreeBodyFunctions):
        super().__init__(_FreeBodyStepWriter(functions, ir.Module(name="gauss")).write(), FREE_BODIES)
