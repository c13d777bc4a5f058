"""Changes of the contact mode in steps of a mechanism: contacts and stops that close or open, elements that stick or slip.

An element is a contact of the scene with all its points, another gap, or a set-valued element. Its mode is 0 while it bears
no force, 1 while it sticks, or bears a force without friction, and 2 while one of its points slides.
"""

from collections.abc import Callable

from gauss.codegen import INTEGER, Function
from gauss.codegen.kernels.arrays import Value
from gauss.codegen.kernels.step_memory import CHANGE, StepMemory

STICKING, SLIDING = 1, 2


class ContactModes:
    """Emitter of the record of changes.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    impact : Function
        (gap, rate, speed, h, share) → 1 for an impact.
    rest_steps : float
        As of :class:`gauss.codegen.kernels.StepFunctions`.
    """

    def __init__(self, memory: StepMemory, impact: Function, rest_steps: float):
        self.at, self.r, self.impact, self.rest_steps = memory, memory.r, impact, rest_steps
        names = "modes", "next_modes", "closed", "fresh", "counts"
        self.modes, self.next, self.closed, self.fresh, self.counts = (memory.table(name) for name in names)
        self.laws = memory.n["laws"]

    def write(self, m: Value):
        """Compare the modes after a step with those before it."""
        r, n, g = self.r, self.at.n, self.at.n["g"]
        self.counts[1] = 0
        law, found, force, work = self.at.table("law"), self.at.table("found"), self.at["force"], self.at["row_work"]
        with r.each(m) as c, r.when(force[c] > 0.0):
            t, mode = m + g + c * 2, r.variable(STICKING, INTEGER)
            with r.when(self.at["mu"][c] > 0.0):
                one, other = self._rate(t), self._rate(t + 1)
                with r.when(r.square_root(one * one + other * other) > self.at.settings["slow"]):
                    mode[0] = SLIDING
            self._mark(law[found[c * 2]] - 1, mode[0], self._hits(c), work[c] + work[t] + work[t + 1])
        with r.each(g) as j, r.when(force[m + j] > 0.0):
            self._mark(self.laws + j, Value(r.b, INTEGER(STICKING)), self._hits(m + j), work[m + j])
        with r.each(n["s"]) as j:
            row, mode = m * 3 + g + j, r.variable(STICKING, INTEGER)
            with r.when(r.absolute(self._rate(row)) > self.at.settings["slow"]):
                mode[0] = SLIDING
            self._mark(self.laws + g + j, mode[0], r.number(0.0), work[row])
        self._compare()

    def _rate(self, row: Value) -> Value:
        """Rate of a row after the step, as the laws take it."""
        at, s = self.at, self.at.settings
        after = at["rate"][row] + self._product(row, lambda i: at["end_v"][i] - at["v"][i])
        return after + s["h"] * (self.r.number(1.0) - s["share"]) * at["bias"][row]

    def _hits(self, row: Value) -> Value:
        """Whether a gap has an impact in the step."""
        s = self.at.settings
        push = self._product(row, lambda i: self.at["a"][i]) + self.at["bias"][row]
        speed = self.r.absolute(push) * self.rest_steps * s["h"] + s["rest"]
        (hit,) = self.r.inline(self.impact, self.at["gap"][row], self.at["rate"][row], speed, s["h"], s["share"])
        return hit

    def _product(self, row: Value, factor: Callable[[Value], Value]) -> Value:
        """Product of a row with numbers, one for each rate."""
        K, total = self.at["K"].after(row * self.at.n["n_v"]), self.r.variable(0.0)
        with self.r.each(self.at.table("k_end")[row], self.at.table("k_begin")[row]) as i:
            total[0] = total[0] + K[i] * factor(i)
        return total[0]

    def _mark(self, element: Value, mode: Value, hit: Value, work: Value):
        r, count = self.r, self.counts[1]
        with r.when(self.next[element] < 1):
            self.fresh[count] = element
            self.counts[1] = count + 1
        with r.when(self.next[element] < mode):
            self.next[element] = mode
        self.at["hit"][element] = r.maximum(hit, self.at["hit"][element])
        self.at["lost"][element] = self.at["lost"][element] - work * self.at.settings["h"]

    def _compare(self):
        """Record the differences, and take the new modes."""
        r, nothing = self.r, Value(self.r.b, INTEGER(0))
        with r.each(self.counts[0]) as k:
            element = self.closed[k]
            with r.when(self.next[element] < 1):
                self._record(element, nothing)
        with r.each(self.counts[1]) as k:
            element = self.fresh[k]
            mode = self.next[element]
            with r.when((mode < self.modes[element]) | (mode > self.modes[element])):
                self._record(element, mode)
            self.closed[k], self.next[element] = element, 0
            self.at["hit"][element], self.at["lost"][element] = 0.0, 0.0
        self.counts[0] = self.counts[1]

    def _record(self, element: Value, mode: Value):
        count = self.counts[2]
        change = self.at["changes"].after(count * CHANGE)
        numbers = self.counts[3], element, mode
        for k, number in enumerate(numbers):
            change[k] = self.r.as_double(number)
        change[3], change[4] = self.at["hit"][element], self.at["lost"][element]
        self.modes[element], self.counts[2] = mode, count + 1
