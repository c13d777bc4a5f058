"""Narrow peaks of smooth laws within a step: those that error estimates may miss, and those that fixed steps do not resolve.

So are oscillations of laws along a coordinate of which a fixed step passes over a third of a period and more.

Coordinates and rates are enclosed as in :mod:`gauss.dynamics.laws.enclosed_parts`. Few steps are divided: the others have no
peak by one enclosure of the whole step.
"""

from collections.abc import Callable
from functools import cached_property, partial, reduce

import numpy as np

from gauss import math
from gauss.codegen import Expression, Function, Kernel, Scalar, write
from gauss.codegen.kernels import CheckedSwitch
from gauss.dynamics.laws.enclosed_parts import PARTS, enclosed_parts
from gauss.dynamics.laws.intervals import Interval, written_enclosures, written_values
from gauss.dynamics.laws.products import FLAT, PEAK, Products
from gauss.integrators import Point
from gauss.system import State, System

RESOLVED_RISE = 0.5  # of ln |f| within a fixed step: three samples of 1/(1 + u²)³ then give its integral to 2 %
UNRESOLVED_SHARE = 0.03  # of the variation of the accelerations in a step, by which three samples miss their integral
RESOLVED_PHASE = 2.0  # of a sine within a fixed step [rad]: three samples give its integral to 1 %; none see many periods
NEGLIGIBLE_RATE = 1e-6  # relative to the rates: changes that do not count
SIMPSON = np.array([1.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 1.0]) / 6.0  # weights at the ends of the eight subintervals
COMPOSITE = np.array([1.0, 4.0, 2.0, 4.0, 2.0, 4.0, 2.0, 4.0, 1.0]) / 24.0


class NarrowPeaks:
    """Products and exponential functions of a state in laws, which may be narrow.

    ``symbols``, ``accelerations``: symbols of (t, q, v), and of the accelerations. ``exponents``, ``phases``: arguments of
    exponential functions, and of sines and cosines. ``slopes``: expressions → their time derivatives; empty if there are
    none.
    """

    def __init__(self, system: System, symbols, accelerations, products: Products, exponents: list, phases: list, slopes):
        self.system, self.symbols, self.accelerations = system, symbols, accelerations
        self.products, self.exponents, self.phases, self.slopes = products, exponents, phases, slopes
        self.sizes = (1, system.n_q, system.n_v, system.n_v) * 2

    @cached_property
    def hidden(self) -> CheckedSwitch:
        """(t, q, v, q̈) at both ends of a step → share before its first narrow peak of a product."""
        seen = partial(self._seen, *self._enclosed(self.products.bases))

        def whole(*ends):
            return [1.0, self.products.is_flat(PEAK, *seen(1, *ends))]

        def divided(*ends):
            return [self.products.hidden(*seen(PARTS, *ends))]

        flat, parted = write(whole, *self.sizes, name="flat"), write(divided, *self.sizes, name="narrow")
        return CheckedSwitch(flat, parted, 0.5)

    def unresolved(self, evaluate: Callable[[State], np.ndarray], order: Callable = lambda t: None) -> CheckedSwitch:
        """(t, q, v, q̈) at both ends of a fixed step → 1 if three samples of the accelerations do not resolve them, else 0.

        ``evaluate``: accelerations of a traced state. ``order``: called with the symbol of time before anything is traced.
        """

        def whole(t, *ends):
            order(t)
            return [0.0, self._is_flat(t, *ends)]

        def sampled(t, q, v, first, t_end, q_end, v_end, last):
            order(t)
            begin, end = State(t[0], q, v), State(t_end[0], q_end, v_end)
            return [missed(self.system, evaluate, begin, first, end, last)]

        flat, parted = write(whole, *self.sizes, name="gentle"), write(sampled, *self.sizes, name="unresolved")
        return CheckedSwitch(flat, parted, 0.5)

    @cached_property
    def is_flat(self) -> Kernel:
        """Machine code of (t, q, v, q̈) at both ends of a step → 1 if nothing is steep within it, else 0."""
        return Kernel(write(lambda *ends: [self._is_flat(*ends)], *self.sizes, name="gentle"), batch=False)

    def misses(self, evaluate: Callable[[State], np.ndarray], begin: Point, end: Point) -> bool:
        """Whether a fixed step does not resolve the laws; see :meth:`turns` and :meth:`unresolved`."""
        if self.oscillates(begin, end):
            return True
        if self.is_flat(np.concatenate(ends_of(begin, end)))[0] > 0.5:
            return False
        found = missed(self.system, evaluate, begin.state, begin.rates.acceleration, end.state, end.rates.acceleration)
        return bool(found > 0.5)

    def oscillates(self, begin: Point, end: Point) -> bool:
        """Whether a law oscillates along the coordinates faster than a fixed step resolves; see :meth:`turns`."""
        return bool(self.phases) and bool(self.turning(np.concatenate(ends_of(begin, end)))[0] > 0.5)

    def _is_flat(self, *ends) -> Scalar:
        """1 where neither a product nor an exponent rises by more than a fixed step resolves."""
        flat: Scalar = 1.0
        if self.products:
            flat = self.products.is_flat(RESOLVED_RISE, *self._seen(*self._enclosed(self.products.bases), 1, *ends))
        if self.exponents:
            _, ((values, _),) = self._enclosures(*self._enclosed(self.exponents), 1, *ends)
            for value in values:
                rises = math.where(value.high > FLAT, math.where(value.high > value.low + RESOLVED_RISE, 1.0, 0.0), 0.0)
                flat = math.where(rises > 0.5, 0.0, flat)
        return flat

    def turns(self, *ends) -> Scalar:
        """1 where a phase advances by more than a fixed step resolves between (t, q, v, q̈) at both ends, else 0."""
        found: Scalar = 0.0
        if not self.phases:
            return found
        states = [np.concatenate(ends[:4]), np.concatenate(ends[4:])]
        before, after = (np.array(list(self._phases(state))).reshape(2, -1) for state in states)
        h = ends[4][0] - ends[0][0]
        fastest = h * math.maximum(np.abs(before[1]), np.abs(after[1]))
        for advance in math.maximum(np.abs(after[0] - before[0]), fastest):
            found = math.where(advance > RESOLVED_PHASE, 1.0, found)
        return found

    @cached_property
    def turning(self) -> Kernel:
        """Machine code of :meth:`turns`."""
        return Kernel(write(lambda *ends: [self.turns(*ends)], *self.sizes, name="turning"), batch=False)

    @cached_property
    def _phases(self) -> Function:
        """(t, q, v, q̈) → phases, and their rates."""
        rates = self.slopes(self.phases) or [0.0] * len(self.phases)
        return written_values([*self.phases, *rates], [*self.symbols, *self.accelerations], "phases")

    def _enclosed(self, asked: list[Expression]) -> tuple[int, Function, Function]:
        """Number of expressions; (t, q, v) → values; ends of each of (t, q, v, q̈) → those of them and of their rates."""
        at, every = written_values(asked, self.symbols, "bases"), [*asked, *self.slopes(asked)]
        return len(asked), at, written_enclosures(every, [*self.symbols, *self.accelerations], "base_enclosures")

    def _enclosures(self, size: int, at: Function, around: Function, count: int, t, q, v, first, t_end, q_end, v_end, last):
        """Values at the ends of subintervals, and enclosures of values and rates on each."""
        begin, end = State(t[0], q, v), State(t_end[0], q_end, v_end)
        nodes, parts = enclosed_parts(self.system, begin, first, end, last, count)
        found = [[Interval(*pair) for pair in around(np.ravel(part)).reshape(-1, 2)] for part in parts]
        return [list(at(node)) for node in nodes], [(one[:size], one[size:]) for one in found]

    def _seen(self, size: int, at: Function, around: Function, count: int, *ends):
        """Arguments of the methods of :class:`Products`."""
        values, found = self._enclosures(size, at, around, count, *ends)
        return values, *map(list, zip(*found, strict=True)), (ends[4][0] - ends[0][0]) / count


def ends_of(begin: Point, end: Point) -> list:
    """(t, q, v, q̈) at both ends of a step."""
    return [p for at in (begin, end) for p in ([at.state.t], at.state.q, at.state.v, at.rates.acceleration)]


def missed(system: System, evaluate: Callable[[State], np.ndarray], begin: State, first, end: State, last) -> Scalar:
    """1 where Simpson's rule by three samples of the accelerations in a step misses their integral by nine, else 0.

    ``evaluate``: accelerations of a state. ``begin``, ``end``: ends of the step, numbers or expressions. ``first``, ``last``
    (n_v,): accelerations there.
    """
    nodes, _ = enclosed_parts(system, begin, first, end, last)
    a = np.array([first, *(evaluate(_state(system, node)) for node in nodes[1:-1]), last])
    h, units = end.t - begin.t, system.scale.coordinates
    off, found = np.abs((SIMPSON - COMPOSITE) @ a) * h / units, 0.0
    fastest = reduce(math.maximum, np.abs([*(begin.v / units), *(end.v / units)]))
    for k, change in enumerate(off):
        spread = h * reduce(math.maximum, np.abs(a[1:, k] - a[0, k])) / units[k]
        counts = math.where(change > NEGLIGIBLE_RATE * fastest, 1.0, 0.0)
        found = math.where(change > UNRESOLVED_SHARE * spread, math.maximum(found, counts), found)
    return found


def _state(system: System, node: np.ndarray) -> State:
    """State of (t, q, v) with unit quaternions."""
    q = node[1 : 1 + system.n_q].copy()
    for place in system.quaternions.values():
        q[place] = q[place] / np.sqrt(np.sum(q[place] * q[place]))
    return State(node[0], q, node[1 + system.n_q :])
