"""Switching functions of angles and speeds, located on the dense output of a step.

On subintervals of every step the Bernstein coefficients of the dense output enclose angles and speeds, and interval
arithmetic encloses each switching function and its rate (Moore, Kearfott, Cloud, Introduction to Interval Analysis, ch. 5).
A step ends at a discontinuity of a law. It may cross one surface at which a law is continuous with a kink, for which its
error estimate suffices. It is rejected where it may cross two, and where a smooth law, such as exp(−α²), may be far from its
samples. :mod:`gauss.dynamics.laws.switching_functions` asks the same of compiled steps, on cubic Hermite polynomials.
"""

from collections.abc import Callable, Iterable

import numpy as np
from scipy.optimize import brentq

from gauss.codegen import Expression, forward, reachable
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.levels import LEVELED, levels_of
from gauss.dynamics.laws.switching_times import CONDITIONS, GRADUAL, SIGN_ROUNDING, SMALL, jumps, of_time
from gauss.rotors.bernstein import NODES, PARTS, hulls
from gauss.rotors.traced_laws import TracedLaws

CURVED = ("exp", "div", "sqrt", "log", "atan2")  # operations that may be flat in one region and steep in another
POINTS = 16  # random points at which sizes of expressions are taken
STRIDE = (len(NODES) - 1) // PARTS  # nodes of a subinterval


class Surfaces:
    """Switching functions of angles and speeds.

    Parameters
    ----------
    laws : TracedLaws
        Laws of a network.
    rtol : float
        Relative tolerance of a step: closer to the surface of a continuous law, a value is on it.

    Attributes
    ----------
    names : tuple of str
        Elements with laws that are discontinuous at a surface.
    """

    def __init__(self, laws: TracedLaws, rtol: float):
        self.rtol, reduced = rtol, laws.reduced
        outputs = list(laws.outputs.values())
        own = laws.own | {node.index for node in of_time(outputs, laws.t)}
        comparisons, floors = _conditions(outputs, own)
        nodes = [*comparisons, *floors]
        self.n_comparisons, self.levels = len(comparisons), [levels_of(node) for node in floors]
        self.functions = [x - y for x, y in (node.operands for node in comparisons)] + [node.operands[0] for node in floors]
        self.curved = _curved(outputs, own)
        self.known = np.full(len(self.curved), np.inf), np.full(len(self.curved), -np.inf)  # range of values so far
        self.jumps = np.array([jumps(node) for node in nodes], dtype=bool)
        self.noise = np.where(self.jumps, SIGN_ROUNDING, np.maximum(rtol, SIGN_ROUNDING))
        self.names = _discontinuous(laws, nodes)
        self.symbols = [laws.t, *laws.theta, *laws.w]
        self.accelerations = list(laws.t.graph.symbols("a", len(laws.w)))
        self.units = self._sizes(self.curved, reduced.largest)
        self.rates = _rates([*self.functions, *self.curved], laws, self.symbols, self.accelerations)
        parts = [_terms(function) for function in self.functions]
        self.terms = list(dict.fromkeys(term for part in parts for term in part))
        self.part_of = np.array([[term in part for term in self.terms] for part in parts], dtype=float)

    def __bool__(self):
        return bool(self.functions or self.curved)

    def values(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Switching functions, then expressions of :func:`_curved`, at times (k,) and y (2 n_g, k)."""
        found = enclose([*self.functions, *self.curved], self._points(t, y))
        return np.array([np.broadcast_to(np.asarray(value.low), np.shape(t)) for value in found])

    def share(self, begin: float, end: float, dense: Callable, finest: float) -> tuple[float, float | None]:
        """Share of a step with at most one crossing, 1 for all of it; and the time of a discontinuity of a law in it [s].

        Parameters
        ----------
        begin, end : float
            Ends of the step [s].
        dense : callable
            Dense output, t (k,) → θ, w (2 n_g, k).
        finest : float
            Crossings closer in time than this are one [s].
        """
        times = begin + NODES * (end - begin)
        y = dense(times)
        edges, n = times[::STRIDE], len(self.functions)
        sampled = self.values(times, y)[:, ::STRIDE]
        values, rates, sizes = self._enclosures(y, edges)
        hidden = self._hidden(sampled[n:], values[n:], rates[n:], edges)
        at, values, rates = sampled[:n], values[:n], rates[:n]
        noise = self.noise[:, None] * (self.part_of @ np.abs(sizes).max(axis=1))
        level = self._level(at)
        changes = level[:, :-1] != level[:, 1:]
        straddles = (values[:, 0] < -noise) & (values[:, 1] > noise)
        floors = self.n_comparisons
        straddles[floors:] = self._levels(values[floors:, 0]) < self._levels(values[floors:, 1])
        turns = ~((rates[:, 0] > 0.0) | (rates[:, 1] < 0.0))
        unclear = np.flatnonzero((straddles & turns & ~changes).any(axis=0) | hidden)
        share = (unclear[0] + 0.5) / PARTS if unclear.size else 1.0
        deep = changes & (np.maximum(np.abs(at[:, :-1]), np.abs(at[:, 1:])) > noise)
        crossed = np.argwhere(deep)
        if not crossed.size or share < (crossed[:, 1].min() + 0.5) / PARTS:
            return share, None
        order, found = self._located(crossed, level, edges, dense, finest)
        together = found <= found[0] + finest
        if self.jumps[crossed[order, 0]][together].any():
            return 1.0, float(found[0])
        if together.all():
            return share, None
        return min(share, (0.5 * (found[0] + found[~together][0]) - begin) / (end - begin)), None

    def _sizes(self, nodes: list[Expression], speed: float) -> np.ndarray:
        """Typical sizes of expressions, each in its own unit: largest at random angles, speeds, and times of a radian."""
        scales = np.array([1.0 / speed, *(1.0 for _ in self.accelerations), *(speed for _ in self.accelerations)])
        points = np.random.default_rng(0).uniform(-1.0, 1.0, (len(scales), POINTS)) * scales[:, None]
        points[0] = np.abs(points[0])
        with np.errstate(all="ignore"):
            given = {symbol.index: Interval.point(values) for symbol, values in zip(self.symbols, points, strict=True)}
            found = np.array([np.broadcast_to(np.abs(value.low), POINTS) for value in enclose(nodes, given)])
        found = found.reshape(-1, POINTS)
        return np.where(np.isfinite(found), found, 0.0).max(axis=1, initial=0.0)

    def _enclosures(self, y: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Enclosures (…, 2, PARTS) of all functions, of their rates, and of the terms of switching functions."""
        n_g, both = len(self.accelerations), len(self.functions) + len(self.curved)
        low, high, rate_low, rate_high = hulls(y, edges[-1] - edges[0])
        given = {self.symbols[0].index: Interval(edges[:-1], edges[1:])}
        given |= {s.index: Interval(*ends) for s, *ends in zip(self.symbols[1:], low, high, strict=True)}
        given |= {
            s.index: Interval(*ends) for s, *ends in zip(self.accelerations, rate_low[n_g:], rate_high[n_g:], strict=True)
        }
        found = enclose([*self.functions, *self.curved, *self.rates, *self.terms], given)
        ends = np.array([[np.broadcast_to(np.asarray(side), (PARTS,)) for side in value] for value in found])
        return ends[:both], ends[both : 2 * both], ends[2 * both :]

    def _hidden(self, at, ends, rates, edges) -> np.ndarray:
        """Subintervals (PARTS,) in which an expression of :func:`_curved` may be far from all of its samples."""
        reach = np.diff(edges) * np.abs(rates).max(axis=1)
        low, high = np.maximum(ends[:, 0], at[:, :-1] - reach), np.minimum(ends[:, 1], at[:, :-1] + reach)
        least, most = at.min(axis=1, initial=np.inf), at.max(axis=1, initial=-np.inf)
        self.known = np.minimum(self.known[0], least), np.maximum(self.known[1], most)
        seen = np.maximum(np.abs(self.known[0]), np.abs(self.known[1]))
        allowed = GRADUAL * (most - least) + SMALL * (self.known[1] - self.known[0]) + self.rtol * (seen + self.units)
        beyond = np.maximum(high - most[:, None], least[:, None] - low) > allowed[:, None]
        return (beyond | _peaks(np.diff(at), allowed[:, None])).any(axis=0)

    def _located(self, crossed, level, edges, dense: Callable, finest: float) -> tuple[np.ndarray, np.ndarray]:
        """Order of crossings (switching function, subinterval), and their ascending times [s], by Brent's method."""
        times = []
        for k, part in crossed:

            def past(t: float, k=k, before=level[k, part]) -> float:
                return 0.5 if self._level(self.values(np.array([t]), dense(np.array([t]))))[k, 0] == before else -0.5

            times.append(brentq(past, edges[part], edges[part + 1], xtol=0.25 * finest, rtol=1e-15))
        order = np.argsort(times, kind="stable")
        return order, np.array(times)[order]

    def _level(self, values: np.ndarray) -> np.ndarray:
        """Side of each surface: the sign of g, or its integer part."""
        below, n = self.n_comparisons, len(self.functions)
        return np.concatenate([values[:below] < 0.0, self._levels(values[below:n])])

    def _levels(self, values: np.ndarray) -> np.ndarray:
        """Levels of the arguments of floors and rows, in the shape of their values."""
        return np.array([own.at(x) for own, x in zip(self.levels, values, strict=True)]).reshape(values.shape)

    def _points(self, t, y) -> dict:
        given = {self.symbols[0].index: Interval.point(np.asarray(t))}
        return given | {s.index: Interval.point(value) for s, value in zip(self.symbols[1:], y, strict=True)}


def _peaks(changes: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Subintervals (…, PARTS) on which a peak rises or falls that samples meet by chance: stages may lie beside it."""
    rises, falls = changes > allowed, changes < -allowed
    return (rises | falls) & rises.any(axis=1, keepdims=True) & falls.any(axis=1, keepdims=True)


def _curved(outputs, own: set[int]) -> list[Expression]:
    """Expressions without conditions that may be flat at some angles and speeds and steep at others."""
    conditional: set[int] = set()
    bent: set[int] = set()
    found: list[Expression] = []
    for node in reachable(outputs):
        if node.op in (*CONDITIONS, "select") or any(x.index in conditional for x in node.operands):
            conditional.add(node.index)
        elif node.op in CURVED or any(x.index in bent for x in node.operands):
            bent.add(node.index)
            if node.index not in own and (node.op in CURVED or node.op in ("add", "sub")):
                found.append(node)
    return found


def _conditions(outputs: list[Expression], own: set[int]) -> tuple[list[Expression], list[Expression]]:
    """Comparisons, and conditions of many levels, that are neither of the time alone nor of the network itself."""
    nodes = [node for node in reachable(outputs) if node.op in CONDITIONS and node.index not in own]
    return [node for node in nodes if node.op not in LEVELED], [node for node in nodes if node.op in LEVELED]


def _discontinuous(laws: TracedLaws, conditions: list[Expression]) -> tuple[str, ...]:
    """Elements with laws that are discontinuous at one of the conditions."""
    jumping = {node.index for node in conditions if jumps(node)}
    return tuple(n for n, law in laws.outputs.items() if any(node.index in jumping for node in reachable([law])))


def _rates(functions: list[Expression], laws: TracedLaws, symbols: list, accelerations: list) -> list[Expression]:
    """Time derivatives of functions of (t, θ, w)."""
    found: Iterable = forward(functions, symbols, [1.0, *laws.w, *accelerations]) if functions else []
    return [x if isinstance(x, Expression) else laws.t.graph.constant(float(x)) for x in found]


def _terms(node: Expression) -> tuple[Expression, ...]:
    """Terms of a sum."""
    if node.op in ("add", "sub", "neg"):
        return tuple(term for operand in node.operands for term in _terms(operand))
    return (node,)
