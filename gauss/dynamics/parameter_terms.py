"""Derivatives of inverse dynamics with respect to parameters of a scene, at fixed coordinates, rates and accelerations.

A body with mass m, moments I about its centre of mass c and accelerations α, a takes the force m (a − g) and the moment
I α + ω × I ω: both are linear in m and I, so that their derivatives are wrenches, which the transposed Jacobian carries to
the joints (the regressor: Atkeson, An, Hollerbach, Estimation of inertial parameters, IJRR 5(3), 1986). Constants of loads
and places of joints are differentiated on the traced graph. On the constraints ∂q̈ = −X ∂τ with the response X to unit
forces.
"""

from collections.abc import Sequence

import numpy as np

from gauss.codegen import Scalar, forward, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.constraint_leak import refused_where_leaking
from gauss.dynamics.inverse_dynamics_residual import along_rates, outward_accelerations
from gauss.dynamics.joint_places import accelerations_by_place, inverse_dynamics_by_place
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.load_forces import generalised_forces
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.parameters import changed
from gauss.errors import ArgumentError, StateError, did_you_mean, require
from gauss.rotations import cross
from gauss.scene import Force, Slipping
from gauss.system import BoundLoad, State, System, whole

OF_BODIES = {"mass": 1, "com": 3, "inertia": 6}
OF_JOINTS = {"parent_at": 3, "child_at": 3}
GRAVITY = "gravity"
MOMENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz


def size_of(system: System, parameter: str) -> int:
    """Number of values of a parameter such as "mass:arm"; see :meth:`gauss.System.parameter_derivatives`.

    ArgumentError if there is none of this kind, or the derivative does not exist.
    StateError if there is no such body, joint or load.
    """
    require(parameter, (str,), "parameter")
    kind, _, name = parameter.partition(":")
    if parameter == GRAVITY:
        return 3
    if not name:
        raise ArgumentError(f"parameter {parameter!r}: expected 'gravity', or a kind and a name, as in 'mass:body'.")
    if kind in OF_BODIES:
        _known(parameter, name, system.structure.bodies)
        return OF_BODIES[kind]
    if kind in OF_JOINTS:
        _known(parameter, name, [joint.name for joint in system.joints])
        if system.relations.placed:
            raise ArgumentError(f"parameter {parameter!r}: beside relations, there are no derivatives by places of joints.")
        return OF_JOINTS[kind]
    given = _load_of(system, parameter)
    numbers = vars(given.element if isinstance(given, Slipping) else given)
    fields = [field for field, value in numbers.items() if isinstance(value, float)]
    if kind not in fields:
        raise ArgumentError(f"parameter {parameter!r}: {name!r} has no number {kind!r}. {did_you_mean(kind, fields)}")
    return 1


def _load_of(system: System, parameter: str):
    """The load of a parameter such as "stiffness:spring"."""
    name = parameter.partition(":")[2]
    loads = {bound.load.name: bound.load for bound in system.loads}
    if name not in loads:
        words = ", ".join(f'"{one}:NAME"' for one in (*OF_BODIES, *OF_JOINTS))
        raise StateError(
            f'parameter {parameter!r}: expected "{GRAVITY}", {words}, or "NUMBER:NAME" of a load, as in "stiffness:spring". '
            f"{did_you_mean(name or parameter, loads)}"
        )
    return loads[name]


def _known(parameter: str, name: str, names):
    if name not in names:
        raise StateError(f"parameter {parameter!r}: no {name!r}. {did_you_mean(name, names)}")


def inverse_dynamics_by_parameter(
    system: System, loads: Sequence[BoundLoad], t: Scalar, q, v, rates, parameter: str
) -> np.ndarray:
    """Derivative (n_v, k) of inverse dynamics by a parameter of k values, over symbols."""
    kind, _, name = parameter.partition(":")
    if kind in OF_JOINTS:
        columns = inverse_dynamics_by_place(system, loads, State(t, q, v), rates, parameter)
    elif parameter == GRAVITY or kind in OF_BODIES:
        motion = kinematics(system, State(t, q, v))
        wrenches = _by_gravity(system) if parameter == GRAVITY else _by_inertia(motion, loads, rates, kind, name)
        columns = [along_rates(motion, own) for own in wrenches]
    else:
        columns = _by_constant(system, loads, t, q, v, kind, name)
    mechanism = Mechanism(system, q, v, t, (whole(system),))
    return np.array([mechanism.along_tree(np.array(column, dtype=object)) for column in columns]).T


def accelerations_by_parameter(
    system: System, loads: Sequence[BoundLoad], t: Scalar, q, v, load, parameter: str
) -> np.ndarray:
    """Derivative (n_v, k) of the accelerations by a parameter of k values, over symbols."""
    kind = parameter.partition(":")[0]
    if kind in OF_JOINTS and system.has_closures:
        return accelerations_by_place(system, loads, State(t, q, v), load, parameter)
    loaded = LoadedMechanism(system, loads, t, q, v, load)
    rates, multipliers = loaded.motion()
    still = np.zeros(multipliers.size)
    columns = inverse_dynamics_by_parameter(system, loads, t, q, v, rates, parameter)
    found = np.array([loaded.mechanism.response(-column, still)[0] for column in columns.T]).T
    return refused_where_leaking(system, loaded.mechanism, found)


def _by_inertia(motion: Kinematics, loads, rates, kind: str, name: str) -> list[dict]:
    """Wrenches {body: (moment about the centre of mass, force)} of a unit change of each value."""
    system = motion.system
    body, R = system.structure.bodies.index(name), motion.rotation(name)
    alpha, linear = next(found for edge, *found in outward_accelerations(motion, rates) if edge.outer == body)
    omega, mass = motion.W[body], system.Phi[6 * body + 3]
    weight = linear - np.array(system.scene.gravity)
    if kind == "mass":
        return [{body: (np.zeros(3), weight)}]
    if kind == "com":
        at_centre = [Applied(motion, [bound]).F[body] for bound in loads if _acts_at_centre(bound.load, name)]
        total = mass * weight - sum(at_centre, np.zeros(3))
        return [{body: (cross(r, total), mass * (cross(alpha, r) + cross(omega, cross(omega, r))))} for r in R.T]
    found = []
    for i, k in MOMENTS:
        E = np.zeros((3, 3))
        E[i, k] = E[k, i] = 1.0
        turned = R @ E @ R.T
        found.append({body: (turned @ alpha + cross(omega, turned @ omega), np.zeros(3))})
    return found


def _acts_at_centre(load, name: str) -> bool:
    return isinstance(load, Force) and load.body == name and load.at is None


def _by_gravity(system: System) -> list[dict]:
    """Wrenches {body: (moment, force)} of a unit of each component of gravity."""
    masses = system.Phi[3::6]
    return [{i: (np.zeros(3), -mass * axis) for i, mass in enumerate(masses)} for axis in np.eye(3)]


def _by_constant(system: System, loads, t: Scalar, q, v, kind: str, name: str) -> list[np.ndarray]:
    """Change of inverse dynamics by the constant of a load."""
    bound = next(bound for bound in loads if bound.load.name == name)
    if isinstance(bound.load, Slipping):  # its force is proportional to the limit
        motion = kinematics(system, State(t, q, v))
        return [-generalised_forces(motion, Applied(motion, [bound])) / getattr(bound.load.element, kind)]

    def change(t, q, v, constant):
        motion = kinematics(system, State(t[0], q, v))
        load = BoundLoad(changed(bound.load, {kind: constant[0]}), bound.laws)
        forces = generalised_forces(motion, Applied(motion, [load]))
        return -forward(forces, constant, [1.0])

    written = write(change, 1, q.size, v.size, 1, name="by_constant")
    return [written.inlined([t], q, v, [getattr(bound.load, kind)])]
