"""Equilibria: states at rest in which no coordinate accelerates, and forces on the coordinates that are kept.

Newton's method on q̈(ξ, τ, x) = 0, ẋ = 0 for displacements ξ along the constraints, forces τ and states of one's own x, with
the exact derivatives; steps are halved until the accelerations decrease, and projected onto the constraints. Whether an
equilibrium is stable follows from the eigenvalues of its linear model.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from gauss.analysis.derivatives import derivatives
from gauss.analysis.frozen_time import own_states, resting, state_at
from gauss.analysis.linear_model import LinearModel, linearise
from gauss.analysis.loop_closure import POSITION_STEPS
from gauss.analysis.tangents import Tangents
from gauss.arguments import generator, named_arguments
from gauss.dynamics.assemble import checked_load
from gauss.dynamics.consistent_states import violations
from gauss.dynamics.energies import potential_energy
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import fixed_columns, project_positions
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, GaussError, SimulationError, StateError, did_you_mean
from gauss.scene import Scene
from gauss.system import State, System, retract

AT_REST = 1e-9  # largest acceleration of an equilibrium, in the units of the scene
STEPS, LEAST_SHARE, LONGEST = 60, 2.0**-12, 0.5  # of Newton's method; share of a step that is tried last; step in units
KICKS = 5  # steps along the accelerations, where Newton's method stalls
EQUAL_STATES = 1e-6  # distance of two equilibria in units, below which they are one


@dataclass(frozen=True)
class StaticEquilibrium:
    """State of rest.

    Parameters
    ----------
    state : State
        The state.
    energy : float
        Potential energy of gravity and springs [J].
    forces : dict
        Generalised forces that hold the kept coordinates, by name [N m, N].
    model : LinearModel
        Linear model about it.
    """

    state: State
    energy: float
    forces: dict[str, float]
    model: LinearModel

    @property
    def stability(self) -> str:
        """Whether it is "stable", "marginal" (as without damping) or "unstable"."""
        return self.model.stability


@named_arguments
def equilibrium(
    system: System | Scene, start: State | None = None, *, keep=(), loads=None, t: float | None = None
) -> StaticEquilibrium:
    """Equilibrium near a start; laws of time have their values at the time of the start.

    Parameters
    ----------
    system : System or Scene
        The system.
    start : State, optional
        Where the search begins; the start of the scene when not given.
    keep : sequence of str
        Joints, or rates such as "U.angle1", that keep their coordinates; the forces that this takes are found.
    loads : dict or array_like, shape (n_v,), optional
        Generalised forces added to those of the scene, by the names of coordinates, or of all [N m, N].
    t : float, optional
        Time of the start, where none is given [s].

    Returns
    -------
    StaticEquilibrium
        State, energy, forces on the kept coordinates, linear model. States of one's own, as currents, rest as well.

    Warns
    -----
    TimeDependenceWarning
        If laws depend on time, and neither a start nor a time is given.

    Raises
    ------
    ArgumentError
        If a time is given beside a start.
    SimulationError
        If none is found, with what still accelerates, or with the constraints that prescribe a velocity; or the system
        cannot be compiled.
    StateError
        If a name is none of the system.

    Examples
    --------
    >>> import gauss
    >>> round(gauss.equilibrium(gauss.load("pendulum")).energy, 6)
    -4.905
    """
    system = system_of(system, "equilibrium")
    start = state_at(system, start, t, "equilibrium")
    return _found(system, start, fixed_columns(system, keep), _load(system, loads))


@named_arguments
def equilibria(
    system: System | Scene, *, starts: int = 32, seed: int = 0, keep=(), loads=None, t: float | None = None
) -> tuple[StaticEquilibrium, ...]:
    """All equilibria that searches from the start of the scene and from random starts find, the lowest energy first.

    Parameters
    ----------
    system : System or Scene
        The system.
    starts : int
        Number of random starts.
    seed : int
        Their seed: the same one, the same starts.
    keep, loads, t
        As for :func:`equilibrium`.

    Returns
    -------
    tuple of StaticEquilibrium
        Different ones; where equilibria are not isolated, some of each family.

    Raises
    ------
    ArgumentError
        If the number of starts is no whole number, or the time is none.
    SimulationError
        If none is found.
    """
    if not isinstance(starts, (int, np.integer)) or starts < 0:
        raise ArgumentError(f"equilibria: starts: expected a whole number, 0 or more, got {starts!r}.")
    system, rng = system_of(system, "equilibria"), generator(seed, "equilibria")
    held, load, found = fixed_columns(system, keep), _load(system, loads), list[StaticEquilibrium]()
    base, why = state_at(system, None, t, "equilibria"), None
    for k in range(starts + 1):
        try:
            one = _found(system, _random(system, base, rng, held, keep) if k else base, held, load)
        except GaussError as error:
            why = error
            continue
        if not any(_are_same(system, one, other) for other in found):
            found.append(one)
    if not found:
        raise SimulationError(f"no equilibrium was found from {starts + 1} starts; the last search ended so: {why}")
    return tuple(sorted(found, key=lambda one: one.energy))


def _random(system: System, base: State, rng: np.random.Generator, held: list[int], keep) -> State:
    """Assembled state far from another one, with the kept coordinates of that."""
    away = np.pi * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v)
    away[held + own_states(system)] = 0.0
    return system.initial_state(retract(system, base.q, away), t=base.t, keep=keep or None)


def _load(system: System, loads) -> np.ndarray:
    """Generalised forces (n_v,)."""
    if loads is None:
        return np.zeros(system.n_v)
    if not isinstance(loads, Mapping):
        return checked_load(system, loads)
    found, names = np.zeros(system.n_v), list(system.coordinates)
    for name, value in loads.items():
        if name not in names:
            raise StateError(f"loads: no coordinate {name!r}. {did_you_mean(str(name), names)}")
        if not isinstance(value, Real):
            raise StateError(f"loads: expected a number for {name!r}, got {value!r}.")
        found[names.index(name)] = value
    return checked_load(system, found)


def _found(system: System, start: State, held: list[int], load: np.ndarray) -> StaticEquilibrium:
    """Equilibrium by Newton's method from a start."""
    state, forces, values = resting(system, start), np.zeros(len(held)), own_states(system)
    total = load.copy()
    own, kicks, unit = system.accelerations(state, total), KICKS, system.scale.rates / system.scale.time
    for _ in range(STEPS):
        slopes = derivatives(system, state, total)
        left = np.abs(own / _units(system, state, slopes.v, values))
        if left.max(initial=0.0) <= AT_REST**1.25:
            break
        N = Tangents(system, state, (*held, *values)).position
        change = np.concatenate([slopes.q @ N, slopes.load[:, held], slopes.v[:, values]], axis=1) / unit[:, None]
        sizes = np.concatenate([_lengths(system, N), np.full(len(held), system.scale.energy)])
        sizes = np.append(sizes, np.maximum(1.0, np.abs(state.v[values])))
        step = -sizes * np.linalg.lstsq(change * sizes, own / unit, rcond=1e-12)[0]
        longest = np.abs(step[: N.shape[1]] / sizes[: N.shape[1]]).max(initial=0.0)
        share = min(1.0, LONGEST / longest) if longest else 1.0
        state, own, forces, moved = _line_search(system, state, own, step, share, N, (held, load, forces))
        total = load.copy()
        total[held] += forces
        if not moved and not kicks:
            break
        if not moved:  # Newton's method is caught where the slope is singular: go where the forces pull
            kicks -= 1
            pull = np.where(np.isin(np.arange(system.n_v), values), 0.0, own)
            q = retract(system, state.q, pull * LONGEST / np.abs(own / system.scale.coordinates).max())
            state = project_positions(system, replace(state, q=q), POSITION_STEPS, tuple(held))
            own = system.accelerations(state, total)
    if not left.max(initial=0.0) <= AT_REST:
        worst = int(left.argmax())
        words = f"changes by {own[worst]:.3g} /s" if worst in values else f"accelerates by {own[worst]:.3g} rad/s² or m/s²"
        raise SimulationError(
            f"scene {system.scene.name!r}: no equilibrium was found near this start: {system.coordinates[worst]!r} still "
            f"{words}. Start elsewhere, or ask gauss.equilibria for random starts."
        )
    if moving := violations(system, state):
        raise SimulationError(
            f"scene {system.scene.name!r}: no state of rest at t = {state.t:g} s: constraint {next(iter(moving))!r} is "
            f"{next(iter(moving.values()))} there. Hold what it moves, or name a time at which it stands still by t= [s]."
        )
    names = [system.coordinates[k] for k in held]
    energy = np.asarray(potential_energy(kinematics(system, state)), dtype=float).item()
    forces_by_name = dict(zip(names, forces.tolist(), strict=True))
    return StaticEquilibrium(state, energy, forces_by_name, linearise(system, state, load=total))


def _line_search(system: System, state: State, own, step, share: float, N, kept):
    """First share of a step, halved again and again, that decreases the accelerations."""
    (held, load, forces), k, values = kept, N.shape[1], own_states(system)
    unit = system.scale.rates / system.scale.time
    size = np.linalg.norm(own / unit)
    while share >= LEAST_SHARE:
        q = retract(system, state.q, N @ (share * step[:k]))
        v = state.v.copy()
        v[values] += share * step[k + len(held) :]
        tried = project_positions(system, replace(state, q=q, v=v), POSITION_STEPS, tuple(held))
        more, total = forces + share * step[k : k + len(held)], load.copy()
        total[held] += more
        try:
            found = system.accelerations(tried, total)
        except GaussError:  # the step led to a place where accelerations are not determined
            found = np.full(system.n_v, np.inf)
        if np.linalg.norm(found / unit) < size:
            return tried, found, more, True
        share /= 2.0
    return state, own, forces, False


def _units(system: System, state: State, slopes: np.ndarray, values: list[int]) -> np.ndarray:
    """Units (n_v,) of accelerations, and of rates of states of one's own: what their values alone would cause."""
    unit = system.scale.rates / system.scale.time
    unit[values] += np.abs(slopes[np.ix_(values, values)]) @ np.abs(state.v[values])
    return unit


def _lengths(system: System, N: np.ndarray) -> np.ndarray:
    """Unit of each independent displacement."""
    return 1.0 / np.maximum(np.abs(N / system.scale.coordinates[:, None]).max(axis=0, initial=0.0), 1e-300)


def _are_same(system: System, one: StaticEquilibrium, other: StaticEquilibrium) -> bool:
    """Whether two equilibria have the same poses, or belong to one family, along which neither energy nor slopes change."""
    poses, values = [kinematics(system, found.state) for found in (one, other)], own_states(system)
    far = [np.abs(a - b).max(initial=0.0) for a, b in zip(poses[0].R, poses[1].R, strict=True)]
    near = [np.abs(a - b).max(initial=0.0) / system.scale.length for a, b in zip(poses[0].x, poses[1].x, strict=True)]
    apart = np.abs(one.state.v - other.state.v)[values] / np.maximum(1.0, np.abs(one.state.v[values]))
    if max([*far, *near, *apart], default=0.0) <= EQUAL_STATES:
        return True
    roots = [np.sort_complex(found.model.eigenvalues) for found in (one, other)]
    size = max(np.abs(part).max(initial=0.0) for part in roots)
    in_family = any((np.abs(part) <= np.sqrt(EQUAL_STATES) * size).any() for part in roots)
    alike = np.abs(one.energy - other.energy) <= EQUAL_STATES * system.scale.energy
    return bool(in_family and alike and (np.abs(roots[0] - roots[1]) <= np.sqrt(EQUAL_STATES) * size).all())
