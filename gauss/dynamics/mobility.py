"""Mobility: freedoms by counting and by rank of the Jacobian, redundant constraints, undetermined reactions."""

from dataclasses import dataclass, replace

import numpy as np

from gauss.backends.closure import Factor
from gauss.backends.motions import Allowed, allowed
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.consistent_states import consistent
from gauss.dynamics.initial_states import given_starts
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.store import cached
from gauss.errors import BackendError, StateError, require
from gauss.system import State, System, retract

COMPONENTS = ("moment x", "moment y", "moment z", "force x", "force y", "force z")  # rows of a joint, world axes
LEAST_SHARE = 1e-9  # of the largest entry, above which a multiplier is part of a redundancy
NEARBY = 0.02  # rad, and lengths of the scene: distance of the configuration that shows whether this one is singular


@dataclass(frozen=True)
class Redundancy:
    """Linearly dependent constraints.

    Parameters
    ----------
    constraints : tuple of str
        Their names; no proper subset is dependent.
    count : int
        Number of redundant rows.
    """

    constraints: tuple[str, ...]
    count: int


@dataclass(frozen=True)
class Mobility:
    """Freedoms of a system in one state; ``print`` it.

    Parameters
    ----------
    counted : int
        Freedoms by counting: unknowns less rows.
    freedoms : int
        Freedoms by rank.
    nearby : int
        Freedoms by rank a little away; fewer than ``freedoms`` in a singular configuration.
    redundant : tuple of Redundancy
        Groups of linearly dependent constraints.
    loose : dict
        Undetermined components of reactions, by constraint, in world axes.
    """

    counted: int
    freedoms: int
    nearby: int
    redundant: tuple[Redundancy, ...]
    loose: dict[str, tuple[str, ...]]

    @property
    def is_singular(self) -> bool:
        """Whether the configuration has more freedoms than its neighbours."""
        return self.freedoms > self.nearby

    def __str__(self):
        rows = sum(group.count for group in self.redundant)
        lines = [f"freedoms: {self.freedoms} by rank, {self.counted} by counting, {rows} redundant row{'s' * (rows != 1)}"]
        if self.is_singular:
            lines.append(f"singular configuration: {self.nearby} by rank nearby")
        for group in self.redundant:
            count = "1 row" if group.count == 1 else f"{group.count} rows"
            lines.append(f"redundant: {count} among {', '.join(group.constraints)}")
        if self.loose:
            lines.append("reactions that are not unique (world axes):")
            lines += [f"  {name}: {', '.join(parts)}" for name, parts in self.loose.items()]
        return "\n".join(lines)


def mobility(system: System, state: State | None = None) -> Mobility:
    """Freedoms, redundant constraints and undetermined reactions of a system in a state.

    Parameters
    ----------
    system : System
        The system.
    state : State, optional
        Consistent state; the start of the scene when not given.

    Returns
    -------
    Mobility
        ``print`` it.

    Raises
    ------
    AssemblyError
        If the scene has no consistent start.
    """
    require(system, (System,), "mobility")
    state = system.initial_state() if state is None else state
    found = allowed(_factor(system, state))
    structure = system.structure
    freedoms = found.rates.shape[1]
    return Mobility(
        counted=6 * structure.n_bodies + structure.n_columns - structure.n_rows,
        freedoms=freedoms,
        nearby=_freedoms_nearby(system, state, found) if system.has_closures and freedoms else freedoms,
        redundant=_groups(system, found.redundancies),
        loose=_loose(system, found.redundancies),
    )


def mobility_at_start(system: System) -> Mobility:
    """Freedoms and redundant constraints at the start of the scene, found once."""
    return cached(system, (mobility, given_starts(system)), lambda: mobility(system))


def _freedoms_nearby(system: System, state: State, found: Allowed) -> int:
    """Freedoms after a small random motion that the constraints allow; those of the state if it cannot be assembled."""
    rng = np.random.default_rng(0)
    direction = found.rates @ rng.standard_normal(found.rates.shape[1])
    direction *= NEARBY / np.abs(direction / system.scale.coordinates).max()
    try:
        moved = consistent(system, replace(state, q=retract(system, state.q, direction)))
    except StateError:
        return found.rates.shape[1]
    return allowed(_factor(system, moved)).rates.shape[1]


def _factor(system: System, state: State) -> Factor:
    """Factorisation with the bilateral constraints alone."""
    motion = kinematics(system, state)
    compulsion = assemble_motion(motion, Applied(motion))
    try:
        return Factor(compulsion)
    except BackendError:  # a link without inertia ends the tree, and follows others: freedoms do not depend on inertia
        Phi = compulsion.Phi.reshape(-1, 6)
        sizes = np.repeat([Phi[:, :3].max() or 1.0, Phi[:, 3:].max() or 1.0], 3)
        return Factor(replace(compulsion, Phi=np.where(Phi > 0.0, Phi, sizes).ravel()))


def _groups(system: System, redundancies: np.ndarray) -> tuple[Redundancy, ...]:
    """Constraints that share a redundancy, by the blocks of the projector onto all redundancies."""
    if not redundancies.shape[1]:
        return ()
    constraints = system.structure.constraints
    basis, _ = np.linalg.qr(redundancies / np.linalg.norm(redundancies, axis=0))
    basis = np.where(np.abs(basis) > LEAST_SHARE, basis, 0.0)
    members = [i for i, c in enumerate(constraints) if basis[c.rows].any()]
    found = []
    for group in sorted(_coupled(basis, constraints, members), key=min):
        rows = np.concatenate([np.arange(constraints[i].rows.start, constraints[i].rows.stop) for i in sorted(group)])
        count = int(round(float((basis[rows] ** 2).sum())))  # the trace of the block of a projector is its rank
        found.append(Redundancy(tuple(constraints[i].name for i in sorted(group)), count))
    return tuple(found)


def _coupled(basis: np.ndarray, constraints, members: list[int]) -> list[set[int]]:
    """Sets of constraints whose blocks of the projector are coupled."""
    groups: list[set[int]] = []
    for i in members:
        coupled = {
            j for j in members if np.abs(basis[constraints[i].rows] @ basis[constraints[j].rows].T).max() > LEAST_SHARE
        }
        joined = coupled.union(*(group for group in groups if group & coupled))
        groups = [group for group in groups if not group & coupled] + [joined]
    return groups


def _loose(system: System, redundancies: np.ndarray) -> dict[str, tuple[str, ...]]:
    if not redundancies.shape[1]:
        return {}
    sizes = np.linalg.norm(redundancies / np.linalg.norm(redundancies, axis=0), axis=1)
    sizes /= sizes.max()
    found = {}
    for constraint in system.structure.constraints:
        part = np.flatnonzero(sizes[constraint.rows] > LEAST_SHARE)
        if part.size:
            found[constraint.name] = tuple(row_name(constraint, int(k)) for k in part)
    return found


def row_name(constraint, row: int) -> str:
    """Row of a constraint in words; the six of a joint are moments and forces along the world axes."""
    if constraint.rows.stop - constraint.rows.start == len(COMPONENTS):
        return COMPONENTS[row]
    return f"row {row + 1}"
