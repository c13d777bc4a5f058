"""Switching functions of traced laws on the state: detection of crossings that the error estimate of a step may miss.

Within a step, coordinates and rates are cubic Hermite polynomials. On each of :data:`PARTS` subintervals the hull of the
Bernstein coefficients encloses them, and interval arithmetic encloses the switching function g and its rate. A subinterval
is clear if the enclosure of g, or that of its rate, excludes zero. The error estimate reacts to one sign change of one
switching function, since the last stages lie beyond it, but for places where it is small by chance
(:mod:`gauss.dynamics.laws.kink_error`); it may miss two, as where a narrow region is entered and left.
"""

from collections.abc import Iterable
from functools import cached_property, partial, reduce
from itertools import chain, islice, starmap
from operator import sub
from typing import Protocol

import numpy as np

from gauss import math
from gauss.codegen import Expression, Function, Kernel, Scalar, forward, reachable, write
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.constraint_functions import residual_functions, watched_functions
from gauss.dynamics.laws.enclosed_parts import (
    PARTS,
    enclosed_parts,
    hidden_peaks,
    largest_size,
    may_turn,
    sign_changes,
    upper_bounds,
)
from gauss.dynamics.laws.intervals import Interval, enclose, written_enclosures, written_values
from gauss.dynamics.laws.kink_error import kink_error, kink_factor
from gauss.dynamics.laws.levels import LEVELED, leveled
from gauss.dynamics.laws.narrow_peaks import NarrowPeaks, ends_of
from gauss.dynamics.laws.products import Products
from gauss.dynamics.laws.switching_times import CONDITIONS, SIGN_ROUNDING, jumps, timed_nodes
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import cached
from gauss.integrators import Point, Tolerance
from gauss.system import State, System, coordinate_rates, coordinate_units

POINTS = 5  # random points at which switching functions are compared
SHORT, ONWARD = 6.0, 1e6  # smallest steps that may cross a surface undivided, and growth of the step after such a one
TRIES = 40.0  # consecutive rejections, after which the crossing is shorter than the resolution of time


class TracedFunctions(Protocol):
    """Traced functions over the symbols of a motion, each with a name."""

    @property
    def motion(self) -> Kinematics | None:
        """The system in symbols."""

    @property
    def outputs(self) -> list[Expression]:
        """Outputs of all functions."""

    @property
    def functions(self) -> list[tuple[str, Function]]:
        """The functions with their names."""


class SwitchingFunctions:
    """Switching functions of the traced laws of a system, other than those of time.

    ``laws``: its loads, or other functions of its motion.

    Attributes: ``pairs``: the two sides of every comparison; a switching function is their difference.
    """

    def __init__(self, system: System, laws: TracedFunctions):
        self.system, self.laws, outputs = system, laws, laws.outputs
        every = reachable(outputs)
        timed = {node.index for node in timed_nodes(every, self._clock)} if outputs else set()
        nodes = [node for node in every if node.op in CONDITIONS and node.index not in timed]
        self.pairs = self._distinct(_compared(nodes))
        self.noise = self._rounding()
        self.steps, self.levels = leveled(nodes)
        self.jumps = [_jumps(x) for x in (*starmap(sub, self.pairs), *self.steps)]
        self.peaks, self.phases = (_arguments(every, timed, *ops) for ops in (("exp",), ("sin", "cos")))
        self.products = Products(outputs, timed)
        self.names = _names(laws, {node.index for node in (*nodes, *self.peaks, *self.products.nodes)})

    def __bool__(self):
        return bool(self.pairs or self.steps or self.peaks or self.products)

    def judged(
        self, ends: tuple[Point, Point], error, factor, refused, smallest, tolerance: Tolerance
    ) -> tuple[Scalar, Scalar]:
        """Error and step-size factor of a step, corrected for crossings that its error estimate may miss.

        The shortest resolvable step across one switching surface is accepted with any error.
        """
        if not self:
            return error, factor
        begin, end = ends
        share, crossings, place = self.share(begin.state, begin.rates.acceleration, end.state, end.rates.acceleration)
        shortest = SHORT * smallest / (end.state.t - begin.state.t)
        short = math.where(shortest > 1.0, 1.0, 0.0)
        asked = math.where(refused < TRIES, math.where(error <= 1.0, 1.0 - short, 0.0), 0.0)
        kinked = kink_error(begin, end, tolerance)
        bent = math.where(place < 1.0, math.where(kinked > 1.0, asked, 0.0), 0.0)
        share = math.where(share < 1.0, share, math.where(bent > 0.0, kink_factor(kinked, place), 1.0))
        unseen = math.where(share < 1.0, asked, 0.0)
        error, factor = math.where(unseen > 0.0, np.inf, error), math.where(unseen > 0.0, onward(share, shortest), factor)
        across = math.where(crossings > 0.5, short, 0.0)
        return math.where(across > 0.0, 0.0, error), math.where(across > 0.0, ONWARD, factor)

    def passes(self, begin: Point, end: Point) -> Scalar:
        """1 where a step may hold undetected crossings of a switching surface, else 0."""
        if not self:
            return 0.0
        share, _, _ = self.share(begin.state, begin.rates.acceleration, end.state, end.rates.acceleration)
        return math.where(share < 1.0, 1.0, 0.0)

    @property
    def may_be_narrow(self) -> bool:
        """Whether laws have smooth peaks that fixed steps may not resolve."""
        return bool(self.peaks or self.products)

    def oscillates(self, begin: Point, end: Point) -> Scalar:
        """1 where a law oscillates along the coordinates faster than a fixed step resolves, else 0."""
        return self.narrow.turns(*ends_of(begin, end)) if self.phases else 0.0

    def is_between(self, state: State) -> bool:
        """Whether some switching function has a switching value in a state, but for rounding."""
        given = {
            x.index: Interval.point(float(y)) for x, y in zip(self._symbols, [state.t, *state.q, *state.v], strict=True)
        }
        sides = enclose(list(chain(*self.pairs)), given)
        with np.errstate(all="ignore"):
            size = [abs(one.low) + abs(other.low) for one, other in zip(sides[::2], sides[1::2], strict=True)]
            apart = [abs(one.low - other.low) for one, other in zip(sides[::2], sides[1::2], strict=True)]
            steps = [float(value.low) for value in enclose(self.steps, given)]
        met = (np.array(apart) <= SIGN_ROUNDING * np.array(size) + self.noise).any()
        found = [(x, own) for x, own in zip(steps, self.levels, strict=True) if np.isfinite(x)]
        return bool(met) or any(abs(x - own.nearest(x)) <= SIGN_ROUNDING * abs(x) for x, own in found)

    def share(self, begin: State, first: np.ndarray, end: State, last: np.ndarray) -> tuple[Scalar, Scalar, Scalar]:
        """Share of a step without undetected crossings, 1 for all of it; number and place of detected crossings.

        The place is the middle of the subinterval of the first one beyond rounding, relative to the step, 1 without any.

        ``first``, ``last`` (n_v,): accelerations there.
        """
        crossings, distinct, crossed = 0.0, 0.0, 1.0
        hidden = self._without_narrow_peaks(begin, first, end, last)
        if not any(self._groups):
            return hidden, 0.0, 1.0
        nodes, parts = enclosed_parts(self.system, begin, first, end, last)
        ends = [list(self._values(node)) for node in nodes]
        conditions, tau = len(self.pairs) + len(self.steps), (end.t - begin.t) / PARTS
        ends_of_all = (self._enclosures(np.ravel(part)).reshape(-1, 2) for part in parts)
        enclosed = [_divided(starmap(Interval, own), *self._counts) for own in ends_of_all]
        tops = [
            upper_bounds(values[conditions:], rates[conditions:], (ends[j][conditions:], ends[j + 1][conditions:]), tau)
            for j, (values, rates, _, _) in enumerate(enclosed)
        ]
        highest = list(map(partial(reduce, math.maximum), zip(*tops, strict=True)))
        for j, (values, rates, found, steps) in enumerate(enclosed):
            size = [largest_size(one) + largest_size(other) for one, other in zip(found[::2], found[1::2], strict=True)]
            jumping = iter([math.where(step.low < step.high, 1.0, 0.0) for step in steps])
            middle = (j + 0.5) / PARTS
            hidden = hidden_peaks((ends[j][conditions:], ends[j + 1][conditions:]), tops[j], highest, hidden, middle)
            for k, value in enumerate(values[:conditions]):
                noise = SIGN_ROUNDING * size[k] + self.noise[k] if k < len(self.pairs) else self.levels[k - len(self.pairs)]
                changes, straddles = sign_changes(value, ends[j][k], ends[j + 1][k], noise)
                turns = may_turn(rates[k] if rates else None)
                for jump in islice(jumping, len(self.jumps[k])):
                    turns = math.maximum(turns, jump)
                crossings = crossings + changes
                heard = self._beyond_rounding(k, changes, ends[j][k], ends[j + 1][k])
                distinct = distinct + heard
                crossed = math.where(heard > 0.0, math.minimum(crossed, middle), crossed)
                unclear = straddles * turns * (1.0 - changes)
                hidden = math.where(unclear > 0.0, math.minimum(hidden, middle), hidden)
        return math.minimum(hidden, math.where(distinct > 1.5, crossed, 1.0)), crossings, crossed

    def _without_narrow_peaks(self, begin: State, first: np.ndarray, end: State, last: np.ndarray) -> Scalar:
        """Share of a step before its first narrow peak of a product, 1 where there is none."""
        given = ([begin.t], begin.q, begin.v, first, [end.t], end.q, end.v, last)
        return self.narrow.hidden(*given)[0] if self.products else 1.0

    def _beyond_rounding(self, k: int, changes: Scalar, before: Scalar, after: Scalar) -> Scalar:
        """Changes of the sign of a function, 0 where its values at both ends of a subinterval are rounding."""
        if k >= len(self.pairs) or not self.noise[k]:
            return changes
        return math.where(math.maximum(math.abs(before), math.abs(after)) > self.noise[k], changes, 0.0)

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

    def _rounding(self) -> np.ndarray:
        """Rounding of the switching function of each pair, by that of coordinates and rates of the size of the scene.

        It bounds what is left where coordinates and rates are zero but for rounding, as in a mechanism at rest. Of a few
        states the least, for a function may be steep in some.
        """
        if not self.pairs:
            return np.zeros(0)
        system, eps = self.system, np.finfo(float).eps
        lengths = np.array([system.scale.length if unit == "m" else 1.0 for unit in coordinate_units(system).values()])
        sizes = np.concatenate([[system.scale.time], lengths, system.scale.rates])
        off = eps * np.concatenate([[0.0], sizes[1:]])  # time is exact
        centre = np.concatenate([[0.0], system.reference.q, np.zeros(system.n_v)])
        rng, found = np.random.default_rng(0), np.full(len(self.pairs), np.inf)
        for _ in range(POINTS):
            point = centre + sizes * rng.uniform(0.1, 0.5, sizes.size)
            near = [Interval(low, high) for low, high in zip(point - off, point + off, strict=True)]
            given = {symbol.index: around for symbol, around in zip(self._symbols, near, strict=True)}
            with np.errstate(all="ignore"):
                widths = [float(0.5 * (g.high - g.low)) for g in enclose(list(starmap(sub, self.pairs)), given)]
            found = np.fmin(found, widths)
        return np.where(np.isfinite(found), found, 0.0)

    @cached_property
    def machine_code(self) -> Kernel:
        """Machine code of :meth:`share`: (t, q, v, q̈) at both ends of a step → (share, crossings, place)."""
        sizes = (1, self.system.n_q, self.system.n_v, self.system.n_v)

        def share(t, q, v, first, t_end, q_end, v_end, last):
            return list(self.share(State(t[0], q, v), first, State(t_end[0], q_end, v_end), last))

        return Kernel(write(share, *sizes, *sizes, name="unseen"), batch=False)

    @cached_property
    def narrow(self) -> NarrowPeaks:
        """Its products, exponential functions, sines and cosines."""
        given = self.products, self.peaks, self.phases, self._slopes
        return NarrowPeaks(self.system, self._symbols, self._acceleration, *given)

    @cached_property
    def _groups(self) -> tuple[list, list, list, list]:
        """Switching functions, their time derivatives, sides of comparisons and discontinuous nodes."""
        asked = [*starmap(sub, self.pairs), *self.steps, *self.peaks]
        return asked, self._slopes(asked), list(chain(*self.pairs)), list(chain(*self.jumps))

    @property
    def _counts(self) -> list[int]:
        return list(map(len, self._groups))

    @cached_property
    def _values(self) -> Function:
        """(t, q, v) → values of the switching functions: written once, called at every end of a subinterval."""
        return written_values(self._groups[0], self._symbols, "switching")

    @cached_property
    def _enclosures(self) -> Function:
        """Low and high of each of (t, q, v, q̈) → those of all groups: written once, called for every subinterval."""
        return written_enclosures(list(chain(*self._groups)), [*self._symbols, *self._acceleration], "enclosures")

    def _slopes(self, asked) -> list:
        """Time derivatives of switching functions, with accelerations as symbols; empty if one has none."""
        symbols = self._symbols
        try:
            return list(forward(asked, symbols, [1.0, *self._rates, *self._acceleration]))
        except TypeError:
            return []

    @property
    def _state(self) -> State:
        assert self.laws.motion is not None  # there are traced laws
        return self.laws.motion.state

    @property
    def _clock(self) -> Expression:
        assert isinstance(self._state.t, Expression)
        return self._state.t

    @property
    def _symbols(self) -> list[Expression]:
        return [self._clock, *self._state.q, *self._state.v]

    @property
    def _rates(self) -> np.ndarray:
        return coordinate_rates(self.system, self._state.q, self._state.v)

    @property
    def _acceleration(self) -> np.ndarray:
        return self._clock.graph.symbols("a", self.system.n_v)


def _compared(nodes: list[Expression]) -> list:
    """Sides of every comparison, each pair once."""
    return list(dict.fromkeys(node.operands for node in nodes if node.op not in LEVELED))


def _names(laws: TracedFunctions, nodes: set[int]) -> tuple[str, ...]:
    """Loads whose laws depend on some nodes."""
    has = lambda function: any(node.index in nodes for node in reachable(function.outputs))  # noqa: E731
    return tuple(dict.fromkeys(name for name, function in laws.functions if has(function)))


def _jumps(x: Expression) -> list[Expression]:
    """Discontinuous nodes of an expression, on whose value its rate bounds nothing."""
    return [node for node in reachable([x]) if jumps(node)]


def _divided(values: Iterable, *counts: int) -> list[list]:
    """Values in consecutive groups of the given sizes."""
    rest = iter(values)
    return [list(islice(rest, count)) for count in counts]


def onward(share: Scalar, shortest: Scalar) -> Scalar:
    """Share of a step to be tried next, no less than half of the shortest resolvable step."""
    return math.maximum(share, 0.5 * shortest)


def _arguments(nodes: list[Expression], timed: set[int], *ops: str) -> list[Expression]:
    """Arguments of functions, other than those of time.

    A narrow peak of an exponential function is negligible at every stage outside of it.
    """
    found = dict.fromkeys(node.operands[0] for node in nodes if node.op in ops)
    return [x for x in found if x.index not in timed]


def functions_of(system: System, laws: Laws) -> SwitchingFunctions | None:
    """Switching functions, peaks and oscillations of traced laws and constraints, cached with the system."""
    functions = watched_functions(system, laws)
    if not functions.outputs:
        return None
    make = lambda: SwitchingFunctions(system, functions)  # noqa: E731
    return cached(system, (SwitchingFunctions, laws.key), make)


def watch_of(system: System, laws: Laws) -> SwitchingFunctions | None:
    """Switching functions of traced laws and constraints, cached with the system; None where there are none."""
    return functions_of(system, laws) or None


def constraint_watch(system: System) -> Kernel | None:
    """:attr:`SwitchingFunctions.machine_code` of the residuals of constraints alone; None where they have none."""
    make = lambda: SwitchingFunctions(system, residual_functions(system))  # noqa: E731
    found = cached(system, (constraint_watch,), make)
    return found.machine_code if found else None
