"""Step of a mechanism with contacts in machine code: terms, near contacts, rows, laws, and the state at the end of the step.

    v₁ = v₀ + h (q̈_free + H Kᵀ f)

The equations are those of :mod:`gauss.dynamics.contact.mechanism_step`, whose Python code repeats the steps that are not
finished here. Kernels of the scene are called through their addresses, so that this code holds no scene and is made once on
a machine.
"""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import POINTER, Function
from gauss.codegen.kernels.active_contacts import ActiveContacts
from gauss.codegen.kernels.arrays import Routine, Value
from gauss.codegen.kernels.contact_modes import ContactModes
from gauss.codegen.kernels.contact_rows import ContactRows
from gauss.codegen.kernels.contact_solver import ContactSolver
from gauss.codegen.kernels.free_motion import FreeMotion
from gauss.codegen.kernels.mechanism_loop import CompiledSteps
from gauss.codegen.kernels.near_pairs import INTEGERS, NEAR_INTEGERS, NEAR_NUMBERS, write_near
from gauss.codegen.kernels.sliding_contacts import SlidingContacts
from gauss.codegen.kernels.step_memory import FINISHED, IMPACT, LOOP_SETTINGS, REPEATED, RESULTS, StepMemory


@dataclass(frozen=True, eq=False)
class StepFunctions:
    """Traced functions of a step.

    Parameters
    ----------
    place : Function
        As of :class:`gauss.codegen.kernels.NearPairs`.
    solver : ContactSolver
        Laws of contact, friction and set-valued elements.
    impact : Function
        (gap, rate, speed, h, share) → 1 for an impact.
    plastic, elastic : Function
        (gap, rate, h, rest, share, removal, closed), the latter with the coefficient of restitution after the rate → least
        rate.
    to_close : Function
        (gap, its second derivative, time) → the gap that would be left if its rate were zero then.
    rest_steps : float
        Steps: a gap that closes no faster than by its acceleration in so many is at rest, without impact.
    """

    place: Function
    solver: ContactSolver
    impact: Function
    plastic: Function
    elastic: Function
    to_close: Function
    rest_steps: float


class _StepWriter:
    def __init__(self, functions: StepFunctions, module: ir.Module):
        self.functions, self.module = functions, module
        self.near, solver = write_near(functions.place, module), functions.solver.write(module)
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGERS, INTEGERS, POINTER]), "step"))
        self.at = memory = StepMemory(r, r.arrays)
        self.status = memory.table("status")
        self.free, self.rows, self.sliding = FreeMotion(memory), ContactRows(memory), SlidingContacts(memory)
        self.contacts = ActiveContacts(memory, self.free, self.rows, functions, solver)
        self.modes = ContactModes(memory, functions.impact, functions.rest_steps)

    def write(self) -> ir.Function:
        r, s = self.r, self.at.settings
        self.status[0] = REPEATED
        self.free.begin()
        speed = r.maximum(self.free.speed(self.at["v"]), self.free.speed(self.at["total"]))
        near = self.at.table("near_settings", POINTER)
        near[0] = s["margin"] * 2.0 * self.at.remaining * s["h"] * speed
        self._find()
        count = self.at.table("count")
        m = count[0]
        unknown = (count[1] > 0) | (count[2] > 0) | (m > self.at.n["capacity"])
        with r.when(~unknown):
            self.rows.write(m)
            self.free.at_later_rates(m * 3 + self.at.n["g"] + self.at.n["s"])
            with r.when(~(self._impact(m) > 0.0)), r.when(self.contacts.solve(m)), r.when(~(self._wakes(m) > 0)):
                self._finish(m, m * 3 + self.at.n["g"] + self.at.n["s"], speed)
        return r.done()

    def _find(self):
        n, integers = self.at.n, [self.at.table(name) for name in NEAR_INTEGERS]
        doubles = [self.at.table(name, POINTER) for name in NEAR_NUMBERS]
        sizes = n["parts"], n["pairs"], n["capacity"], n["bodies"]
        self.r.call(self.near, *sizes, *integers, self.at["flat:bodies"], *doubles)

    def _impact(self, m: Value) -> Value:
        """Whether a gap has an impact in the rest of a step of which the bodies moved a share; then it begins anew."""
        r, s, found = self.r, self.at.settings, self.r.variable(0.0)

        with r.when(s["share"] > 0.0):
            push = self.rows.products(m + self.at.n["g"], self.at["a"])
            with r.each(m + self.at.n["g"]) as i:
                speed = r.absolute(push[i] + self.at["bias"][i]) * self.functions.rest_steps * s["h"] + s["rest"]
                (hit,) = r.inline(self.functions.impact, self.at["gap"][i], self.at["rate"][i], speed, s["h"], s["share"])
                found[0] = r.maximum(hit, found[0])
        with r.when(found[0] > 0.0):
            self.status[0] = IMPACT
        return found[0]

    def _wakes(self, m: Value) -> Value:
        """Whether a contact pushes a body asleep."""
        asleep = self.at.table("asleep")
        return self.at.pushes_asleep(m, lambda c: self.at["force"][c], lambda body: asleep[body] > 0)

    def _finish(self, m: Value, rows: Value, speed: Value):
        """State at the end of the step, power, and the forces to be known in the next step."""
        r, n, s, n_v, g = self.r, self.at.n, self.at.settings, self.at.n["n_v"], self.at.n["g"]
        given, results = self.at["given"], self.at["results"]
        with r.each(n_v) as i:
            acceleration = self.at["a"][i] + self.at["added"][i]
            self.at["end_v"][i] = self.at["v"][i] + s["h"] * acceleration
            self.at["total"][i] = self.at["v"][i] + s["h"] * 0.5 * acceleration
        lossy, other = r.variable(0.0), r.variable(0.0)
        rate = self.rows.products(rows, self.at["total"])
        with r.each(rows) as i:
            work = self.at["force"][i] * rate[i]
            self.at["row_work"][i] = work
            with r.when(i < m * 3 + g):
                lossy[0] = lossy[0] + work
            with r.when(i >= m * 3 + g):
                share = self.at["lossy"][i - (m * 3 + g)]
                lossy[0], other[0] = lossy[0] + work * share, other[0] + work * (share * -1.0 + 1.0)
        results[0], results[2] = results[0] + other[0], results[2] - lossy[0]
        self.free.add_damping_over(self.at["total"])
        results[3], results[4] = self.at["residual"][0], 0.0
        self.sliding.examine(m)
        fastest = self.free.speed(self.at["end_v"])
        with r.when(fastest <= s["margin"] * speed):
            results[RESULTS.index("fastest")] = fastest
            self.at.copy(given, self.at["end_q"], n["n_q"])
            with r.each(n_v) as i:
                given[n["n_q"] + i] = self.at.remaining * s["h"] * self.at["end_v"][i]
            self.at.call("move", given, self.at["end_q"])
            self.rows.keep(m)
            self.at["before"][0] = s["share"]
            self.status[0] = FINISHED
            with r.when(self.at["loop"][LOOP_SETTINGS.index("recorded")] > 0.0):
                self.modes.write(m)


class CompiledMechanismStep(CompiledSteps):
    """Python interface.

    Parameters
    ----------
    functions : StepFunctions
        Traced functions.
    """

    def __init__(self, functions: StepFunctions):
        super().__init__(_StepWriter(functions, ir.Module(name="gauss")).write())
