"""Laws that depend on time alone: their switching times, and a mesh that bounds the steps that resolve them.

Every comparison, minimum, maximum and floor of expressions of time is a condition; interval bisection finds all times at
which one changes (Moore, Kearfott, Cloud, Introduction to Interval Analysis, ch. 8) that is not known in closed form.
Between these times, a mesh isolates narrow features of a law: in each of its cells, the enclosure is little wider than
the range of samples.
"""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Expression, forward, reachable
from gauss.dynamics.laws.affine_conditions import affine_changes
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.step_sampling import LawOfTime, coarse_steps, laws_of_time

CONDITIONS = ("less", "less_equal", "min", "max", "floor", "row")
JUMPS = ("less", "less_equal", "floor")  # conditions at which values jump; all other operations are continuous
SIGN_ROUNDING = 1e-13  # relative to the terms of a switching function: smaller values have no sign
CURVED = ("exp", "sin", "cos", "sqrt", "log", "atan2", "div", "mul")  # operations with features that samples may miss
CELLS, PARTS = 64, 8  # initial cells of the bisection, and parts into which it divides one
MOST_CELLS = 400_000  # of the bisection at one level: about twice as many as switching times that it resolves
MOST_STEPS = 50_000  # cells of the mesh, each of which costs a step
EQUAL_TIMES = 4.0 * np.finfo(float).eps  # relative to the largest time: closer times are one
APART = 16.0 * np.finfo(float).eps  # relative to the largest time: distance of ends of steps from a switching time
STEEPEST = 12  # degree of a polynomial that the stages of a step resolve
PIECES = 8  # of a cell of the mesh: the stages of a step lie closer than two of them
LOOKS = (np.arange(2 * PIECES) + (np.arange(1, 2 * PIECES + 1) * 0.6180339887498949) % 1.0) / (2 * PIECES)  # no period
GRADUAL, SMALL = 0.4, 0.05  # most that a piece may span, of the range of samples in its cell plus the range of the law
RESTLESS = 0.1  # of the range: where most neighbouring samples differ by more, any step sees the variation of the law
COARSE = 4.0  # fixed steps that a cell must hold: a pulse takes about half of its cell
FINEST = 2.0**-24  # smallest cell of the mesh, relative to the interval


@dataclass(frozen=True)
class Timetable:
    """Switching times and mesh of laws of time."""

    # (k,) times at which a condition changes [s], ascending: no step crosses one; with the end of the interval if one is
    # another there than just before
    switches: np.ndarray
    mesh: np.ndarray  # (m,) ends of cells [s], ascending: steps end at each
    limitations: tuple[str, ...] = ()  # warnings about features that are not resolved
    laws: tuple[LawOfTime, ...] = ()  # laws of time, of which fixed steps may be too long

    def __bool__(self):
        return bool(self.switches.size or self.mesh.size)

    def join(self, *others: "Timetable") -> "Timetable":
        """Timetable of several laws together."""
        every = (self, *others)
        switches, mesh = (distinct(np.concatenate([getattr(one, name) for one in every])) for name in ("switches", "mesh"))
        said = dict.fromkeys(text for one in every for text in one.limitations)
        return Timetable(switches, mesh, tuple(said), tuple(law for one in every for law in one.laws))

    def unresolved(self, begin: float, end: float, step: float) -> int:
        """Number of cells of the mesh that fixed steps [s] do not resolve, and of steps in which laws oscillate."""
        oscillating = sum(coarse_steps(law, begin, end, step, self.switches)[0] for law in self.laws)
        if not self.mesh.size:
            return oscillating
        every = distinct(np.clip(np.concatenate([[begin, end], self.switches, self.mesh]), begin, end))
        inner = np.isin(every, self.mesh)
        return oscillating + int(((inner[1:] | inner[:-1]) & (np.diff(every) < COARSE * step)).sum())

    def first_coarse(self, begin: float, end: float, step: float) -> float:
        """Time from which fixed steps do not resolve the oscillation of a law [s]; infinite if there is none."""
        return min((coarse_steps(law, begin, end, step, self.switches)[1] for law in self.laws), default=np.inf)

    def stops(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Pairs (end of a step, start of the next one) after ``begin``, ascending; the last is (``end``, ``end``).

        At a switching time they differ by a few units in the last place, so that no evaluation falls upon it.
        """
        apart = APART * max(abs(begin), abs(end))
        inside = [times[(times > begin + apart) & (times < end - apart)] for times in (self.switches, self.mesh)]
        pairs = [(t - apart, t + apart) for t in inside[0]]
        near = np.abs(inside[1][:, None] - inside[0]).min(axis=1, initial=np.inf) if inside[1].size else np.zeros(0)
        pairs += [(t, t) for t in inside[1][near > 2.0 * apart]]
        merged: list[tuple[float, float]] = []
        for before, after in sorted(pairs):
            if merged and before <= merged[-1][1]:
                merged[-1] = (merged[-1][0], max(after, merged[-1][1]))
            else:
                merged.append((float(before), float(after)))
        return [*merged, (end, end)]

    def last_end(self, begin: float, end: float) -> float:
        """End of the last step up to ``end``: just before it where a switching time falls upon it."""
        if not self.switches.size:
            return end
        before = end - APART * max(abs(begin), abs(end))
        return before if ((self.switches >= before) & (self.switches <= end)).any() else end


NO_TIMES = Timetable(np.zeros(0), np.zeros(0))


def distinct(values: np.ndarray) -> np.ndarray:
    """Distinct values (m,), ascending: :func:`numpy.unique`, which imports masked arrays for 10 ms."""
    values = np.sort(values)
    return values[np.concatenate([np.ones(min(values.size, 1), bool), values[1:] != values[:-1]])]


def timetable(outputs, clock: Expression, begin: float, end: float, monotone: bool = False) -> Timetable:
    """Switching times and mesh of traced laws.

    ``outputs``: values of the laws, in one graph. ``monotone``: whether the mesh makes laws nearly monotone in each cell,
    for conditions that are sampled at few times of a step.
    """
    nodes = of_time(outputs, clock)
    conditions = [_condition(node) for node in nodes if node.op in CONDITIONS]
    limitations: list[str] = []
    switches = _changes(conditions, clock, begin, end, limitations) if conditions else np.zeros(0)
    degree = _degrees(nodes, clock)
    curved = [node for node in nodes if node.op in CURVED and degree[node.index] > STEEPEST]
    edges = np.array([begin, *switches[switches < end], end])
    mesh = _mesh(curved, conditions, clock, edges, limitations, monotone) if curved else np.zeros(0)
    law = laws_of_time(outputs, nodes, clock) if curved else None
    return Timetable(switches, mesh, tuple(limitations), () if law is None else (law,))


def of_time(outputs, clock: Expression) -> list[Expression]:
    """Nodes of expressions that depend on the time alone, operands first."""
    return timed_nodes(reachable(outputs), clock)


def timed_nodes(nodes: list[Expression], clock: Expression) -> list[Expression]:
    """Those of some nodes, operands first, that depend on the time alone."""
    alone: set[int] = {clock.index}
    found = []
    for node in nodes:
        operands = [x.index in alone for x in node.operands if not x.is_constant]
        if operands and all(operands) and node.op not in ("call", "item"):
            alone.add(node.index)
            found.append(node)
    return found


def _degrees(nodes, clock: Expression) -> dict[int, float]:
    """Degree of each node as a polynomial of the time between switching times; infinite for other functions."""
    found = {clock.index: 1.0}
    for node in nodes:
        x = [found.get(operand.index, 0.0) for operand in node.operands]
        if node.op in ("add", "sub", "neg", "min", "max"):
            found[node.index] = max(x)
        elif node.op == "select":
            found[node.index] = max(x[1:])
        elif node.op in ("mul", "div"):
            found[node.index] = sum(x) if node.op == "mul" or x[1] == 0.0 else np.inf
        else:
            found[node.index] = 0.0 if node.op in (*CONDITIONS, "entry") else np.inf
    return found


def jumps(node: Expression) -> bool:
    """Whether values may jump where a condition changes."""
    return node.op in JUMPS or (node.op == "row" and node.value.jumps)


def _condition(node: Expression) -> Expression:
    """Expression that is constant as long as a node does not switch."""
    if node.op not in ("min", "max"):
        return node
    x, y = node.operands
    return x < y if node.op == "min" else y < x  # as in the derivatives of min and max


def _changes(conditions, clock: Expression, begin: float, end: float, limitations: list[str]) -> np.ndarray:
    """Times in an interval at which a condition changes, to rounding; ``limitations`` reports where they are too many."""
    close = EQUAL_TIMES * max(abs(begin), abs(end))
    known, others = affine_changes(conditions, clock, begin, end, 2.0 * close)
    times = np.sort(np.append(known, _searched(others, clock, begin, end, limitations)))
    if not times.size:
        return times
    times = times[np.append(True, np.diff(times) > close)]
    inside = times[(times > begin + 4.0 * close) & (times < end - 4.0 * close)]
    return np.append(inside, end) if times[-1] >= end - 4.0 * close else inside


def _searched(conditions, clock: Expression, begin: float, end: float, limitations: list[str]) -> np.ndarray:
    """Times at which a condition changes, by bisection."""
    ends, close = np.linspace(begin, end, CELLS + 1), EQUAL_TIMES * max(abs(begin), abs(end))
    low, high = (ends[:-1], ends[1:]) if conditions else (ends[:0], ends[:0])
    while 0 < low.size <= MOST_CELLS:
        values = enclose(conditions, {clock.index: Interval(low, high)})
        jumping = np.any([np.broadcast_to(value.low != value.high, low.shape) for value in values], axis=0)
        low, high = low[jumping], high[jumping]
        if not (high - low > close).any():
            break
        inner = low + np.arange(PARTS + 1)[:, None] / PARTS * (high - low)
        inner[-1] = high
        low, high = np.ravel(inner[:-1], order="F"), np.ravel(inner[1:], order="F")
        moves = high > low
        low, high = low[moves], high[moves]
    if low.size > MOST_CELLS:
        often = f"a law switches more than {MOST_CELLS // 4} times between t = {begin:.6g} s and {end:.6g} s"
        limitations.append(f"{often}: steps do not end at each of these times; simulate a shorter time.")
        return np.zeros(0)
    if not low.size:
        return low
    first = np.flatnonzero(np.concatenate([[True], low[1:] - high[:-1] > close]))  # adjacent cells hold one change
    last = np.append(first[1:], low.size) - 1
    return 0.5 * (low[first] + high[last])


def _mesh(nodes, conditions, clock: Expression, edges: np.ndarray, limitations: list[str], monotone: bool) -> np.ndarray:
    """Ends of cells in which samples resolve every node.

    Conditions are constant between two edges.
    """
    values = enclose(conditions, {clock.index: Interval.point(0.5 * (edges[:-1] + edges[1:]))})
    fixed = [np.broadcast_to(value.low, edges[:-1].shape) for value in values]
    slopes, finest = _slopes(nodes, clock), FINEST * (edges[-1] - edges[0])
    margin = 4.0 * EQUAL_TIMES * np.abs(edges).max()
    cells = np.array([edges[:-1] + margin, edges[1:] - margin])

    def examined(cells):
        piece = np.searchsorted(edges, cells.mean(axis=0)) - 1
        given = {condition.index: Interval.point(value[piece]) for condition, value in zip(conditions, fixed, strict=True)}
        return _examined(nodes, slopes, clock, cells, given)

    seen = examined(cells)
    while True:
        lowest, highest = seen[:2]
        hidden = _turns if monotone else _hides
        unseen = hidden(seen, (highest.max(axis=1) - lowest.min(axis=1))[:, None]) & (cells[1] - cells[0] > finest)
        if not unseen.any():
            break
        if cells.shape[1] + unseen.sum() > MOST_STEPS:
            often = f"a law has more than {MOST_STEPS // 16} narrow peaks between t = {edges[0]:.6g} s and {edges[-1]:.6g} s"
            limitations.append(f"{often}: steps may miss some; simulate a shorter time, or limit the step with step= [s].")
            break
        middle = cells[:, unseen].mean(axis=0)
        new = np.hstack([[cells[0, unseen], middle], [middle, cells[1, unseen]]])
        cells = np.hstack([cells[:, ~unseen], new])
        seen = np.concatenate([seen[:, :, ~unseen], examined(new)], axis=2)
    return np.setdiff1d(cells[1], edges[1:] - margin)


def _slopes(nodes, clock: Expression) -> list:
    """Time derivatives of nodes; empty if one has none."""
    try:
        return list(forward(nodes, [clock], [1.0]))
    except TypeError:
        return []


def _hides(seen: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Whether samples of a cell may miss a feature of some node; ``known`` is the range of each node."""
    widest, extent, restless = seen[2:5]
    return ((widest > GRADUAL * extent + SMALL * known) & (restless < 0.5)).any(axis=0)


def _turns(seen: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Whether some node may exceed its values at the ends of a cell."""
    (lowest, highest), (least, most) = seen[:2], seen[5:]
    return (np.maximum(highest - most, least - lowest) > SMALL * known).any(axis=0)


def _examined(nodes, slopes, clock: Expression, cells: np.ndarray, given: dict) -> np.ndarray:
    """Bounds and samples of each node in each cell, (7, nodes, cells).

    Rows: least and largest value of the enclosure, widest enclosure of a piece of the cell, range of samples, share of
    neighbouring samples that differ, least and largest value at the ends of the cell. Enclosures are the intersection of
    the natural interval extension and the mean-value form f(m) + f'([a, b]) ([a, b] − m).
    """
    ends = cells[0] + np.arange(PIECES + 1)[:, None] / PIECES * (cells[1] - cells[0])
    low, high = ends[:-1], ends[1:]
    middle, looks = 0.5 * (low + high), cells[0] + LOOKS[:, None] * (cells[1] - cells[0])

    def values(asked, time: Interval) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):  # an infinite slope bounds nothing
            found = enclose(asked, given | {clock.index: time})
        return np.array([[np.broadcast_to(end, time.low.shape) for end in value] for value in found]).transpose(1, 0, 2, 3)

    lowest, highest = values(nodes, Interval(low, high))
    if slopes:
        reach = 0.5 * (high - low) * np.abs(values(slopes, Interval(low, high))).max(axis=0)
        between = values(nodes, Interval.point(middle))[0]
        lowest, highest = np.fmax(lowest, between - reach), np.fmin(highest, between + reach)
    samples, borders = values(nodes, Interval.point(looks))[0], values(nodes, Interval.point(cells))[0]
    extent, widest = np.ptp(samples, axis=1), (highest - lowest).max(axis=1)
    lowest, highest = lowest.min(axis=1), highest.max(axis=1)
    differ = np.abs(np.diff(samples, axis=1)) > RESTLESS * (highest - lowest)[:, None]
    seen = [lowest, highest, widest, extent, differ.mean(axis=1), borders.min(axis=1), borders.max(axis=1)]
    return np.array(seen)
