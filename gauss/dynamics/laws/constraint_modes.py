"""Modes of constraints whose residuals have conditions on the state, as of a cam or a guide in pieces.

In one mode every condition has a fixed value, and the residuals are smooth. Between two modes lies a surface on which a
condition changes: there the position residual may jump, which no motion follows, or the velocity residual, which is an
impact. A residual in pieces that fit in value and slope needs neither; surfaces are therefore looked for along random lines
through the configuration space, and compared from both sides.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise
from typing import ClassVar, NamedTuple

import numpy as np

from gauss.codegen import Expression, Function, Graph, reachable, substitute
from gauss.dynamics.gap_functions import stacked_rows
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.branch_cuts import ON_CUT, TRIED, inlined, met_from, unfolded_system
from gauss.dynamics.laws.levels import LEVELED, Levels, levels_of
from gauss.dynamics.laws.switching_times import CONDITIONS, of_time
from gauss.dynamics.projection import scalar_coordinates
from gauss.dynamics.store import cached
from gauss.dynamics.system_dynamics import SystemDynamics
from gauss.errors import GaussError, SimulationError
from gauss.scene.relation import Relation
from gauss.system import State, System, build, retract
from gauss.system.relations import Relations, bound_relations
from gauss.system.symbolic_mechanism import Symbols, symbols_of

CONTINUOUS = 1e-9  # change of a residual across a surface, relative to its terms, that is rounding of the surface's place
LINES, LOOKS = 24, 33  # random lines through the configuration space, and states on each, between which surfaces are found
REACHES = (0.3, 3.0, 30.0)  # half lengths of the lines, in units of the coordinates of the scene
BISECTIONS = 60  # of the place of a surface on a line: to rounding

Mode = tuple[float, ...]  # value of every condition: 0 or 1 of a comparison, the first or the second of min and max; a floor


@dataclass(frozen=True)
class OneMode(Relation):
    """Relation whose conditions have the values of one mode."""

    whole: Relation
    mode: Mode  # values of its conditions, in the order of :func:`conditions`

    may_be_idle: ClassVar[bool] = True

    def positions(self, at) -> list:
        """Residuals of positions in the mode."""
        return self._smooth(at, 0)

    def velocities(self, at) -> list:
        """Residuals of velocities in the mode."""
        return self._smooth(at, 1)

    def _smooth(self, at, part: int) -> list:
        def smooth(traced, view: Symbols):
            nodes = _conditions(traced, view)
            return substitute(traced[part], nodes, _values(nodes, self.mode))

        return inlined(self.whole, at, smooth)


class Condition(NamedTuple):
    """A condition, by the difference of its two sides, or the argument of a floor or of a row."""

    op: str  # operation of its node
    levels: Levels | None  # those of a floor or row

    @classmethod
    def of(cls, node: Expression) -> "Condition":
        """Condition of a node."""
        return cls(node.op, levels_of(node) if node.op in LEVELED else None)

    def holds(self, side: float) -> float:
        """Value: for min and max, whether it is the first operand."""
        if self.levels is not None:
            return float(self.levels.at(side))
        return float({"less": side < 0.0, "min": side < 0.0, "less_equal": side <= 0.0, "max": side > 0.0}[self.op])

    def margin(self, side: float, value: float) -> float:
        """Distance from where a value changes, negative beyond it."""
        if self.levels is not None:
            low, high = self.levels.borders(value)
            return float(min(side - low, high - side))
        return float(side if (self.op == "max") == bool(value) else -side)

    def beyond(self, side: float, value: float) -> float:
        """Value on the other side of the nearest place where it changes."""
        if self.levels is None:
            return 1.0 - value
        low, high = self.levels.borders(value)
        return value + (1.0 if high - side < side - low else -1.0)


class Step(NamedTuple):
    """What residuals do across a surface between two modes."""

    name: str  # constraint that changes most, relative to its terms
    # position, velocity: largest change of its position residual, and of its velocity residual [m, rad], [m/s, rad/s]; 0
    # where continuous
    position: float
    velocity: float


class ConstraintModes:
    """Modes of the constraints of a system.

    Attributes: ``names``: relations that have conditions on the state.
    """

    def __init__(self, system: System):
        self.system, self.counts, self.conditions, self.about = system, dict[str, int](), list[Condition](), list[str]()
        for name, relation in system.scene.relations.items():
            own = Symbols(system, Graph())
            nodes = _conditions(own.residuals(relation), own)
            if not nodes or relation.loses:
                continue
            self.counts[name] = len(nodes)
            self.conditions += map(Condition.of, nodes)
            self.about += [_about(system, own, node) for node in nodes]
        self.names = tuple(self.counts)

    def __bool__(self):
        return bool(self.names)

    def sides(self, state: State, mode: Mode | None = None) -> np.ndarray:
        """Difference of the two sides of every comparison, argument of every floor, (k,); in one mode if it is given."""
        found = cached(self.system, (ConstraintModes.sides, mode), lambda: self._sides(mode))
        return np.asarray(found.values(Kinematics(self.system, state)), dtype=float)

    def _sides(self, mode: Mode | None) -> Relations:
        """Sides as functions of the motion."""
        view, sides = Symbols(self.system, Graph()), list[Expression | float]()
        for name, values in self._parts(mode).items():
            own = Symbols(self.system, Graph())
            nodes = _conditions(own.residuals(self.system.scene.relations[name]), own)
            found = [node.operands[0] if node.op in LEVELED else node.operands[0] - node.operands[1] for node in nodes]
            if mode is not None:
                found = list(substitute(found, nodes, _values(nodes, values)))
            sides += list(
                Function("sides", symbols_of(own.bodies, own.joints, own.t), found).inlined(
                    np.array(_same(own, view), dtype=object)
                )
            )
        return bound_relations(view.graph, [], view.bodies, view.joints, sides)

    def _parts(self, mode: Mode | None) -> dict[str, Mode]:
        """Modes of each relation."""
        values = np.zeros(len(self.conditions)) if mode is None else np.array(mode)
        ends = np.cumsum(list(self.counts.values()))
        return {name: tuple(part.tolist()) for name, part in zip(self.names, np.split(values, ends[:-1]), strict=True)}

    @cached_property
    def sizes(self) -> np.ndarray:
        """Sizes of the sides of the conditions at states of the size of the scene, (k,)."""
        return np.max([np.abs(self.sides(at(1.0))) for at in islice(self._lines(), LINES)], axis=0)

    def mode(self, state: State) -> Mode:
        """Mode of a state."""
        return tuple(one.holds(side) for one, side in zip(self.conditions, self.sides(state), strict=True))

    def margins(self, state: State, mode: Mode) -> np.ndarray:
        """Distance of every condition from its change, on the motion of a mode, negative beyond it, (k,)."""
        pairs = zip(self.conditions, self.sides(state, mode), mode, strict=True)
        return np.array([one.margin(side, value) for one, side, value in pairs])

    def beyond(self, state: State, mode: Mode, which: tuple[int, ...]) -> Mode:
        """Mode on the other side of the surfaces of some conditions, near a state."""
        other, sides = list(mode), self.sides(state, mode)
        for k in which:
            other[k] = self.conditions[k].beyond(sides[k], mode[k])
        for k in range(len(other)):  # conditions on what has jumped follow, as that of |x − floor(x)|
            after = self.sides(state, tuple(other))
            if k not in which and abs(after[k] - sides[k]) > CONTINUOUS * self.sizes[k]:
                other[k] = self.conditions[k].holds(after[k])
        return tuple(other)

    def system_of(self, mode: Mode) -> System:
        """The system with the constraints of a mode."""

        def make() -> System:
            whole = self.system.scene
            own = {name: OneMode(name, whole.relations[name], part) for name, part in self._parts(mode).items()}
            return build(replace(whole, relations=whole.relations | own), SystemDynamics())

        return cached(self.system, (ConstraintModes.system_of, mode), make)

    def step(self, state: State, one: Mode, other: Mode) -> Step:
        """What the residuals do between two modes at a state on their surface."""
        (gap, rate, *here), (gap_other, rate_other, *there) = (
            _terms(kinematics(self.system_of(mode), state)) for mode in (one, other)
        )
        jumps, sizes = np.abs([gap_other - gap, rate_other - rate]), np.maximum(here, there)
        shares = np.divide(jumps, sizes, out=np.zeros_like(jumps), where=sizes > 0.0)
        placed = self.system.relations.placed
        owners = np.repeat([relation.name for relation in placed], [relation.size for relation in placed])
        worst = owners[np.argmax(shares.max(axis=0))]
        position, velocity = np.where(shares > CONTINUOUS, jumps, 0.0)[:, owners == worst].max(axis=1)
        return Step(str(worst), float(position), float(velocity))

    @property
    def steps(self) -> dict[int, Step]:
        """A surface of each condition on which residuals jump, as far as surfaces are found; see :attr:`unknown`."""
        return self._surfaces[0]

    @property
    def unknown(self) -> bool:
        """Whether a condition has no surface that was found."""
        return self._surfaces[1]

    @cached_property
    def _surfaces(self) -> tuple[dict[int, Step], bool]:
        steps, seen = dict[int, Step](), set[int]()
        for state, k, mode, other in self._crossed():
            if k in steps:
                continue
            try:
                step = self.step(state, mode, other)
            except GaussError:  # no finite value there: nothing is known
                continue
            seen.add(k)
            if step.position or step.velocity:
                steps[k] = step
        return steps, len(seen) < len(self.conditions)

    @cached_property
    def meets_a_jump(self) -> bool:
        """Whether a state that meets the constraints of one mode lies on a surface across which residuals jump."""
        found = ((state, k, mode) for state, k, mode, _ in self._crossed() if k in self.steps)
        return any(self._is_met(*one) for one in islice(found, TRIED))

    def _is_met(self, state: State, k: int, mode: Mode) -> bool:
        """Whether Newton's method finds a state on a surface that meets the constraints of a mode, from one near it."""
        system = self.system_of(mode)

        def residual(at: State) -> np.ndarray:
            gap, _, size, _ = _terms(kinematics(system, at))
            shares = np.divide(gap, size, out=np.zeros_like(gap), where=size > 0.0)
            return np.append(shares, self.sides(at, mode)[k] / self.sizes[k])

        try:
            met = met_from(system, state, residual)
            if met is None or (np.delete(self.margins(met, mode) + ON_CUT * self.sizes, k) < 0.0).any():
                return False
            step = self.step(met, mode, self.beyond(met, mode, (k,)))
        except GaussError:
            return False
        return bool(step.position or step.velocity)

    def _lines(self) -> Iterator[Callable[[float], State]]:
        """Random lines through the configuration space: functions of a number in [−1, 1]."""
        system, rng = self.system, np.random.default_rng(0)
        rest = system.reference
        for line in range(LINES):
            far = REACHES[line % len(REACHES)] * rng.uniform(-1.0, 1.0, system.n_v) * system.scale.coordinates
            off = 0.3 * rng.uniform(-1.0, 1.0, system.n_v) * system.scale.coordinates
            rates = rng.uniform(-1.0, 1.0, system.n_v) * system.scale.rates
            middle, half = retract(system, rest.q, off), far

            def at(s: float, middle: np.ndarray = middle, half: np.ndarray = half, rates: np.ndarray = rates) -> State:
                return State(rest.t, retract(system, middle, s * half), rates)

            yield at

    def _crossed(self) -> Iterator[tuple[State, int, Mode, Mode]]:
        """States on surfaces, each with its condition and the modes on both sides."""
        for at in self._lines():
            modes = [(s, self.mode(at(s))) for s in np.linspace(-1.0, 1.0, LOOKS)]
            for (begin, before), (end, after) in pairwise(modes):
                for k in np.flatnonzero(np.array(before) != np.array(after)):
                    near, far = self._surface(at, begin, end, int(k), before)
                    yield at(far), int(k), self.mode(at(near)), self.mode(at(far))

    def _surface(self, at, begin: float, end: float, k: int, mode: Mode) -> tuple[float, float]:
        """Neighbouring places on a line between which a condition changes."""
        for _ in range(BISECTIONS):
            middle = 0.5 * (begin + end)
            begin, end = (middle, end) if self.mode(at(middle))[k] == mode[k] else (begin, middle)
        return begin, end


def constraint_modes(system: System) -> ConstraintModes | None:
    """Modes of the constraints of a system that jump between them, or may; None where there are none."""
    own = _has_any(system, CONDITIONS) and cached(system, (ConstraintModes,), lambda: ConstraintModes(system))
    found = own if own and (own.unknown or own.steps) else None
    unfolded = unfolded_system(system) if _has_any(system, ("atan2",)) else None
    if unfolded is None:
        return found
    modes = cached(unfolded, (ConstraintModes,), lambda: ConstraintModes(unfolded))
    return modes if modes.steps and (found is not None and found.steps or modes.meets_a_jump) else found


def refuse_surfaces(system: System, what: str):
    """Raise a SimulationError if a constraint of a system jumps, or has a kink, at a condition on the state."""
    modes = constraint_modes(system)
    if modes is None:
        return
    for k, step in modes.steps.items():
        size = f"jumps by {step.position:.6g} [m, rad]" if step.position else "has a kink"
        raise SimulationError(
            f"constraint {step.name!r} {size} at a condition on {modes.about[k]}, which {what} does not locate; "
            "use gauss.simulate, or let the residual be continuous with its slope."
        )


def _has_any(system: System, ops: tuple[str, ...]) -> bool:
    """Whether constraints have operations of these kinds."""
    function = system.relations.function
    if function is None:
        return False
    return cached(system, (_has_any, ops), lambda: any(node.op in ops for node in function.nodes))


def _conditions(traced: tuple[np.ndarray, np.ndarray], view: Symbols) -> list[Expression]:
    """Conditions on the state, operands first; a number of a time alone is none."""
    outputs = [entry for part in traced for entry in part]
    timed = {node.index for node in of_time(outputs, view.t)}
    return [node for node in reachable(outputs) if node.op in CONDITIONS and node.index not in timed]


def _same(own: Symbols, view: Symbols) -> list:
    """Symbols of another view for the bodies and joints of one."""
    bodies = [symbol for b in own.bodies for part in view.body(b) for symbol in np.ravel(part)]
    joints = [symbol for j in own.joints for part in view.joint(own.system.joints[j]) for symbol in part]
    return [*bodies, *joints, view.t]


def _values(nodes: list[Expression], mode: Mode) -> list[Expression | float]:
    """Values of conditions in a mode; operands come first, for those of min and max hold conditions, too."""
    values = list[Expression | float]()
    for node, value in zip(nodes, mode, strict=True):
        values.append(_chosen(node, value, nodes[: len(values)], values))
    return values


def _chosen(node: Expression, value: float, nodes: list[Expression], values: list) -> Expression | float:
    """Value of a condition in a mode, given those before it; of min and max one operand."""
    if node.op not in ("min", "max"):
        return value
    return substitute([node.operands[0 if value else 1]], nodes, values)[0]


def _terms(motion: Kinematics) -> np.ndarray:
    """Position and velocity residuals of all relations, and the magnitudes of their terms, (4, r)."""
    system = motion.system
    J, C, _, gap = stacked_rows(motion, system.relations)
    velocities = np.concatenate([motion.quasi_velocities(), motion.state.v])
    places = np.concatenate([np.ones(system.Phi.size), np.abs(scalar_coordinates(system, motion.state))])
    rate = J @ velocities - C
    sizes = np.abs(J) @ places + np.abs(gap), np.abs(J) @ np.abs(velocities) + np.abs(C) + np.abs(rate)
    return np.array([gap, rate, *sizes])


def _about(system: System, view: Symbols, node: Expression) -> str:
    """Joints and bodies that a condition depends on, in words."""
    needed = {symbol.index for symbol in reachable([node]) if symbol.op == "symbol"}
    of = lambda parts: any(symbol.index in needed for part in parts for symbol in np.ravel(part))  # noqa: E731
    joints = [system.joints[j].name for j, parts in view.joints.items() if of(parts)]
    return ", ".join([*joints, *(system.structure.bodies[b] for b, parts in view.bodies.items() if of(parts))])
