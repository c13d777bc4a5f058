"""What is known of the laws of a scene as functions of time alone: when they switch, and how long a step may be to see them.

Every comparison, minimum, maximum and floor of expressions of time is a condition; the times when one changes are found by
interval bisection, so that none is missed (Moore, Kearfott, Cloud, Introduction to Interval Analysis, ch. 8). Between these
times, a mesh tells where a law does what samples of it would not show: in each of its cells, the enclosure of the law is
little wider than the samples.
"""

from dataclasses import dataclass

import numpy as np

from gauss.dynamics.intervals import Interval, enclose
from gauss.tracing import Expression, forward, reachable

CONDITIONS = ("less", "less_equal", "min", "max", "floor")
CURVED = ("exp", "sin", "cos", "sqrt", "log", "atan2", "div", "mul")  # what samples may miss
CELLS, PARTS = 64, 8  # to begin with, and into which a cell is divided
MOST_CELLS = 400_000  # that are examined at once: laws that switch more often than about half of this are not resolved
MOST_STEPS = 50_000  # cells of the mesh, each of which costs a step
CLOSE = 4.0 * np.finfo(float).eps  # of the largest time: two times so close are one
APART = 16.0 * np.finfo(float).eps  # of the largest time: so far from a switching time steps end and begin
STEEPEST = 12  # degree of a polynomial that the stages of a step show
PIECES = 8  # of a cell of the mesh: the stages of a step lie closer than two of them
LOOKS = (np.arange(2 * PIECES) + (np.arange(1, 2 * PIECES + 1) * 0.6180339887498949) % 1.0) / (2 * PIECES)  # in no rhythm
GRADUAL, SMALL = 0.4, 0.05  # of the range of the samples in a cell, and of that of the law: a piece spans no more than both
RESTLESS = 0.1  # of the range: where most samples differ by more, a law moves throughout, and any step shows it
COARSE = 4.0  # steps, of which a cell must hold as many: what acts for a while takes about half of it
FINEST = 2.0**-24  # of the time examined: smallest cell of the mesh


@dataclass(frozen=True)
class Timetable:
    """Times that steps heed.

    Attributes
    ----------
    switches : ndarray, shape (k,)
        When a condition changes [s], in order: no step crosses one of them.
    mesh : ndarray, shape (m,)
        Ends of cells [s], in order: no step leaves the cell that follows the one that it begins in.
    lacks : tuple of str
        What is not heeded, in words.
    """

    switches: np.ndarray
    mesh: np.ndarray
    lacks: tuple[str, ...] = ()

    def __bool__(self):
        return bool(self.switches.size or self.mesh.size)

    def join(self, *others: "Timetable") -> "Timetable":
        """Timetable of several laws together."""
        every = (self, *others)
        times = [np.unique(np.concatenate([getattr(one, name) for one in every])) for name in ("switches", "mesh")]
        return Timetable(*times, tuple(dict.fromkeys(text for one in every for text in one.lacks)))

    def unresolved(self, begin: float, end: float, step: float) -> int:
        """In how many cells of the mesh steps of one length are so long that a law may act between their evaluations."""
        if not self.mesh.size:
            return 0
        every = np.unique(np.clip(np.concatenate([[begin, end], self.switches, self.mesh]), begin, end))
        inner = np.isin(every, self.mesh)
        return int(((inner[1:] | inner[:-1]) & (np.diff(every) < COARSE * step)).sum())

    def stops(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Times after ``begin`` at which a step ends, and the times from which the next one goes on, in order.

        They differ by a few units in the last place at a switching time, which no evaluation then falls upon; the last is
        ``end``.
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


NO_TIMES = Timetable(np.zeros(0), np.zeros(0))


def timetable(outputs, clock: Expression, begin: float, end: float, monotone: bool = False) -> Timetable:
    """Switching times and mesh of traced laws.

    Parameters
    ----------
    outputs : sequence of Expression or float
        What the laws give, in one graph.
    clock : Expression
        The symbol of the time.
    begin, end : float
        What stretch of time is asked about [s].
    monotone : bool
        Whether laws are to be all but monotone in each cell of the mesh, as where they are looked at a few times in it.
    """
    nodes = of_time(outputs, clock)
    conditions = [_condition(node) for node in nodes if node.op in CONDITIONS]
    lacks: list[str] = []
    switches = _changes(conditions, clock, begin, end, lacks) if conditions else np.zeros(0)
    degree = _degrees(nodes, clock)
    curved = [node for node in nodes if node.op in CURVED and degree[node.index] > STEEPEST]
    edges = np.array([begin, *switches, end])
    mesh = _mesh(curved, conditions, clock, edges, lacks, monotone) if curved else np.zeros(0)
    return Timetable(switches, mesh, tuple(lacks))


def of_time(outputs, clock: Expression) -> list[Expression]:
    """Nodes of expressions that depend on the time and on nothing else, operands first."""
    alone: dict[int, bool] = {}
    found = []
    for node in reachable(outputs):
        operands = [alone.get(x.index, False) for x in node.operands if not x.is_constant]
        alone[node.index] = node is clock or (bool(operands) and all(operands) and node.op not in ("call", "item"))
        if alone[node.index] and node is not clock:
            found.append(node)
    return found


def _degrees(nodes, clock: Expression) -> dict[int, float]:
    """Degree of each node as a polynomial of the time, between switching times; infinite where it is none."""
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
            found[node.index] = 0.0 if node.op in CONDITIONS else np.inf
    return found


def _condition(node: Expression) -> Expression:
    """What is constant where a node does not switch."""
    x, y = node.operands if len(node.operands) == 2 else (None, None)
    return x < y if node.op == "min" else y < x if node.op == "max" else node  # as their derivatives ask


def _changes(conditions, clock: Expression, begin: float, end: float, lacks: list[str]) -> np.ndarray:
    """Times inside a stretch when one of some conditions changes its value, to the last digits; what lacks is noted."""
    ends, close = np.linspace(begin, end, CELLS + 1), CLOSE * max(abs(begin), abs(end))
    low, high = ends[:-1], ends[1:]
    while low.size <= MOST_CELLS:
        values = enclose(conditions, {clock.index: Interval(low, high)})
        changing = np.any([np.broadcast_to(value.low != value.high, low.shape) for value in values], axis=0)
        low, high = low[changing], high[changing]
        if not (high - low > close).any():
            break
        inner = low + np.arange(PARTS + 1)[:, None] / PARTS * (high - low)
        inner[-1] = high
        low, high = np.ravel(inner[:-1], order="F"), np.ravel(inner[1:], order="F")
        moves = high > low
        low, high = low[moves], high[moves]
    if low.size > MOST_CELLS:
        often = f"a law switches more than {MOST_CELLS // 4} times between t = {begin:.6g} s and {end:.6g} s"
        lacks.append(f"{often}: steps do not heed each of these times; simulate a shorter time.")
        return np.zeros(0)
    if not low.size:
        return np.zeros(0)
    first = np.flatnonzero(np.concatenate([[True], low[1:] - high[:-1] > close]))  # cells that touch hold one change
    last = np.append(first[1:], low.size) - 1
    times = 0.5 * (low[first] + high[last])
    return times[(times > begin + 4.0 * close) & (times < end - 4.0 * close)]


def _mesh(nodes, conditions, clock: Expression, edges: np.ndarray, lacks: list[str], monotone: bool) -> np.ndarray:
    """Ends of the cells between edges, within which every node either changes gradually or moves throughout.

    Between two edges every condition is what it is in the middle.
    """
    told = enclose(conditions, {clock.index: Interval.point(0.5 * (edges[:-1] + edges[1:]))})
    told = [np.broadcast_to(value.low, edges[:-1].shape) for value in told]
    slopes, finest = _slopes(nodes, clock), FINEST * (edges[-1] - edges[0])
    margin = 4.0 * CLOSE * np.abs(edges).max()
    cells = np.array([edges[:-1] + margin, edges[1:] - margin])

    def examined(cells):
        piece = np.searchsorted(edges, cells.mean(axis=0)) - 1
        given = {condition.index: Interval.point(value[piece]) for condition, value in zip(conditions, told, strict=True)}
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
            lacks.append(f"{often}: steps may miss some; simulate a shorter time, or limit the step with step= [s].")
            break
        middle = cells[:, unseen].mean(axis=0)
        new = np.hstack([[cells[0, unseen], middle], [middle, cells[1, unseen]]])
        cells = np.hstack([cells[:, ~unseen], new])
        seen = np.concatenate([seen[:, :, ~unseen], examined(new)], axis=2)
    return np.setdiff1d(cells[1], edges[1:] - margin)


def _slopes(nodes, clock: Expression) -> list:
    """Derivatives of nodes in time; none where a node has no derivative."""
    try:
        return list(forward(nodes, [clock], [1.0]))
    except TypeError:
        return []


def _hides(seen: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Whether some node may do in a cell what a step across it does not show; ``known`` is the range of each node."""
    widest, extent, restless = seen[2:5]
    return ((widest > GRADUAL * extent + SMALL * known) & (restless < 0.5)).any(axis=0)


def _turns(seen: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Whether some node may go beyond its values at the ends of a cell."""
    (lowest, highest), (least, most) = seen[:2], seen[5:]
    return (np.maximum(highest - most, least - lowest) > SMALL * known).any(axis=0)


def _examined(nodes, slopes, clock: Expression, cells: np.ndarray, given: dict) -> np.ndarray:
    """What is known of each node in each cell, (7, nodes, cells).

    Ends of its enclosure, the widest enclosure over a piece of the cell, the range of samples, and the share of
    neighbouring samples that differ, and the least and largest value at the ends of the cell. Enclosures are those by
    interval arithmetic, cut by the mean-value form f(m) + f'([a, b]) ([a, b] − m).
    """
    ends = cells[0] + np.arange(PIECES + 1)[:, None] / PIECES * (cells[1] - cells[0])
    low, high = ends[:-1], ends[1:]
    middle, looks = 0.5 * (low + high), cells[0] + LOOKS[:, None] * (cells[1] - cells[0])

    def values(asked, time: Interval) -> np.ndarray:
        found = enclose(asked, given | {clock.index: time})
        return np.array([[np.broadcast_to(end, time.low.shape) for end in value] for value in found]).transpose(1, 0, 2, 3)

    lowest, highest = values(nodes, Interval(low, high))
    if slopes:
        reach = 0.5 * (high - low) * np.abs(values(slopes, Interval(low, high))).max(axis=0)
        between = values(nodes, Interval.point(middle))[0]
        lowest, highest = np.maximum(lowest, between - reach), np.minimum(highest, between + reach)
    samples, borders = values(nodes, Interval.point(looks))[0], values(nodes, Interval.point(cells))[0]
    extent, widest = np.ptp(samples, axis=1), (highest - lowest).max(axis=1)
    lowest, highest = lowest.min(axis=1), highest.max(axis=1)
    differ = np.abs(np.diff(samples, axis=1)) > RESTLESS * (highest - lowest)[:, None]
    seen = [lowest, highest, widest, extent, differ.mean(axis=1), borders.min(axis=1), borders.max(axis=1)]
    return np.array(seen)
