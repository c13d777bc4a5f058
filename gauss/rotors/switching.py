"""Switching of the torque laws of a network: switching times, and event location of switching functions.

Switching times are found beforehand (:mod:`gauss.dynamics.laws.switching_times`). A condition on angles and speeds is a
switching
function g; on subintervals of every step the Bernstein coefficients of the dense output enclose angles and speeds, and
interval arithmetic encloses g and its rate (Moore, Kearfott, Cloud, Introduction to Interval Analysis, ch. 5). A step ends
at a discontinuity of a law. It may cross one surface at which a law is continuous with a kink, for which its error estimate
suffices. It is rejected where it may cross two, and where a smooth law, such as exp(−α²), may be far from its samples.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gauss.codegen import Expression, Graph, forward, reachable
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching_times import (
    CONDITIONS,
    GRADUAL,
    NO_TIMES,
    SIGN_ROUNDING,
    SMALL,
    Timetable,
    of_time,
    timetable,
)
from gauss.rotors.bernstein import NODES, PARTS, hulls
from gauss.rotors.laws import DC, Constant, Kloss, Linear, Periodic, Quadratic, Viscous
from gauss.rotors.links import FrictionDrive
from gauss.rotors.mechanics import link_ends
from gauss.rotors.reduced import Reduced
from gauss.rotors.traction import Hyperbola, symmetric_slip

PLAIN = (Constant, Viscous, Quadratic, Linear, Kloss, DC, Periodic)  # smooth laws, without conditions
BENT = ("exp", "div", "sqrt", "log", "atan2")  # operations that may be flat in one region and steep in another
KINKS = ("min", "max")  # conditions at which a law is continuous
RESOLVED = 1e-14  # of the duration: closer crossings are one, and shorter steps are not searched


class TracedLaws:
    """Torques and characteristics of a network as expressions of (t, θ, w); opaque ones by name.

    Parameters
    ----------
    reduced : Reduced
        The network.

    Attributes
    ----------
    t : Expression
        Time.
    theta, w : ndarray of Expression, shape (n_g,)
        Angles turned and speeds of the roots.
    outputs : dict of str to Expression
        Torques by name of their element.
    own : set of int
        Indices of expressions of the network itself, whose conditions are located as events.
    opaque : dict of str to Term or None
        Terms with opaque laws by name; None for a characteristic.
    """

    def __init__(self, reduced: Reduced):
        graph, n_g = Graph(), reduced.n_groups
        self.t, self.theta, self.w = graph.symbol("t"), graph.symbols("theta", n_g), graph.symbols("w", n_g)
        self.outputs: dict[str, Expression] = {}
        self.opaque: dict[str, tuple] = {}
        self.own: set[int] = set()
        self.reduced = reduced
        for term in reduced.terms:
            if not isinstance(term.law, PLAIN):
                j = reduced.names.index(term.shaft)
                self._keep(term.name, term, lambda term=term, j=j: term.law(self.t, self._angle(j), self._speed(j)))
        for b, link in enumerate(reduced.links):
            if isinstance(link, FrictionDrive) and not isinstance(link.curve, Hyperbola):
                slip = self._slip(b)
                self.own |= {node.index for node in reachable([slip])}
                self._keep(link.name, None, lambda link=link, slip=slip: link.curve(slip, 1.0))

    def _angle(self, j: int):
        g = self.reduced.group[j]
        return float(self.reduced.angle[j]) + float(self.reduced.K[j]) * self.theta[g]

    def _speed(self, j: int):
        return float(self.reduced.K[j]) * self.w[self.reduced.group[j]]

    def _slip(self, b: int):
        shafts = self.reduced.driver[b], self.reduced.driven[b]
        ends = link_ends(self.reduced, b, self.t, {j: self._angle(j) for j in shafts}, {j: self._speed(j) for j in shafts})
        return symmetric_slip(ends.v_d, ends.v, ends.v_0)

    def _keep(self, name: str, term, evaluate):
        try:
            found = evaluate()
        except TypeError:
            self.opaque[name] = term
            return
        if isinstance(found, Expression):
            self.outputs[name] = found


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
        self.unit = min(1.0, float(reduced.inertia @ reduced.K**2) * reduced.largest**2)  # of ratios, of torques
        outputs = list(laws.outputs.values())
        own = laws.own | {node.index for node in of_time(outputs, laws.t)}
        nodes = [node for node in reachable(outputs) if node.op in CONDITIONS and node.index not in own]
        self.sides = [node.operands for node in nodes if node.op != "floor"]
        self.floors = [node.operands[0] for node in nodes if node.op == "floor"]
        self.curved = _curved(outputs, own)
        self.known = np.full(len(self.curved), np.inf), np.full(len(self.curved), -np.inf)  # range of values so far
        self.asked = [x - y for x, y in self.sides] + self.floors
        self.jumps = np.array([node.op not in KINKS for node in nodes if node.op != "floor"] + [True] * len(self.floors))
        self.noise = np.where(self.jumps, SIGN_ROUNDING, np.maximum(rtol, SIGN_ROUNDING))
        jumping = {node.index for node in nodes if node.op not in KINKS}
        has = lambda output: any(node.index in jumping for node in reachable([output]))  # noqa: E731
        self.names = tuple(name for name, output in laws.outputs.items() if has(output))
        self.symbols = [laws.t, *laws.theta, *laws.w]
        self.accelerations = list(laws.t.graph.symbols("a", len(laws.w)))
        moving = [*self.asked, *self.curved]
        slopes = forward(moving, self.symbols, [1.0, *laws.w, *self.accelerations]) if moving else []
        self.slopes = [x if isinstance(x, Expression) else laws.t.graph.constant(float(x)) for x in slopes]
        self.terms = list(dict.fromkeys(term for asked in self.asked for term in _terms(asked)))
        self.part_of = np.array([[term in _terms(asked) for term in self.terms] for asked in self.asked], dtype=float)

    def __bool__(self):
        return bool(self.asked or self.curved)

    def values(self, t, y) -> np.ndarray:
        """Switching functions, then expressions of :func:`_curved`, at times (k,) and y (2 n_g, k)."""
        found = enclose([*self.asked, *self.curved], self._points(t, y))
        return np.array([np.broadcast_to(value.low, np.shape(t)) for value in found])

    def share(self, begin: float, end: float, dense, finest: float) -> tuple[float, float | None]:
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
        at, n_g = self.values(times, y)[:, :: (len(NODES) - 1) // PARTS], len(self.accelerations)
        low, high, slope_low, slope_high = hulls(y, end - begin)
        edges = times[:: (len(NODES) - 1) // PARTS]
        given = {self.symbols[0].index: Interval(edges[:-1], edges[1:])}
        given |= {s.index: Interval(*ends) for s, *ends in zip(self.symbols[1:], low, high, strict=True)}
        given |= {
            s.index: Interval(*ends) for s, *ends in zip(self.accelerations, slope_low[n_g:], slope_high[n_g:], strict=True)
        }
        found = enclose([*self.asked, *self.curved, *self.slopes, *self.terms], given)
        ends = np.array([[np.broadcast_to(side, (PARTS,)) for side in value] for value in found])
        n, both = len(self.asked), len(self.asked) + len(self.curved)
        value, rate, size = ends[:n], ends[both : both + n], ends[2 * both :]
        hidden = self._hidden(at[n:], ends[n:both], ends[both + n : 2 * both], edges)
        at = at[:n]
        noise = self.noise[:, None] * (self.part_of @ np.abs(size).max(axis=1))
        level = self._level(at)
        changes = level[:, :-1] != level[:, 1:]
        straddles = (value[:, 0] < -noise) & (value[:, 1] > noise)
        floors = len(self.sides)
        straddles[floors:] = np.floor(value[floors:, 0]) < np.floor(value[floors:, 1])
        turns = ~((rate[:, 0] > 0.0) | (rate[:, 1] < 0.0))
        unclear = np.flatnonzero((straddles & turns & ~changes).any(axis=0) | hidden)
        share = (unclear[0] + 0.5) / PARTS if unclear.size else 1.0
        deep = changes & (np.maximum(np.abs(at[:, :-1]), np.abs(at[:, 1:])) > noise)
        crossed = np.argwhere(deep)
        if not crossed.size or share < (crossed[:, 1].min() + 0.5) / PARTS:
            return share, None
        times = self._located(crossed, level, edges, dense, finest)
        order = np.argsort(times, kind="stable")
        first, jumps = times[order], self.jumps[crossed[order, 0]]
        together = first <= first[0] + finest
        if jumps[together].any():
            return 1.0, float(first[0])
        if together.all():
            return share, None
        return min(share, (0.5 * (first[0] + first[~together][0]) - begin) / (end - begin)), None

    def _hidden(self, at, ends, rates, edges) -> np.ndarray:
        """Subintervals (PARTS,) in which an expression of :func:`_curved` may be far from all of its samples."""
        reach = np.diff(edges) * np.abs(rates).max(axis=1)
        low, high = np.maximum(ends[:, 0], at[:, :-1] - reach), np.minimum(ends[:, 1], at[:, :-1] + reach)
        least, most = at.min(axis=1, initial=np.inf), at.max(axis=1, initial=-np.inf)
        self.known = np.minimum(self.known[0], least), np.maximum(self.known[1], most)
        seen = np.maximum(np.abs(self.known[0]), np.abs(self.known[1]))
        allowed = GRADUAL * (most - least) + SMALL * (self.known[1] - self.known[0]) + self.rtol * (seen + self.unit)
        return (np.maximum(high - most[:, None], least[:, None] - low) > allowed[:, None]).any(axis=0)

    def _located(self, crossed, level, edges, dense, finest: float) -> np.ndarray:
        """Times of crossings (switching function, subinterval) [s], by Brent's method."""
        times = []
        for k, part in crossed:
            before = level[k, part]
            past = lambda t, k=k, before=before: (  # noqa: E731
                0.5 if self._level(self.values(np.array([t]), dense(np.array([t]))))[k, 0] == before else -0.5
            )
            times.append(brentq(past, edges[part], edges[part + 1], xtol=0.25 * finest, rtol=1e-15))
        return np.array(times)

    def _level(self, values: np.ndarray) -> np.ndarray:
        """Side of each surface: the sign of g, or its integer part."""
        below, n = len(self.sides), len(self.asked)
        return np.concatenate([values[:below] < 0.0, np.floor(values[below:n])])

    def _points(self, t, y) -> dict:
        given = {self.symbols[0].index: Interval.point(np.asarray(t))}
        return given | {s.index: Interval.point(value) for s, value in zip(self.symbols[1:], y, strict=True)}


def _curved(outputs, own: set[int]) -> list[Expression]:
    """Expressions without conditions that may be flat at some angles and speeds and steep at others."""
    conditional: set[int] = set()
    bent: set[int] = set()
    found = []
    for node in reachable(outputs):
        if node.op in (*CONDITIONS, "select") or any(x.index in conditional for x in node.operands):
            conditional.add(node.index)
        elif node.op in BENT or any(x.index in bent for x in node.operands):
            bent.add(node.index)
            if node.index not in own and (node.op in BENT or node.op in ("add", "sub")):
                found.append(node)
    return found


def _terms(node: Expression) -> tuple[Expression, ...]:
    """Terms of a sum."""
    if node.op in ("add", "sub", "neg"):
        return tuple(term for operand in node.operands for term in _terms(operand))
    return (node,)


class Switching(NamedTuple):
    """Switching times and switching functions that the steps of a run resolve.

    Attributes
    ----------
    times : Timetable
        Switching times of laws of time, and a mesh that resolves these laws.
    surfaces : Surfaces
        Switching functions of angles and speeds.
    opaque : tuple of str
        Elements with opaque laws.
    duration : float
        Duration of the run [s].
    """

    times: Timetable
    surfaces: Surfaces
    opaque: tuple[str, ...]
    duration: float

    @property
    def finest(self) -> float:
        """Resolution of time [s]."""
        return RESOLVED * self.duration


def switching(reduced: Reduced, duration: float, rtol: float, breaks=()) -> Switching:
    """Switching times and switching functions of a run.

    Parameters
    ----------
    reduced : Reduced
        The network.
    duration : float
        Duration of the run [s].
    rtol : float
        Relative tolerance of its steps.
    breaks : sequence of float
        Further switching times [s].
    """
    laws = TracedLaws(reduced)
    given = [*breaks, *(t for term in reduced.terms for t in term.breaks)]
    times = Timetable(np.unique([t for t in given if 0 < t < duration]).astype(float), np.zeros(0)) if given else NO_TIMES
    if laws.outputs:
        times = times.join(timetable(list(laws.outputs.values()), laws.t, 0.0, duration))
    terms = [term for term in laws.opaque.values() if term is not None]
    times = times.join(*(_sampled(reduced, term, duration) for term in terms))
    return Switching(times, Surfaces(laws, rtol), tuple(laws.opaque), duration)


def _sampled(reduced: Reduced, term, duration: float) -> Timetable:
    """Discontinuities in time of an opaque law, at the initial angle and speed and a radian on at the largest speed."""
    j = reduced.names.index(term.shaft)
    angle, speed = reduced.angle[j], reduced.K[j] * reduced.speed[reduced.group[j]]
    places = (float(angle), float(speed)), (float(angle) + 1.0, float(reduced.largest))
    law = lambda t, _: [float(term.law(t, *place)) for place in places]  # noqa: E731
    begin, end = max(term.begin or 0.0, 0.0), duration if term.until is None else min(term.until, duration)
    return sampled_times(law, None, begin, end) if begin < end else NO_TIMES
