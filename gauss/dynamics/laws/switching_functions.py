"""Switching functions of traced laws on the state: detection of crossings that the error estimate of a step may miss.

Within a step, coordinates and rates are cubic Hermite polynomials. On each of :data:`PARTS` subintervals the hull of the
Bernstein coefficients encloses them, and interval arithmetic encloses the switching function g and its rate. A subinterval
is clear if the enclosure of g, or that of its rate, excludes zero. The error estimate reacts to one sign change of one
switching function, since the last stages lie beyond it; it may miss two, as where a narrow region is entered and left.
"""

from functools import cached_property, reduce
from itertools import islice
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Expression, Kernel, Scalar, forward, reachable, write
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.prescribed_jumps import NO_JUMPS, Jumps, prescribed_jumps
from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching_times import CONDITIONS, NO_TIMES, SIGN_ROUNDING, Timetable, of_time, timetable
from gauss.dynamics.laws.traced_laws import Laws, asks_where, symbols, traced_law
from gauss.integrators import Point
from gauss.scene.values import as_function
from gauss.system import Relations, State, System, coordinate_rates

PARTS = 8  # subintervals of a step
LIMITS = ("limit", "torque", "hold", "speed")  # fields of set-valued elements that may be laws
JUMPS = ("less", "less_equal", "floor")  # at which a switching function itself is discontinuous: its rate bounds nothing
STEEP, NEGLIGIBLE = 2.5, -50.0  # rise of an exponent within a subinterval, and the exponent of a negligible value
POINTS = 5  # random points at which switching functions are compared
SHORT, ONWARD = 6.0, 1e6  # smallest steps that may cross a surface undivided, and growth of the step after such a one
TRIES = 40.0  # consecutive rejections, after which the crossing is shorter than the resolution of time


class SwitchingFunctions:
    """Switching functions of the traced laws of a system, other than those of time.

    Parameters
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.

    Attributes
    ----------
    pairs : list of tuple of Expression
        The two sides of every comparison; a switching function is their difference.
    """

    def __init__(self, system: System, laws: Laws):
        self.system, self.laws, outputs = system, laws, laws.outputs
        timed = {node.index for node in of_time(outputs, laws.motion.state.t)} if outputs else set()
        nodes = [node for node in reachable(outputs) if node.op in CONDITIONS and node.index not in timed]
        self.pairs = self._distinct(list(dict.fromkeys(node.operands for node in nodes if node.op != "floor")))
        self.steps = [node.operands[0] for node in nodes if node.op == "floor"]
        self.jumps = [[node for node in reachable([x - y]) if node.op in JUMPS] for x, y in self.pairs]
        self.jumps += [[node for node in reachable([x]) if node.op in JUMPS] for x in self.steps]
        self.peaks = [x for x in _exponents(outputs) if x.index not in timed]
        asked = {node.index for node in nodes} | {node.index for node in self.peaks}
        has = lambda function: any(node.index in asked for node in reachable(function.outputs))  # noqa: E731
        self.names = tuple(dict.fromkeys(name for name, function in laws.functions if has(function)))

    def __bool__(self):
        return bool(self.pairs or self.steps or self.peaks)

    def judged(self, ends: tuple[Point, Point], error, factor, refused, smallest) -> tuple[Scalar, Scalar]:
        """Error and step-size factor of a step, corrected for crossings that its error estimate may miss.

        The shortest resolvable step across one switching surface is accepted with any error.
        """
        if not self:
            return error, factor
        begin, end = ends
        share, crossings = self.share(begin.state, begin.rates.acceleration, end.state, end.rates.acceleration)
        shortest = SHORT * smallest / (end.state.t - begin.state.t)
        short = math.where(shortest > 1.0, 1.0, 0.0)
        asked = math.where(refused < TRIES, math.where(error <= 1.0, 1.0 - short, 0.0), 0.0)
        unseen = math.where(share < 1.0, asked, 0.0)
        error, factor = math.where(unseen > 0.0, np.inf, error), math.where(unseen > 0.0, onward(share, shortest), factor)
        across = math.where(crossings > 0.5, short, 0.0)
        return math.where(across > 0.0, 0.0, error), math.where(across > 0.0, ONWARD, factor)

    def passes(self, begin: Point, end: Point) -> Scalar:
        """1 where a step may hold undetected crossings of a switching surface, else 0."""
        if not self:
            return 0.0
        share, _ = self.share(begin.state, begin.rates.acceleration, end.state, end.rates.acceleration)
        return math.where(share < 1.0, 1.0, 0.0)

    def share(self, begin: State, first: np.ndarray, end: State, last: np.ndarray) -> tuple[Scalar, Scalar]:
        """Share of a step without undetected crossings, 1 for all of it; and the number of detected crossings.

        Parameters
        ----------
        begin, end : State
            Ends of the step.
        first, last : ndarray, shape (n_v,)
            Accelerations there.
        """
        nodes, parts = self._parts(begin, first, end, last)
        asked = [x - y for x, y in self.pairs] + [*self.steps, *self.peaks]
        slopes = self._slopes(asked)
        sides = [side for pair in self.pairs for side in pair]
        jumps = [node for nodes in self.jumps for node in nodes]
        ends = [self._at(asked, node) for node in nodes]
        crossings, crossed, hidden = 0.0, 1.0, 1.0
        conditions, tau = len(self.pairs) + len(self.steps), (end.t - begin.t) / PARTS
        counts = len(asked), len(slopes), len(sides), len(jumps)
        enclosed = [_divided(enclose([*asked, *slopes, *sides, *jumps], part), *counts) for part in parts]
        tops = [
            [
                math.minimum(values[k].high, 0.5 * (ends[j][k] + ends[j + 1][k]) + 0.5 * tau * _most(rates[k]))
                if slopes
                else values[k].high
                for k in range(conditions, len(asked))
            ]
            for j, (values, rates, _, _) in enumerate(enclosed)
        ]
        highest = [reduce(math.maximum, column) for column in zip(*tops, strict=True)]
        for j, (values, rates, found, steps) in enumerate(enclosed):
            size = [_size(found[2 * k]) + _size(found[2 * k + 1]) for k in range(len(self.pairs))]
            jumping = iter([math.where(step.low < step.high, 1.0, 0.0) for step in steps])
            middle = (j + 0.5) / PARTS
            for place, k in enumerate(range(conditions, len(asked))):
                low, high = math.minimum(ends[j][k], ends[j + 1][k]), tops[j][place]
                steep = math.where(high > low + STEEP, 1.0, 0.0)
                counts = math.where(high > math.maximum(highest[place] - STEEP, NEGLIGIBLE), steep, 0.0)
                hidden = math.where(counts > 0.0, math.minimum(hidden, middle), hidden)
            for k, value in enumerate(values[:conditions]):
                low, high, before, after = value.low, value.high, ends[j][k], ends[j + 1][k]
                if k >= len(self.pairs):  # the next whole number counts, whichever it is
                    level = np.floor(before)
                    changes = math.minimum(np.abs(np.floor(after) - level), 2.0)
                    straddles = math.where(np.floor(low) < np.floor(high), 1.0, 0.0)
                else:
                    noise = SIGN_ROUNDING * size[k]
                    changes = math.where(before < 0.0, math.where(after < 0.0, 0.0, 1.0), math.where(after < 0.0, 1.0, 0.0))
                    straddles = math.where(low < -noise, math.where(high > noise, 1.0, 0.0), 0.0)
                turns = math.where(rates[k].low > 0.0, 0.0, math.where(rates[k].high < 0.0, 0.0, 1.0)) if slopes else 1.0
                for jump in islice(jumping, len(self.jumps[k])):
                    turns = math.maximum(turns, jump)
                crossings = crossings + changes
                crossed = math.where(changes > 0.0, math.minimum(crossed, middle), crossed)
                unclear = straddles * turns * (1.0 - changes)
                hidden = math.where(unclear > 0.0, math.minimum(hidden, middle), hidden)
        return math.minimum(hidden, math.where(crossings > 1.5, crossed, 1.0)), crossings

    def _distinct(self, pairs: list) -> list:
        """Pairs with linearly independent differences: x < 0 and x > 0 are one surface.

        Differences are compared at random points, with every non-smooth subexpression as an independent variable: the
        remaining functions are analytic, and equal if they agree there.
        """
        apart = [x - y for x, y in pairs]
        atoms = [node for node in reachable(apart) if node.op in (*CONDITIONS, "select", "symbol", "call", "item")]
        points = np.random.default_rng(0).uniform(0.3, 1.7, (len(atoms), POINTS))
        given = {atom.index: Interval.point(values) for atom, values in zip(atoms, points, strict=True)}
        with np.errstate(all="ignore"):
            found = enclose(apart, given)
            values = [np.broadcast_to(value.low, POINTS) for value in found]
            shapes = [value / value[np.argmax(np.abs(value))] for value in values]
        kept: dict[int, np.ndarray] = {}
        for k, shape in enumerate(shapes):
            if not any(np.allclose(shape, other, rtol=SIGN_ROUNDING, atol=0.0) for other in kept.values()):
                kept[k] = shape
        return [pairs[k] for k in kept]

    @cached_property
    def machine_code(self) -> Kernel:
        """Machine code of :meth:`share`: (t, q, v, q̈) at both ends of a step → (share, crossings)."""
        sizes = (1, self.system.n_q, self.system.n_v, self.system.n_v)

        def share(t, q, v, first, t_end, q_end, v_end, last):
            return list(self.share(State(t[0], q, v), first, State(t_end[0], q_end, v_end), last))

        return Kernel(write(share, *sizes, *sizes, name="unseen"), batch=False)

    def _slopes(self, asked) -> list:
        """Time derivatives of switching functions, with accelerations as symbols; empty if one has none."""
        symbols = self._symbols
        try:
            return list(forward(asked, symbols, [1.0, *self._rates, *self._acceleration]))
        except TypeError:
            return []

    @property
    def _symbols(self) -> list[Expression]:
        state = self.laws.motion.state
        return [state.t, *state.q, *state.v]

    @property
    def _rates(self) -> np.ndarray:
        state = self.laws.motion.state
        return coordinate_rates(self.system, state.q, state.v)

    @property
    def _acceleration(self) -> np.ndarray:
        return self.laws.motion.state.t.graph.symbols("a", self.system.n_v)

    def _at(self, asked, values) -> list:
        """Values of expressions at given (t, q, v)."""
        given = {symbol.index: Interval.point(value) for symbol, value in zip(self._symbols, values, strict=True)}
        return [value.low for value in enclose(asked, given)]

    def _parts(self, begin: State, first, end: State, last) -> tuple[list, list[dict]]:
        """Values of (t, q, v) at the ends of the subintervals of a step, and enclosures of (t, q, v, q̈) on each."""
        h = end.t - begin.t
        value = [np.concatenate([[s.t], s.q, s.v]) for s in (begin, end)]
        slope = [
            np.concatenate([[1.0], coordinate_rates(self.system, s.q, s.v), a]) for s, a in ((begin, first), (end, last))
        ]
        change = value[1] - value[0]
        nodes, slopes, tau = [], [], h / PARTS
        for s in np.arange(PARTS + 1) / PARTS:  # Hermite's polynomial and its derivative
            bump = s * (1.0 - s)
            nodes.append(value[0] + s * s * (3.0 - 2.0 * s) * change + h * bump * ((1.0 - s) * slope[0] - s * slope[1]))
            inner = (1.0 - s) * (1.0 - 3.0 * s) * slope[0] - s * (2.0 - 3.0 * s) * slope[1]
            slopes.append(6.0 * bump * change / h + inner)
        symbols, n = self._symbols, self.system.n_v
        nodes[-1] = value[1]
        parts = []
        for j in range(PARTS):
            points = [nodes[j], nodes[j] + tau / 3.0 * slopes[j], nodes[j + 1] - tau / 3.0 * slopes[j + 1], nodes[j + 1]]
            part = {symbol.index: _hull([point[k] for point in points]) for k, symbol in enumerate(symbols)}
            between = [3.0 * (points[i + 1] - points[i]) / tau for i in range(3)]  # Bernstein coefficients of the derivative
            part |= {
                symbol.index: _hull([point[len(symbols) - n + k] for point in between])
                for k, symbol in enumerate(self._acceleration)
            }
            parts.append(part)
        return nodes, parts


def _divided(values: list, *counts: int) -> list[list]:
    """Values in consecutive groups of the given sizes."""
    rest = iter(values)
    return [list(islice(rest, count)) for count in counts]


def onward(share: Scalar, shortest: Scalar) -> Scalar:
    """Share of a step to be tried next, no less than half of the shortest resolvable step."""
    return math.maximum(share, 0.5 * shortest)


def _hull(values) -> Interval:
    return reduce(Interval.hull, map(Interval.point, values))


def _exponents(outputs) -> list[Expression]:
    """Arguments of exponential functions: a narrow peak is negligible at every stage outside of it."""
    return list(dict.fromkeys(node.operands[0] for node in reachable(outputs) if node.op == "exp"))


def _most(value: Interval) -> Scalar:
    return math.maximum(_size(value), _size(-value))


def _size(value: Interval) -> Scalar:
    return math.maximum(math.maximum(value.high, -value.low), 0.0)


class Switching(NamedTuple):
    """Switching times, switching functions and velocity jumps that the steps of a motion resolve.

    Attributes
    ----------
    times : Timetable
        Switching times of laws of time, and a mesh that resolves these laws.
    watch : Kernel or None
        :attr:`SwitchingFunctions.machine_code`; None where no law has a switching function of the state.
    called : tuple of str
        Loads with opaque callbacks of the state.
    conditional : tuple of str
        Loads whose laws have switching functions of the state.
    jumps : Jumps
        Possible jumps of prescribed velocities.
    """

    times: Timetable = NO_TIMES
    watch: Kernel | None = None
    called: tuple[str, ...] = ()
    conditional: tuple[str, ...] = ()
    jumps: Jumps = NO_JUMPS

    def share(self, begin: Point, end: Point) -> tuple[float, float]:
        """Share of a step without undetected crossings, and the number of crossings detected in all of it."""
        if self.watch is None:
            return 1.0, 0.0
        parts = [([p.state.t], p.state.q, p.state.v, p.rates.acceleration) for p in (begin, end)]
        share, crossings = self.watch(np.concatenate([*parts[0], *parts[1]]))
        return float(share), float(crossings)


def switching(system: System, laws: Laws, start: State, end: float, breaks=()) -> Switching:
    """Switching times, switching functions and velocity jumps of a motion.

    Parameters
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.
    start : State
        Initial state.
    end : float
        Final time [s].
    breaks : sequence of float
        Further switching times [s].
    """
    begin, monotone = start.t, bool(system.scene.changing)  # release of contacts is checked at few times of a step
    given = [*breaks, *(t for bound in system.loads for t in getattr(bound.load, "breaks", ()) if begin < t < end)]
    times = Timetable(np.unique(np.asarray(given, dtype=float)), np.zeros(0)) if given else NO_TIMES
    if laws.outputs:
        times = times.join(timetable(laws.outputs, laws.motion.state.t, begin, end, monotone))
    prescribed = prescribed_times(system.relations, begin, end, monotone)
    unilateral = [prescribed_times(found, begin, end, monotone) for found in (system.contacts, system.grips)]
    times = times.join(prescribed, *unilateral)
    jumps = prescribed_jumps(system, start, end, prescribed.stops(begin, end))
    motion = kinematics(system, start) if laws.called else None
    asked = [(law, f"the law of {bound.load.name!r}") for bound in laws.called for law in bound.laws]
    times = times.join(*(sampled_times(law, motion, begin, end, what) for law, what in asked))
    times = times.join(*_limits(system, start, end))
    watch, called = watch_of(system, laws), tuple(bound.load.name for bound in laws.called if asks_where(bound.load))
    found = Switching(times, None, called, jumps=jumps)
    return found._replace(watch=watch.machine_code, conditional=watch.names) if watch else found


def prescribed_times(relations: Relations, begin: float, end: float, monotone: bool = False) -> Timetable:
    """Switching times and mesh of the laws of time in relations."""
    function = relations.function
    if not relations.asks_time:
        return NO_TIMES
    outputs = [x for x in function.outputs if isinstance(x, Expression)]
    return timetable(outputs, function.inputs[-1], begin, end, monotone)


def _limits(system: System, start: State, end: float) -> list[Timetable]:
    """Switching times of the limits of set-valued elements, which are no loads while they stick."""
    given = [getattr(grip, name, None) for grip in system.scene.grips.values() for name in LIMITS]
    found = []
    for law in [value for value in given if callable(value)]:
        motion = symbols(system)
        traced = traced_law(law, motion)
        if isinstance(traced, str):
            found.append(sampled_times(as_function(law), kinematics(system, start), start.t, end))
        else:
            asked = [entry for entry in traced.outputs if isinstance(entry, Expression)]
            found.append(timetable(asked, motion.state.t, start.t, end, monotone=True))
    return found


def watch_of(system: System, laws: Laws) -> SwitchingFunctions | None:
    """Switching functions of traced laws, cached with the system; None where there are none."""
    if not laws.outputs:
        return None
    make = lambda: SwitchingFunctions(system, laws)  # noqa: E731
    return (make() if system.dynamics is None else system.dynamics.on_demand((SwitchingFunctions, laws.key), make)) or None


def endless(t: float, names: tuple[str, ...]) -> str:
    """Message when laws of these loads chatter: time no longer advances."""
    return (
        f"t = {t:.6g} s: the law of {', '.join(map(repr, names))} switches again and again here (a sliding mode), "
        "as friction written with the sign of a rate does where it sticks. Use scene.joint_friction, or a continuous law, "
        "such as gauss.math.tanh(rate / width)."
    )
