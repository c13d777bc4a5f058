"""Comparison of a system in gauss and in Pinocchio over states: largest relative differences of each quantity."""

import numpy as np

from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.analysis.crosscheck.pinocchio_dynamics import (
    PinocchioInstant,
    energies,
    instant,
    reactions,
    refined_accelerations,
)
from gauss.analysis.crosscheck.pinocchio_loops import constrained_accelerations
from gauss.backends import make, solve
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.energies import kinetic_energy_of_bodies
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import extra
from gauss.system import State, System

with extra():
    import pinocchio as pin

# Moments are compared relative to no less than the largest force times a thousandth of the length of the scene, and forces
# relative to no less than the largest moment over a thousand lengths: where all moments vanish, they are rounding of forces.
SHORT_LEVER, LONG_LEVER = 1e-3, 1e3  # over the length of the scene


class Comparison:
    """Differences between gauss and Pinocchio over many states.

    Parameters
    ----------
    system : System
        The system.
    backend : str
        Backend of gauss.

    Attributes
    ----------
    peer : str
        Pinocchio and its version.
    worst : dict
        Largest relative difference by quantity; inf where a number is missing.
    unsolved : list of str
        Status of every solution of the backend that is not certified.
    """

    peer = f"Pinocchio {pin.__version__}"

    def __init__(self, system: System, backend: str = "auto"):
        self.system, self.twin = system, twin(system)
        self.backend = backend if backend == "auto" else make(backend)
        self.worst: dict[str, float] = {}
        self.unsolved: list[str] = []

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for readers of the differences."""
        notes = []
        if self.system.has_closures:
            notes.append("loops and couplings are met by a null space built from Pinocchio's inertia and frame motions")
            notes.append("reactions are compared for trees only")
        if self.unsolved:
            notes.append(f"{len(self.unsolved)} solutions are not certified; the first: {self.unsolved[0]}")
        return tuple(notes)

    def take(self, state: State, load: np.ndarray):
        """Compare in one state under additional generalised forces (n_v,)."""
        motion = kinematics(self.system, state)
        applied = Applied(motion)
        solution = solve(assemble_motion(motion, applied, load), self.backend)
        if not solution.status.certified:
            self.unsolved.append(str(solution.status))
        now = instant(self.twin, motion, applied, load)
        if self.system.has_closures:
            self._record("joint accelerations, null space", relative(solution.qdd, constrained_accelerations(now, state)))
        else:
            self._compare_tree(now, solution)
        self._compare_energies(now, motion)
        self._record("power balance, within gauss", imbalance(motion, applied, load, solution))

    def _compare_tree(self, now: PinocchioInstant, solution: Solution):
        qdd = refined_accelerations(now)
        self._record("joint accelerations, aba + rnea", relative(solution.qdd, qdd))
        force, moment = reactions(now, qdd)
        ours = -solution.multipliers.reshape(-1, 6)
        # a reaction is the sum of loads and inertia forces: at a free joint, their rounding
        loads = np.abs(solution.compulsion.impressed).reshape(-1, 2, 3).max(axis=(0, 2))
        short, long = (share * self.system.scale.length for share in (SHORT_LEVER, LONG_LEVER))
        floors = max(np.abs(moment).max(initial=0.0) / long, loads[1]), max(np.abs(force).max(initial=0.0) * short, loads[0])
        self._record("reaction forces, rnea", relative(ours[:, 3:], force, floors[0]))
        self._record("reaction moments, rnea", relative(ours[:, :3], moment, floors[1]))

    def _compare_energies(self, now: PinocchioInstant, motion: Kinematics):
        kinetic, potential = energies(now)
        self._record("kinetic energy", relative(kinetic_energy_of_bodies(motion), kinetic))
        weights = self.system.Phi[3::6, None] * np.array(self.system.scene.gravity)
        parts = -weights * np.array(motion.x[:-1])
        # potential energies of opposite sign cancel
        self._record("potential energy of gravity", relative(parts.sum(), potential, np.abs(parts).sum()))

    def _record(self, quantity: str, difference: float):
        difference = difference if np.isfinite(difference) else np.inf
        self.worst[quantity] = max(self.worst.get(quantity, 0.0), difference)


def relative(x, y, floor=0.0) -> float:
    """Largest |x − y| relative to the largest |y|, or to the floor where that is larger."""
    difference = float(np.max(np.abs(x - y), initial=0.0))
    scale = max(float(np.max(np.abs(y), initial=0.0)), float(floor))
    return difference / scale if scale else (np.inf if difference else 0.0)


def imbalance(motion: Kinematics, applied: Applied, load: np.ndarray, solution: Solution) -> float:
    """Difference of dT/dt = vᵀ Φ a and the power of all applied loads, relative to force times speed."""
    system = motion.system
    rate = motion.quasi_velocities() * system.Phi * solution.a
    weights = system.Phi[3::6, None] * np.array(system.scene.gravity)
    power = [(force + weight) * u for force, weight, u in zip(applied.F, weights, motion.u, strict=False)]
    power += [moment * W for moment, W in zip(applied.M[:-1], motion.W[:-1], strict=True)]
    powers = np.concatenate([*power, (applied.P + load) * motion.state.v])
    pulls = (np.linalg.norm(force + weight) for force, weight in zip(applied.F, weights, strict=False))
    along = sum(pull * np.linalg.norm(u) for pull, u in zip(pulls, motion.u, strict=False))
    return relative(rate.sum(), powers.sum(), max(np.abs(rate).sum(), np.abs(powers).sum(), along))
