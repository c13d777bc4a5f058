"""Recommendation of an integrator, with the distance to singularity, scaling, eigenvalues and cost of a scene."""

import time
from dataclasses import dataclass

import numpy as np

from gauss.backends.closure import Factor
from gauss.backends.motions import allowed
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.conditions import located_contacts, refuse_motionless
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.mobility import mobility
from gauss.dynamics.rules import Question
from gauss.errors import GaussError, require
from gauss.integrators import METHODS
from gauss.scene import Prescribed
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING
from gauss.system import State, System, retract

NEAR_SINGULAR = 1e-3  # σ_min/σ_max of the loop-closure Jacobian below which a configuration is near-singular
STIFFNESS_RATIO = 100.0  # fastest decay over the other rates above which an implicit method is recommended
INCREMENT = 1e-6  # units of the scene, of coordinates and rates for finite differences
SLOWEST_RATE = 1.0  # in the time of the scene, about the inverse duration of a simulation: slower motions do not count
RESOLVING_STEP = 0.1  # step of a fourth-order method times the fastest rate
TIMING = 0.02  # duration of the timing of evaluations [s]


@dataclass(frozen=True)
class Recommendation:
    """Properties of a system in one state, and the integrator for it; ``print`` it.

    Parameters
    ----------
    separation : float or None
        σ_min/σ_max of the independent loop constraints in the mass metric, relative to their sizes on free bodies: 0 in a
        singular configuration; None without loops.
    masses, moments : float
        Largest over smallest non-zero mass, and principal moment of inertia.
    rates : ndarray or None, shape (2f,)
        Eigenvalues of the linearisation about rest in this pose [1/s]; None where there is none.
    evaluation : float or None
        Time of one evaluation of the accelerations from Python on this machine [s]; None with friction, where accelerations
        exist step by step only.
    method : str
        Recommended integrator.
    reason : str
        Reason.
    """

    separation: float | None
    masses: float
    moments: float
    rates: np.ndarray | None
    evaluation: float | None
    method: str
    reason: str

    @property
    def fastest(self) -> float:
        """Largest eigenvalue in size [1/s]; 0 without a linearisation."""
        return 0.0 if self.rates is None else float(abs(self.rates).max(initial=0.0))

    def __str__(self):
        lines = [f"scaling: masses within a factor of {self.masses:.3g}, moments of inertia of {self.moments:.3g}"]
        if self.separation is not None:
            close = ", near-singular: reactions are large and ill-conditioned" if self.separation < NEAR_SINGULAR else ""
            lines.append(
                f"distance to singularity at the start: {self.separation:.3g} (σ_min/σ_max of the loop constraints){close}"
            )
        if self.rates is not None and self.fastest > 0:
            decay = max(0.0, float(-self.rates.real.min()))
            lines.append(
                f"fastest rate at rest in the start: {self.fastest:.3g} 1/s, fastest decay {decay:.3g} 1/s; "
                f"a fixed step of {_rounded(RESOLVING_STEP / self.fastest):g} s resolves it"
            )
        if self.evaluation is not None:
            lines.append(
                f"cost: {self.evaluation * 1e6:.3g} µs an evaluation (one call, measured here), "
                f"{METHODS[self.method].evaluations} of them a step of {self.method}"
            )
        return "\n".join([*lines, f"recommended: integrator {self.method!r}: {self.reason}"])


def advise(system: System, state: State | None = None) -> Recommendation:
    """Recommend an integrator for a system.

    "time_stepping" where contacts have friction; "dop853" with unilateral constraints; "radau5" where a motion decays
    :data:`STIFFNESS_RATIO` times faster than others oscillate or grow; else "dop853".

    Parameters
    ----------
    system : System
        The system.
    state : State, optional
        Consistent state; the start of the scene by default.

    Returns
    -------
    Recommendation
        Integrator with reasons; ``print`` it.

    Raises
    ------
    AssemblyError
        If the scene has no consistent start.
    SimulationError
        If nothing in it can move.
    """
    require(system, (System,), "advise")
    refuse_motionless(system, "advise")
    state = system.initial_state() if state is None else state
    motion = kinematics(system, state)
    factor = Factor(assemble_motion(motion, Applied(motion)))
    rates = _rates(system, state, factor)
    method, reason = _fitting(system, rates)
    return Recommendation(
        separation=_separation(system, state, factor),
        masses=_spread(system.Phi.reshape(-1, 6)[:, 3]),
        moments=_spread(system.Phi.reshape(-1, 6)[:, :3]),
        rates=rates,
        evaluation=_timed(system, state),
        method=method,
        reason=reason,
    )


def _separation(system: System, state: State, factor: Factor) -> float | None:
    """σ_min/σ_max of the independent loop constraints, relative to their sizes on free bodies."""
    if not factor.size or not factor.rank:
        return None
    if not (system.slips.placed or system.set_valued.placed or system.losses) and mobility(system, state).is_singular:
        return 0.0
    unbound = factor.unbound(factor.compulsion)
    sigma = np.linalg.svd(factor.W @ factor.rest / np.where(unbound > 0, unbound, 1.0), compute_uv=False)
    return float(sigma[factor.rank - 1] / sigma[0])


def _spread(values: np.ndarray) -> float:
    present = values[values > 0]
    return float(present.max() / present.min()) if present.size else 1.0


def _rates(system: System, state: State, factor: Factor) -> np.ndarray | None:
    """Eigenvalues of δz̈ = K δz + D δż along the motions z that the constraints allow, by finite differences."""
    prescribed = any(isinstance(relation, Prescribed) for relation in system.scene.relations.values())
    if prescribed or system.scene.nonsmooth:
        return None
    basis, scale = allowed(factor).rates, system.scale
    back = np.linalg.pinv(basis)

    def change(direction, moves: bool) -> np.ndarray:
        """Derivative of the accelerations along the motions with respect to a displacement or a velocity."""
        size = INCREMENT / np.abs(direction / (scale.coordinates if moves else scale.rates)).max()
        ends = []
        for step in (size * direction, -size * direction):
            q = retract(system, state.q, step) if moves else state.q
            ends.append(back @ system.accelerations(State(state.t, q, 0 * step if moves else step)))
        return (ends[0] - ends[1]) / (2 * size)

    try:
        K, D = (np.array([change(direction, moves) for direction in basis.T]).T for moves in (True, False))
    except GaussError:
        return None
    return np.linalg.eigvals(np.block([[np.zeros_like(K), np.eye(len(K))], [K, D]]))


def _stepped(system: System) -> str:
    """Why motions take time stepping; empty where they need not."""
    return "".join(located_contacts(Question(system, Laws(system))))


def _fitting(system: System, rates: np.ndarray | None) -> tuple[str, str]:
    if why := _stepped(system):
        return TIME_STEPPING.name, f"{why}; give a step="
    if system.scene.nonsmooth:
        return "dop853", "it locates the events of unilateral constraints, limited forces, losses and backlash"
    if rates is None:
        return "dop853", "order 8, step chosen by tolerances (the scene cannot rest in its start, to look for stiffness)"
    slow, decay, swinging = SLOWEST_RATE / system.scale.time, -rates.real.min(initial=0.0), abs(rates.imag) > abs(rates.real)
    pace = max(rates.real.max(initial=slow), abs(rates[swinging]).max(initial=slow))
    if decay > STIFFNESS_RATIO * pace:
        return "radau5", f"a motion decays {decay / pace:.3g} times faster than others oscillate or grow: stiff"
    return "dop853", "order 8, step chosen by tolerances; nothing is stiff at the start"


def _timed(system: System, state: State) -> float | None:
    """Shortest time [s] of the evaluations within :data:`TIMING`."""
    if _stepped(system) or system.set_valued.placed or system.losses:
        return None
    system.accelerations(state)  # compiled on first use
    best, until = np.inf, time.perf_counter() + TIMING
    while (began := time.perf_counter()) < until:
        system.accelerations(state)
        best = min(best, time.perf_counter() - began)
    return best


def _rounded(value: float) -> float:
    """Next lower of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(k for k in (1, 2, 5) if k * power <= value) * power)
