"""Targets, constraints and limits of one system: what an iteration of inverse kinematics asks at one state.

Displacements and rates are ξ = N y with an orthonormal basis N, in the units of the coordinates, of all that joints,
loops, couplings and relations allow: constraints are equalities that are eliminated, redundant ones included.
"""

from collections.abc import Iterator, Mapping, Sequence
from numbers import Real

import numpy as np

from gauss.analysis.tangents import Tangents
from gauss.analysis.target import Target, TargetRows
from gauss.analysis.target_levels import LevelRows
from gauss.dynamics.projection import limits_and_stops, scalar_coordinates
from gauss.dynamics.store import cached
from gauss.errors import ArgumentError, StateError, did_you_mean
from gauss.system import State, System

ROUNDED_ERROR = 1e-11  # of a target, in radians and lengths of the scene


class TargetProblem:
    """Targets and limits of one system.

    Parameters
    ----------
    limits : dict, optional
        Lowest and highest coordinates (2,) [rad, m] by name, instead of those of joints and stops.
    """

    def __init__(self, system: System, targets: Target | Sequence[Target], limits: Mapping | None = None):
        self.system, self.targets = system, _checked(targets)
        self.lowest, self.highest = _limits(system, limits)
        names = [name for target in self.targets for name in target.functions(system)]
        self.functions = tuple(dict.fromkeys(names))
        self.depths = sorted({target.level for target in self.targets})

    def rows(self, state: State) -> list[TargetRows]:
        """Rows of every target."""
        q = state.q
        found = self.system.evaluate(self.functions, q, np.zeros(self.system.n_v), t=state.t) if self.functions else {}
        return [target.rows(self.system, q, found) for target in self.targets]

    def basis(self, state: State, of_rates: bool = False) -> np.ndarray:
        """N (n_v, k): displacements that all position constraints allow, or rates that all constraints allow."""
        units = self.system.scale.coordinates
        if not self.system.has_closures:
            return np.diag(units)
        tangents = Tangents(self.system, state)
        N = tangents.rate if of_rates else tangents.position
        return units[:, None] * np.linalg.qr(N / units[:, None])[0]

    def levels(self, rows: Sequence[TargetRows], wanted: Sequence[np.ndarray], N: np.ndarray) -> list[LevelRows]:
        """Weighted rows of each level along N, for wanted changes (m,) of each target."""
        found = []
        for depth in self.depths:
            here = [k for k, target in enumerate(self.targets) if target.level == depth]
            scales = np.concatenate([np.sqrt(rows[k].weights) / rows[k].units for k in here])
            A = np.concatenate([rows[k].jacobian @ N for k in here])
            found.append(LevelRows(scales[:, None] * A, scales * np.concatenate([wanted[k] for k in here])))
        return found

    def costs(self, rows: Sequence[TargetRows]) -> np.ndarray:
        """Weighted sum of squares of each level."""
        sums = [float((one.weights * (one.error / one.units) ** 2).sum()) for one in rows]
        return np.array(
            [sum(s for s, target in zip(sums, self.targets, strict=True) if target.level == d) for d in self.depths]
        )

    @property
    def costs_of_round_off(self) -> np.ndarray:
        """Costs of each level that are round-off."""
        weights = [sum(target.weight for target in self.targets if target.level == d) for d in self.depths]
        return ROUNDED_ERROR**2 * np.array(weights)

    def room(self, state: State, most: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n_v,) down to the lowest and up to the highest coordinates.

        Coordinates beyond their limits go back by ``most`` units at a time.
        """
        plain, back = scalar_coordinates(self.system, state), most * self.system.scale.coordinates
        return np.minimum(self.lowest - plain, back), np.maximum(self.highest - plain, -back)

    def violation(self, state: State) -> float:
        """Sum of squares of coordinates beyond their limits, in units."""
        low, high = self.room(state)
        return float(((np.maximum(low, 0.0) + np.minimum(high, 0.0)) ** 2 / self.system.scale.coordinates**2).sum())

    def at_limits(self, state: State, tolerance: float) -> list[tuple[int, float]]:
        """Coordinates at their lowest (−1) or highest (+1) value."""
        low, high = self.room(state)
        near = tolerance * self.system.scale.coordinates
        sides = (-1.0, -low <= near), (1.0, high <= near)
        return [(int(k), side) for side, close in sides for k in np.flatnonzero(close)]

    def limit_name(self, column: int, side: float) -> str:
        """A limit in words."""
        value = self.highest[column] if side > 0 else self.lowest[column]
        end = "highest" if side > 0 else "lowest"
        return f"{self.system.coordinates[column]} at its {end} coordinate {value:.6g}"


def bounds(N: np.ndarray, low: np.ndarray, high: np.ndarray, units: np.ndarray, fixed=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rows G (s, k) and h (s,) of low ≤ fixed + N y ≤ high, in the units; without those that are infinite."""
    G = np.concatenate([N, -N]) / np.tile(units, 2)[:, None]
    h = np.concatenate([high - fixed, fixed - low]) / np.tile(units, 2)
    kept = np.isfinite(h)
    return G[kept], h[kept]


def named_values(system: System, given, what: str) -> Iterator[tuple[int, object]]:
    """Places in v and values of a dictionary by the names of coordinates.

    ArgumentError if it is no dictionary.
    StateError if a name is none of the system.
    """
    if not isinstance(given, Mapping):
        raise ArgumentError(f"{what}: expected values by the names of coordinates, got {given!r}.")
    for name, value in given.items():
        if name not in system.coordinates:
            raise StateError(f"{what}: no coordinate {name!r}. {did_you_mean(str(name), system.coordinates)}")
        yield system.coordinates.index(name), value


def positive_values(system: System, given, what: str) -> np.ndarray:
    """Bounds (n_v,): infinite where none is given; of one number, in the unit of each coordinate.

    ArgumentError if a value is no positive number.
    """
    found = np.full(system.n_v, np.inf)
    if given is None:
        return found
    if isinstance(given, Real) and not isinstance(given, bool):
        given = dict.fromkeys(system.coordinates, given)
    for place, value in named_values(system, given, what):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0.0:
            raise ArgumentError(f"{what}: expected a positive number for {system.coordinates[place]!r}, got {value!r}.")
        found[place] = value
    return found


def _checked(targets) -> tuple[Target, ...]:
    found = (targets,) if isinstance(targets, Target) else tuple(targets) if np.iterable(targets) else ()
    wrong = [one for one in found if not isinstance(one, Target)]
    if not found or wrong:
        got = f"a {type(wrong[0]).__name__}" if wrong else repr(targets)
        raise ArgumentError(f"targets: expected targets such as gauss.PointTarget('hand', (0.5, 0, 0.2)), got {got}.")
    labels = [one.label for one in found]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ArgumentError(f"targets: two are called {twice!r}; give one of them another name=.")
    return found


def _limits(system: System, given: Mapping | None) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates (n_v,) of joints, stops and those given."""
    own = cached(system, (limits_and_stops,), lambda: limits_and_stops(system))
    lowest, highest = (side.copy() for side in own)
    for place, pair in named_values(system, {} if given is None else given, "limits"):
        name = system.coordinates[place]
        try:
            low, high = map(float, pair)  # type: ignore[call-overload]  # anything else is refused
        except (TypeError, ValueError):
            low, high = np.nan, np.nan
        if not low < high:
            raise ArgumentError(f"limits: expected (lowest, highest) for {name!r} [rad, m], got {pair!r}.")
        joint, rate = system.coordinate(name)
        joint.plain(rate or 0)
        lowest[place], highest[place] = low, high
    return lowest, highest
