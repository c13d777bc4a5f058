"""What a system is asked for: accelerations, and states that meet every constraint."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.assembly import Applied, assemble_motion, closure_gap, kinematics
from gauss.backends.recursion import Factor
from gauss.errors import StateError
from gauss.simulation.laws import Laws
from gauss.simulation.solver import Solver
from gauss.system import State, System, retract

CLOSED = 1e-13  # closure gap [rad, m] at which rounding is reached for mechanisms of the size of metres
ACCEPTED = 1e-10  # gap with which a start is still called consistent
NEWTON_STEPS = 60
SMALLEST_SHARE = 1e-4  # of a Newton step: shorter ones mean that the gap cannot be closed from here


class OnDemand:
    """Dynamics of one system; its machine code is made when a motion first asks for it."""

    def __init__(self):
        self._made: dict[str, object] = {}

    def on_demand(self, name: str, make: Callable):
        """What is kept under this name, made when it is first asked for."""
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]

    def called(self, system: System) -> dict[str, str]:
        """Loads whose laws cannot become machine code, and why."""
        return Laws(system).reasons

    def accelerations(self, system: System, state: State, load=None) -> np.ndarray:
        """Accelerations (n_v,)."""
        return Solver().rates(system, state, load).acceleration

    def consistent(self, system: System, state: State, held: tuple[str, ...] = ()) -> State:
        """State nearest in the mass metric that meets every constraint; joints in ``held`` keep theirs if that is possible.

        Raises
        ------
        StateError
            If the closures cannot be met from there.
        """
        if not system.has_closures:
            return state
        if held:
            kept = meet_rates(system, meet_closures(system, state, NEWTON_STEPS, held), held)
            if _is_met(system, kept) and _keeps(system, state, kept, held):
                return kept
        state = meet_closures(system, state, NEWTON_STEPS)
        gap = closure_gap(kinematics(system, state))
        if np.abs(gap).max() > ACCEPTED:
            _refuse(system, gap)
        return meet_rates(system, state)


def project(system: System, state: State) -> State:
    """State after a step, brought back to the constraints: a few Newton steps in position, one in velocity."""
    if not system.has_closures:
        return state
    return meet_rates(system, meet_closures(system, state, 3))


def meet_closures(system: System, state: State, steps: int, held: tuple[str, ...] = ()) -> State:
    """Newton's method on the closure gap, each step the least one in the mass metric: δ = −Φ⁻¹Jᵀ(JΦ⁻¹Jᵀ)⁻¹ c."""
    gap, factor = _gap(system, state, held)
    share = 1.0
    for _ in range(steps):
        size = np.abs(gap).max()
        if size <= CLOSED or share < SMALLEST_SHARE:
            break
        _, step, _, _ = factor.solve(np.zeros(system.Phi.size), -gap, np.zeros(system.n_v))
        share = 1.0
        while share >= SMALLEST_SHARE:
            trial = replace(state, q=retract(system, state.q, share * step))
            trial_gap, trial_factor = _gap(system, trial, held)
            if np.abs(trial_gap).max() < size:
                state, gap, factor = trial, trial_gap, trial_factor
                break
            share /= 2
    return state


def meet_rates(system: System, state: State, held: tuple[str, ...] = ()) -> State:
    """Rates nearest in the mass metric that meet A v + B q̇ = C."""
    motion = kinematics(system, state)
    compulsion = assemble_motion(motion, Applied(motion))
    momentum = system.Phi * motion.quasi_velocities()
    factor, columns = _holding(system, compulsion, held)
    _, v, _, _ = factor.solve(momentum, compulsion.C, np.zeros(system.n_v), state.v[columns])
    return replace(state, v=v)


def _gap(system: System, state: State, held):
    motion = kinematics(system, state)
    return closure_gap(motion), _holding(system, assemble_motion(motion, Applied(motion)), held)[0]


def _holding(system: System, compulsion, held):
    """Factorisation in which the rates of the held joints are prescribed by rows of their own, and these rates."""
    columns = [k for name in held for k in range(*system.joint(name).v.indices(system.n_v))]
    G = np.zeros((len(columns), system.Phi.size + system.n_v))
    G[np.arange(len(columns)), system.Phi.size + np.array(columns, dtype=int)] = 1.0
    held_rows = np.arange(len(columns))
    return Factor(replace(compulsion, G=G, h=np.zeros(len(columns)), gap=0.0), held_rows), columns


def _is_met(system: System, state: State) -> bool:
    return np.abs(closure_gap(kinematics(system, state))).max() <= ACCEPTED


def _keeps(system: System, start: State, kept: State, held) -> bool:
    joints = [system.joint(name) for name in held]
    moved = max(np.abs(start.q[j.q] - kept.q[j.q]).max(initial=0.0) for j in joints)
    slowed = max(np.abs(start.v[j.v] - kept.v[j.v]).max(initial=0.0) for j in joints)
    return moved <= ACCEPTED and slowed <= ACCEPTED * (1.0 + np.abs(start.v).max())


def _refuse(system: System, gap: np.ndarray):
    worst = max(system.structure.constraints, key=lambda c: np.abs(gap[c.rows]).max())
    part = gap[worst.rows]
    amount = (
        f"{np.linalg.norm(part[3:]):.3g} m and {np.linalg.norm(part[:3]):.3g} rad apart"
        if part.size == 6
        else f"off by {abs(part[0]):.3g}"
    )
    raise StateError(
        f"constraint {worst.name!r} cannot be met from this start: {amount} in the closest pose found. "
        "Check the lengths and frames of its loop, or start nearer to an assembled pose."
    )
