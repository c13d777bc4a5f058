"""Step of free bodies with contacts in machine code: poses, near contacts, block-sparse contact problem, end of the step.

The equations are those of :mod:`gauss.dynamics.contact.free_body_step`, whose Python code repeats the steps that are not
finished here: where pairs of kinds of shapes are met for the first time, arrays are too short, laws have no solution, or
bodies asleep are pushed.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.block_contacts import CONTACT, write_block_contacts
from gauss.codegen.kernels.block_lu import write_order
from gauss.codegen.kernels.contact_modes import SLIDING, STICKING, ContactModes
from gauss.codegen.kernels.free_body_poses import (
    COORDINATES,
    FREE_BODIES,
    RATES,
    STEP,
    BodiesOfStep,
    FreeBodyFunctions,
    write_parts,
)
from gauss.codegen.kernels.mechanism_loop import CompiledSteps
from gauss.codegen.kernels.near_pairs import ROW, write_near
from gauss.codegen.kernels.position_projection import DOUBT, write_position_projection
from gauss.codegen.kernels.step_memory import FINISHED, IMPACT, LOOP_SETTINGS, REPEATED, RESULTS
from gauss.codegen.kernels.vectors import SIX, WIDTH


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


class _FreeBodyStepWriter(BodiesOfStep):
    def __init__(self, functions: FreeBodyFunctions, module: ir.Module):
        shared = write_near(functions.place, module), write_order(module), write_block_contacts(functions.laws, module)
        shared = *shared, *write_parts(functions, shared, module)
        self.project = write_position_projection(functions, shared, module)
        super().__init__(functions, shared, ir.Function(module, STEP, "step"))
        self.remaining = self.settings["share"] * -1.0 + 1.0
        self.status, self.modes = self.at.table("status"), _PointModes(self.at, functions.impact, functions.rest_steps)

    def write(self) -> ir.Function:
        r, s, at = self.r, self.settings, self.at
        self.status[0] = REPEATED
        r.call(self.shared[0], *r.arrays)
        speed = r.maximum(self.speed(None), self.speed("free"))
        at.table("near_settings", POINTER)[0] = s["margin"] * 2.0 * self.remaining * s["h"] * speed
        self.find()
        count = at.table("count")
        m = count[0]
        with r.when(~((count[1] > 0) | (count[2] > 0) | (m > at.n["capacity"]))):
            by_shape, by_step = s["curved"] * speed * speed, speed * 2.0 / (self.remaining * s["h"])
            curved = r.choose(by_shape < by_step, by_shape, by_step)
            with r.each(m) as c:
                self.touch(c)
                self._keep_curvature(c, curved)
            r.call(self.shared[1], *r.arrays)
            self._known(m)
            with r.each(m) as c:
                self._row(c)
            with r.when(~(self._impact(m) > 0.0)):
                solved = self.islands.solve()
                with r.when(solved & (self.speed("added") <= s["margin"] * speed)), r.when(~(self._wakes(m) > 0)):
                    self._finish(m)
        return r.done()

    def _keep_curvature(self, c: Value, most: Value):
        """Second derivative of a gap, or none where it tells nothing of a step: of parallel features, of long steps."""
        row = self.at.table("rows", POINTER).after(c * ROW)
        with self.r.when(self.r.absolute(row[52]) > most):
            row[52] = 0.0

    def _row(self, c: Value):
        """Jacobian, relative velocities and friction of a contact at its place in islands, velocities to be reached."""
        r, at, s = self.r, self.at, self.settings
        row, p, place = at.table("rows", POINTER).after(c * ROW), at.table("found")[c * 2], self.islands.contact[c]
        at.copy(at["J"].after(place * CONTACT), row.after(4), CONTACT)
        first, free = self._rates(c, None), self._rates(c, "free")
        law = at.table("law")[p] - 1
        at["mu"][place], e = at["friction"][law], at["restitution"][law]
        closed = r.choose(s["removal"] > 0.0, at["f"][place * 3], 0.0)
        (left,) = r.inline(self.functions.to_close, row[0], row[52], self._time(), r.number(np.inf))
        gap = r.choose(s["removal"] > 0.0, row[0], left)
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
                twist = self.twist(name, body)
                for q in range(3):
                    J = at["J"].after(self.islands.contact[c] * CONTACT + (side * 3 + q) * WIDTH)
                    total = found[q][0]
                    for i in range(SIX):
                        total = total + J[i] * twist[i]
                    found[q][0] = total
        return [entry[0] for entry in found]

    def _time(self) -> Value:
        """Time from the bodies' present poses to the end of the step."""
        return self.settings["h"] * self.remaining

    def _gap_after(self, row: Array, rate: Value) -> Value:
        """Gap at the end of the step, by its rate at its present one."""
        return self.r.inline(self.functions.gap_after, row[0], rate, row[52], self._time())[0]

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
        return at.pushes_asleep(m, force, lambda column: (column >= first) & (column < first + at.n["sleepers"]))

    def _known(self, m: Value):
        """Initial impulses, those of the last step: contacts of both steps come in the same order."""
        r, at, h = self.r, self.at, self.settings["h"]
        found, known = at.table("found"), at.table("known_found")
        count, k = at.table("known_count")[0], r.variable(0, INTEGER)
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
        found, known, depths = at.table("found"), at.table("known_found"), _Depths(self)
        with r.each(m) as c:
            u = self._rates(c, "added")
            depths.take(c, u[0])
            known[c * 2], known[c * 2 + 1] = found[c * 2], found[c * 2 + 1]
            for q in range(3):
                force = at["f"][self.islands.contact[c] * 3 + q] / s["h"]
                at["known"][c * 3 + q] = force
                power[0] = power[0] + force * (at["before"][c * 3 + q] + u[q])
        at.table("known_count")[0] = m
        for name, value in (("power0", 0.0), ("power1", 0.0), ("power2", power[0] * -0.5), ("doubtful", 0.0)):
            at["results"][RESULTS.index(name)] = value
        self.status[0] = FINISHED
        deepest = depths.deepest()
        with r.when(deepest > s["accepted"]):
            self.set("deepest", deepest)
            r.call(self.project, *r.arrays)

    def _end(self, k: Value):
        at, s = self.at, self.settings
        q, own = at["at"].after(k * COORDINATES), at["constants"].after(k * at.n["constants"])
        first, last = self.twist(None, k), self.twist("added", k)
        constants = len(self.functions.end.inputs) - COORDINATES - RATES - SIX - 2
        given = [*(q[i] for i in range(COORDINATES)), *self.joint("v", k, RATES), *(own[i] for i in range(constants))]
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


class _Depths:
    """Deepest penetration at the end of a step: its rates tell it, unless an impact changed what curves the gaps."""

    def __init__(self, step: _FreeBodyStepWriter):
        self.step, r = step, step.r
        self.found, self.doubted, self.hit = r.variable(0.0), r.variable(0.0), r.variable(0.0)

    def take(self, c: Value, rate: Value):
        """Take a contact by its rate after the step."""
        step, r = self.step, self.step.r
        row = step.at.table("rows", POINTER).after(c * ROW)
        gap = step._gap_after(row, rate)
        self.found[0] = r.maximum(gap * -1.0, self.found[0])
        with r.when(~(step.settings["share"] > 0.0)):
            (less,) = r.inline(step.functions.gap_after, gap, r.number(0.0), r.absolute(row[52]) * -DOUBT, step._time())
            self.doubted[0] = r.maximum(less * -1.0, self.doubted[0])
            self.hit[0] = r.maximum(step._hits(c), self.hit[0])

    def deepest(self) -> Value:
        """Depth of all contacts [m]."""
        return self.step.r.choose(self.hit[0] > 0.0, self.doubted[0], self.found[0])


class CompiledFreeBodyStep(CompiledSteps):
    """Python interface.

    Parameters
    ----------
    functions : FreeBodyFunctions
        Traced functions.
    """

    def __init__(self, functions: FreeBodyFunctions):
        super().__init__(_FreeBodyStepWriter(functions, ir.Module(name="gauss")).write(), FREE_BODIES)
