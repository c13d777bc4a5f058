"""Loads of a system as generalised forces: Q = P + Σ Jᵀ (F, M), without the equations of motion.

Forces and moments on bodies are carried inward along the spanning tree
(:func:`gauss.dynamics.inverse_dynamics_residual.along_rates`). Traced loads become machine code; opaque laws are called by
Python between two kernels, of the poses of all bodies and of Jᵀ.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.inverse_dynamics_residual import along_rates
from gauss.dynamics.kinematics import Kinematics, KinematicsOnAccess, kinematics
from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.loads import Applied
from gauss.dynamics.store import cached_on_disk
from gauss.scene import GROUND
from gauss.system import BoundLoad, State, System

ENDS = "body", "other"  # fields of loads on bodies that name these


def generalised_forces(motion: Kinematics, applied: Applied) -> np.ndarray:
    """Applied loads along the rates (n_v,), with those on bodies carried inward along the spanning tree.

    Parameters
    ----------
    motion : Kinematics
        Kinematics, with its joints if there are loads on bodies; floats or expressions.
    applied : Applied
        Loads of this state.
    """
    system, P = motion.system, applied.P
    loaded = {body for body in range(system.structure.n_bodies) if _acts(applied.F[body]) or _acts(applied.M[body])}
    if not loaded:
        return P
    return P + along_rates(motion, {body: (applied.M[body], applied.F[body]) for body in loaded})


def _acts(part: np.ndarray) -> bool:
    return part.dtype == object or bool(part.any())


class LoadForces:
    """Generalised forces and power of loads, (t, q, v) → (Q (n_v,), power (3,) of drives, forces, dampers).

    Parameters
    ----------
    system : System
        The system.
    called : sequence of BoundLoad
        Loads that Python evaluates.
    laws : Laws, optional
        Those whose traced loads are evaluated, too, by machine code; when not given, none are.
    """

    def __init__(self, system: System, called: Sequence[BoundLoad] = (), laws: Laws | None = None):
        self.system, self.called = system, list(called)
        self._traced = None if laws is None or not laws.traced else _traced(system, laws)
        on_bodies = [bound for bound in self.called if not bound.on_coordinates]
        self._loaded = sorted({body for bound in on_bodies for body in _bodies(system, bound)})
        self._posed = bool(on_bodies) or any(needs_poses(bound.load) for bound in self.called)

    def __call__(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Generalised forces, and power [W]."""
        system, n_v = self.system, self.system.n_v
        Q, power = np.zeros(n_v), np.zeros(3)
        if self._posed or self._traced is not None:
            inputs = np.concatenate([[state.t], state.q, state.v])
        if self.called:
            motion = self._placed(state, inputs) if self._posed else Kinematics(system, state)
            applied = Applied(motion, self.called)
            Q, power = applied.P, np.array([applied.driven, applied.loaded, applied.dissipated])
            if self._loaded:
                wrenches = [part[body] for body in self._loaded for part in (applied.F, applied.M)]
                Q = Q + self._transposed(np.concatenate([inputs, *wrenches]))
        if self._traced is not None:
            found = self._traced(inputs)
            Q, power = Q + found[:n_v], power + found[n_v:]
        return Q, power

    def _placed(self, state: State, inputs: np.ndarray) -> Kinematics:
        """Kinematics with poses by machine code, at the first access: many laws need coordinates and rates only."""

        def poses() -> tuple[np.ndarray, ...]:
            places = self.system.structure.n_bodies
            R, x, W, u = np.split(self._poses(inputs), np.cumsum([9 * places, 3 * places, 3 * places]))
            return R.reshape(places, 3, 3), *(part.reshape(places, 3) for part in (x, W, u))

        return KinematicsOnAccess(self.system, state, poses)

    @cached_property
    def _poses(self) -> Kernel:
        system = self.system

        def poses(t, q, v):
            motion, places = kinematics(system, State(t[0], q, v)), range(system.structure.n_bodies)
            parts = motion.R, motion.x, motion.W, motion.u
            return tuple(np.concatenate([np.ravel(part[body]) for body in places]) for part in parts)

        make = lambda: Kernel(write(poses, 1, system.n_q, system.n_v, name="poses"), batch=False)  # noqa: E731
        return cached_on_disk(system, (LoadForces, "poses"), make)

    @cached_property
    def _transposed(self) -> Kernel:
        system, loaded = self.system, self._loaded

        def transposed(t, q, v, wrenches):
            motion = kinematics(system, State(t[0], q, v))
            applied = Applied(motion, ())
            for body, (F, M) in zip(loaded, wrenches.reshape(-1, 2, 3), strict=True):
                applied.F[body], applied.M[body] = F, M
            return (generalised_forces(motion, applied),)

        sizes = 1, system.n_q, system.n_v, 6 * len(loaded)
        make = lambda: Kernel(write(transposed, *sizes, name="transposed"), batch=False)  # noqa: E731
        return cached_on_disk(system, (LoadForces, "transposed", tuple(loaded)), make)


def _bodies(system: System, bound: BoundLoad) -> list[int]:
    """Bodies that a load may act on."""
    names = [getattr(bound.load, field) for field in ENDS if hasattr(bound.load, field)]
    if not names:
        return list(range(system.structure.n_bodies))
    return [system.frame(name).body for name in names if name != GROUND]


def _traced(system: System, laws: Laws) -> Kernel:
    """Machine code of the traced loads: (t, q, v) → (generalised forces, power)."""

    def forces(t, q, v):
        motion = kinematics(system, State(t[0], q, v))
        applied = Applied(motion, laws.traced)
        return generalised_forces(motion, applied), [applied.driven, applied.loaded, applied.dissipated]

    make = lambda: Kernel(write(forces, 1, system.n_q, system.n_v, name="forces"), batch=False)  # noqa: E731
    return cached_on_disk(system, (LoadForces, laws.key), make)
