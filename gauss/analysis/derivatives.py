"""Derivatives of the accelerations of one state with respect to coordinates, rates and forces.

All directions at once, in SIMD code that is short for any system, by :mod:`gauss.dynamics.acceleration_derivatives`. For
many states of a small one, ``system.acceleration_derivatives`` is faster.
"""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.assemble import checked_load
from gauss.dynamics.constraint_leak import LARGEST_LEAK, constraint_leak, may_leak
from gauss.dynamics.contact.mode_selection import active_mode, has_joint_modes, on_boundary
from gauss.dynamics.laws.load_jumps import kinked_laws
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.null_space_dynamics import NullSpaceDynamics
from gauss.dynamics.plan import DERIVATIVES
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.errors import SimulationError, judged_later, require
from gauss.shapes import Shaped
from gauss.system import State, System, refuse_changed


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of the accelerations in one state; columns are in the order of ``system.coordinates``.

    Parameters
    ----------
    q : ndarray, shape (n_v, n_v)
        With respect to displacements along the rates; of a quaternion these are rotations about body-fixed axes.
    v : ndarray, shape (n_v, n_v)
        With respect to the rates.
    load : ndarray, shape (n_v, n_v)
        With respect to generalised forces; without loops the inverse of the joint-space inertia M.
    """

    q: Shaped[np.ndarray, "nv nv"]
    v: Shaped[np.ndarray, "nv nv"]
    load: Shaped[np.ndarray, "nv nv"]


def derivatives(system: System, state: State, load=None) -> Derivatives:
    """Differentiate the accelerations of a system in a state that meets its constraints.

    Parameters
    ----------
    system : System
        System that can be compiled; see ``system.explain()``.
    state : State
        Consistent state.
    load : array_like, shape (n_v,), optional
        Generalised forces added to those of the scene [N m, N].

    Returns
    -------
    Derivatives
        Three matrices. With loops, changes of coordinates and rates are along the constraints. With joint friction and
        limited drives they are those of the contact mode of this state: slipping elements are loads of constant sign,
        sticking ones are constraints, and changes of rates are along these. Where loop constraints are redundant, sums
        along the constraints have eight digits; those of :func:`gauss.linearise` have all. Where bodies of one loop
        differ in mass or inertia by more than a thousand, digits are checked in each state; where the elimination loses
        them, the null space of the constraints gives the derivatives, in milliseconds, with eight digits or more.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, with the reasons; if friction is between sticking and slipping, or a law has a kink
        or a jump; if accelerations or derivatives are not determined; or if fewer than five digits are left of them.
    StateError
        If a loop that cannot move has another pose than in the scene.
    """
    require(system, (System,), "derivatives")
    require(state, (State,), "derivatives: state")
    changes = AccelerationChanges(system, state, load)
    return Derivatives(*np.split(changes.along(np.eye(3 * system.n_v)), 3, axis=1))


class AccelerationChanges:
    """Changes of the accelerations of a system in one state.

    SimulationError, StateError as :func:`derivatives`.

    Parameters
    ----------
    system, state, load
        As for :func:`derivatives`.

    Attributes
    ----------
    system : System
        The system of the contact mode in this state, in which sticking elements are constraints.
    """

    def __init__(self, system: System, state: State, load=None):
        refuse_changed(system)
        refuse_other_pose(system, state.q)
        if has_joint_modes(system) and not (system.contacts.placed or system.losses):
            system = _of_mode(system, state, load)
        self.system, self.state, self.load = system, state, None if load is None else checked_load(system, load)
        self.laws = Laws(system)
        if not system.n_v:
            return
        DERIVATIVES.plan(Question(system, self.laws))
        if kinked := kinked_laws(system, self.laws, state):
            raise SimulationError(
                f"t = {state.t:.6g} s: the law of {', '.join(map(repr, kinked))} has a kink or a jump in this state, and "
                "accelerations have no derivatives; take a state beside it, or a smooth law, as with gauss.math.tanh."
            )

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Changes (n_v, k) along directions (3 n_v, k) of displacements, rates and generalised forces.

        Where rows are redundant, directions along the constraints keep their digits; along others these rows contradict each
        other, and their multipliers are large.

        SimulationError if the changes are not determined.
        """
        system, laws, state = self.system, self.laws, self.state
        if not system.n_v:
            return np.zeros((0, directions.shape[1]))
        solve, slope = cached_on_disk(system, (_kernels, laws.key), lambda: _kernels(system, laws.traced))
        load = np.zeros(system.n_v) if self.load is None else self.load
        given = np.concatenate([[state.t], state.q, state.v, load])
        with judged_later():
            solution = solve(given)
            if may_leak(system):
                if not solution[-1] <= LARGEST_LEAK:
                    return self._by_null_space(load, directions)
                solution = solution[:-1]
            fixed = np.tile(np.concatenate([given, solution])[:, None], directions.shape[1])
            found = slope(np.concatenate([fixed, directions]))
        if not np.isfinite(found).all():
            raise self._undetermined()
        return found

    def _by_null_space(self, load: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """The same where elimination leaves few digits."""
        found = NullSpaceDynamics(self.system, self.laws, self.state, load).changes(directions)
        if not np.isfinite(found).all():
            raise self._undetermined()
        return found

    def _undetermined(self) -> SimulationError:
        self.system.accelerations(self.state, self.load)  # raises where accelerations are not determined
        return SimulationError(
            f"scene {self.system.scene.name!r}: the accelerations have no finite derivatives in this state."
        )


def _of_mode(system: System, state: State, load) -> System:
    """System of the contact mode of joint friction and limited drives in a state."""
    held = active_mode(system, state, load)
    if between := on_boundary(system, state, held):
        names = ", ".join(map(repr, between))
        raise SimulationError(
            f"t = {state.t:.6g} s: {names}: between sticking and slipping accelerations have a kink, no derivatives; "
            "take a state that slides, or a load within the limits."
        )
    return held.system


def _kernels(system: System, loads) -> tuple[Kernel, Kernel]:
    """(t, q, v, load) → (q̈, λ, leak if checked), and (t, q, v, load, q̈, λ, changes of q, v and load) → change of q̈."""
    sizes, checked = (1, system.n_q, system.n_v, system.n_v), may_leak(system)

    def solved(t, q, v, load):
        loaded = LoadedMechanism(system, loads, t[0], q, v, load)
        return *loaded.motion(), [constraint_leak(system, loaded.mechanism)] * checked

    def change(t, q, v, load, rates, multipliers, along_q, along_v, along_load):
        loaded = LoadedMechanism(system, loads, t[0], q, v, load)
        ((force, constraint, following),) = loaded.changes(rates, multipliers, [(along_q, along_v)])
        return loaded.mechanism.response(force + along_load, constraint)[0] + following

    solve = write(solved, *sizes, name="solve")
    count = len(solve.outputs) - checked - system.n_v
    directions = [system.n_v] * 3
    return Kernel(solve, batch=False), Kernel(write(change, *sizes, system.n_v, count, *directions, name="change"))
