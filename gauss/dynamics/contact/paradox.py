"""Painlevé's paradox: 0 ≤ d̈ = K N + b ⟂ N ≥ 0 of sliding contacts has no solution, or more than one.

Forces N act along n + μ t with t against the sliding velocity; b = d̈ without them. The linear complementarity problem has
exactly one solution for every b if and only if all principal minors of K are positive (Cottle, Pang, Stone, The Linear
Complementarity Problem, theorem 3.3.7). For one contact with K < 0, there is none if b < 0, and if b > 0 there are two:
contact and detachment.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.gap_functions import closed, gaps, slips
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.system import State, System

SLIDING = 1e-6  # of the fastest rate, in lengths of the scene: a contact that slides more slowly may stick
NEGATIVE = 1e-9  # of the product of the diagonal without friction: a minor is negative below minus this
MOST_CONTACTS = 6  # contacts in one problem


@dataclass(frozen=True)
class Paradox:
    """Sliding contacts with undetermined forces.

    Parameters
    ----------
    gaps : tuple of str
        Their names.
    kind : str
        "no accelerations", "two accelerations" of one gap; "not determined" of several.
    """

    gaps: tuple[str, ...]
    kind: str

    def __str__(self):
        meaning = {
            "no accelerations": "no force at {0} stops its closing: rigid bodies with this friction have no accelerations",
            "two accelerations": "{0} may be pressed or lift off: rigid bodies with this friction have two accelerations",
            "not determined": "forces at {0} need not exist or be unique: rigid bodies with this friction have no law here",
        }
        return meaning[self.kind].format(", ".join(map(repr, self.gaps))) + " (Painlevé's paradox)"


def paradoxes(system: System, state: State) -> list[Paradox]:
    """Painlevé's paradoxes of a state: the smallest sets of sliding contacts with undetermined forces.

    Parameters
    ----------
    system : System
        With contacts that have friction.
    state : State
        Its state.

    Returns
    -------
    list of Paradox
        Empty where accelerations with sliding contacts exist and are unique.
    """
    motion = kinematics(system, state)
    touching = closed(system, gaps(motion), state.v)
    return _of_motion(motion, assemble_motion(motion, Applied(motion)), touching)


def _of_motion(motion: Kinematics, problem: Compulsion, touching: np.ndarray) -> list[Paradox]:
    gap, slip = gaps(motion), slips(motion)
    which = sliding(slip.rate, np.isin(slip.gap, touching), sliding_above(motion.system, motion.state.v))
    if not which.size:
        return []
    normals = gap.J[slip.gap[which]]
    against = -slip.rate[which] / np.hypot(*slip.rate[which].T)[:, None]
    wrenches = normals + slip.friction[which, None] * np.einsum("ki,kij->kj", against, slip.J[which])
    factor = Factor(problem)
    K, smooth = (normals @ _responses(factor, forces).T for forces in (wrenches, normals))
    b = normals @ np.concatenate(factor.solve(problem.impressed, problem.D, problem.P)[:2]) - gap.D[slip.gap[which]]
    return undetermined([motion.system.contacts.placed[i].name for i in slip.gap[which]], K, smooth, b)


def sliding(rates: np.ndarray, touching: np.ndarray, slow: float) -> np.ndarray:
    """Contacts with friction that touch and slide faster than ``slow``, at most ``MOST_CONTACTS``; rates are (k, 2)."""
    return np.flatnonzero((np.hypot(*rates.T) > slow) & touching)[:MOST_CONTACTS]


def sliding_above(system: System, v):
    """Speed above which a contact slides, for rates v, numbers or expressions [m/s]."""
    return SLIDING * system.scale.length * system.scale.fastest(v)


def with_sliding_friction(smooth, one, other, friction, along, aside):
    """Responses to forces n + μ t of sliding contacts, from those along the normal and two tangential directions.

    The direction t is (along, aside).
    """
    return smooth + friction * (one * along + other * aside)


def undetermined_sliding(names: list[str], friction, rates, smooth, sideways, b) -> list[Paradox]:
    """Smallest sets of sliding contacts with undetermined forces, by their sliding velocities.

    Parameters
    ----------
    friction, rates : ndarray, shape (k,), (k, 2)
        Coefficients, and sliding velocities.
    smooth, sideways : ndarray, shape (k, k), (k, k, 2)
        Accelerations d̈ by unit forces along the normals, and along the tangential directions.
    b : ndarray, shape (k,)
        Accelerations d̈ without these forces.
    """
    against = -rates / np.hypot(*rates.T)[:, None]
    K = with_sliding_friction(smooth, sideways[:, :, 0], sideways[:, :, 1], friction, *against.T)
    return undetermined(names, K, smooth, b)


def undetermined(names: list[str], K: np.ndarray, smooth: np.ndarray, b: np.ndarray) -> list[Paradox]:
    """Smallest sets of sliding contacts with undetermined forces.

    Parameters
    ----------
    K, smooth : ndarray, shape (k, k)
        Accelerations d̈ by unit forces, with and without friction.
    b : ndarray, shape (k,)
        Accelerations d̈ without these forces [m/s²].
    """
    if np.linalg.eigvalsh(K + K.T)[0] >= -NEGATIVE * smooth.diagonal().max():  # then no minor is negative
        return []
    found: list[Paradox] = []
    for size in range(1, len(names) + 1):
        for some in map(list, combinations(range(len(names)), size)):
            known = any(set(paradox.gaps) <= {names[i] for i in some} for paradox in found)
            if known or np.linalg.det(K[np.ix_(some, some)]) > -NEGATIVE * np.prod(smooth.diagonal()[some]):
                continue
            kind = "not determined" if size > 1 else "no accelerations" if b[some[0]] < 0.0 else "two accelerations"
            found.append(Paradox(tuple(names[i] for i in some), kind))
    return found


def _responses(factor: Factor, forces: np.ndarray) -> np.ndarray:
    """Accelerations (k, 6n + p) by forces (k, 6n + p) alone."""
    problem = factor.compulsion
    n, still = problem.Phi.size, np.zeros_like(problem.D)
    return np.array([np.concatenate(factor.solve(force[:n], still, force[n:])[:2]) for force in forces])
