"""Painlevé's paradox: places where rigid bodies with Coulomb friction have no accelerations, or more than one.

While closed gaps slide, forces N ≥ 0 push along n + μ t with t against the sliding, and the gaps open with d̈ = K N + b,
where b = d̈ without them. Accelerations are found by 0 ≤ d̈ ⟂ N ≥ 0; for every b there is exactly one answer if and only if
all principal minors of K are positive (Cottle, Pang, Stone, The Linear Complementarity Problem, theorem 3.3.7). Of one gap,
K < 0 means: with b < 0 there is no answer, with b > 0 there are two, pressed and lifting.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.recursion import Factor
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.gap_functions import closed, gaps, slips
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.system import State, System

SLIDING = 1e-6  # of the fastest rate, in lengths of the scene: a gap that slides more slowly may as well stick
NEGATIVE = 1e-9  # of the product of the diagonal without friction: a minor is negative below minus this
MOST = 6  # gaps that are looked at together


@dataclass(frozen=True)
class Paradox:
    """Closed gaps that slide and whose forces are not determined.

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
    """Painlevé's paradoxes of a state: the smallest sets of sliding gaps whose forces are not determined.

    Parameters
    ----------
    system : System
        With contacts that have friction.
    state : State
        Where it is and how it moves.

    Returns
    -------
    list of Paradox
        Empty where accelerations exist and are unique, as far as sliding is concerned.
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
    forces = normals + slip.friction[which, None] * np.einsum("ki,kij->kj", against, slip.J[which])
    factor = Factor(problem)
    K, smooth = (normals @ _responses(factor, pushed).T for pushed in (forces, normals))
    b = normals @ np.concatenate(factor.solve(problem.impressed, problem.D, problem.P)[:2]) - gap.D[slip.gap[which]]
    return undetermined([motion.system.contacts.placed[i].name for i in slip.gap[which]], K, smooth, b)


def sliding(rates: np.ndarray, touching: np.ndarray, slow: float) -> np.ndarray:
    """Numbers of the places with friction that touch and slide faster than ``slow``, at most ``MOST``; rates are (k, 2)."""
    return np.flatnonzero((np.hypot(*rates.T) > slow) & touching)[:MOST]


def sliding_above(system: System, v):
    """Speed above which a gap slides and does not stick where rates are v, numbers or expressions [m/s]."""
    return SLIDING * system.scale.length * system.scale.fastest(v)


def rubbed(smooth, one, other, friction, along, aside):
    """Responses to unit forces of gaps that slide, from those along the normal and in two directions of the tangent plane.

    Friction pushes along (along, aside) with its coefficient.
    """
    return smooth + friction * (one * along + other * aside)


def undetermined(names: list[str], K: np.ndarray, smooth: np.ndarray, b: np.ndarray) -> list[Paradox]:
    """Smallest sets of sliding gaps whose forces are not determined.

    Parameters
    ----------
    names : list of str
        The gaps.
    K, smooth : ndarray, shape (k, k)
        Accelerations of the gaps that their forces give, with and without friction.
    b : ndarray, shape (k,)
        Accelerations without these forces [m/s²].
    """
    if np.linalg.eigvalsh(K + K.T)[0] >= -NEGATIVE * smooth.diagonal().max():  # then no minor is negative
        return []
    found = []
    for size in range(1, len(names) + 1):
        for some in map(list, combinations(range(len(names)), size)):
            known = any(set(paradox.gaps) <= {names[i] for i in some} for paradox in found)
            if known or np.linalg.det(K[np.ix_(some, some)]) > -NEGATIVE * np.prod(smooth.diagonal()[some]):
                continue
            kind = "not determined" if size > 1 else "no accelerations" if b[some[0]] < 0.0 else "two accelerations"
            found.append(Paradox(tuple(names[i] for i in some), kind))
    return found


def _responses(factor: Factor, forces: np.ndarray) -> np.ndarray:
    """Accelerations (k, 6n + p) that forces (k, 6n + p) give by themselves."""
    problem = factor.compulsion
    n, still = problem.Phi.size, np.zeros_like(problem.D)
    return np.array([np.concatenate(factor.solve(force[:n], still, force[n:])[:2]) for force in forces])
