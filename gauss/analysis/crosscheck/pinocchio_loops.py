"""Accelerations of a system with loops and couplings from Pinocchio's M, nonlinear effects and frame motions.

The unknowns are all joint accelerations, x = (q̈ of the tree, q̈ of the joints that close loops):

    M x = Q + Kᵀ y,   K x = k      ⇒      x = x₀ + Z z,   (Zᵀ M Z) z = Zᵀ (Q − M x₀),   K x₀ = k,   K Z = 0

M comes from crba, Q − M x from rnea, and so the answer can be refined.

A loop joint restricts the motion of its child frame relative to its parent frame to the motion subspace of the joint. The
left side comes from the two frames on the tree, the right side from a Pinocchio model of this joint alone.
"""

import numpy as np
from scipy.linalg import block_diag

from gauss.analysis.crosscheck.pinocchio_dynamics import PinocchioInstant
from gauss.analysis.crosscheck.pinocchio_joints import forward
from gauss.errors import GaussError, extra
from gauss.rotations import cross, skew
from gauss.scene import LinearCoupling
from gauss.system import PlacedJoint, State, System

with extra():
    import pinocchio as pin

SINGULAR_VALUE_CUTOFF = 1e-9  # of rows of unit length; redundant rows of consistent states lie near 1e-13
ROW_ROUNDOFF = 1e-13  # length of a row that is zero but for rounding, relative to the longest
REFINEMENTS = 1  # removes the rounding error by the condition of Zᵀ M Z
WORLD_ALIGNED = pin.LOCAL_WORLD_ALIGNED  # motion of the origin of a frame, in world axes


def constrained_accelerations(now: PinocchioInstant, state: State) -> np.ndarray:
    """Joint accelerations q̈ (n_v,) of any system, trees included.

    GaussError if some relation is unknown here, or some motion meets no inertia.
    """
    K, k = _rows(now, state)
    lengths = np.linalg.norm(K, axis=1)
    lengths[lengths <= ROW_ROUNDOFF * lengths.max(initial=0.0)] = 1.0  # 0 = 0 but for rounding
    U, sizes, Vt = np.linalg.svd(K / lengths[:, None])
    rank = int((sizes > SINGULAR_VALUE_CUTOFF).sum())
    x = Vt[:rank].T @ ((U[:, :rank].T @ (k / lengths)) / sizes[:rank])
    Z = Vt[rank:].T
    H = Z.T @ _inertia(now) @ Z
    try:
        for _ in range(1 + REFINEMENTS):
            x = x + Z @ np.linalg.solve(H, Z.T @ _force_residual(now, x))
    except np.linalg.LinAlgError as error:
        raise GaussError(
            f"scene {now.twin.system.scene.name!r}: some motion that the constraints allow meets no inertia; "
            "give mass and inertia to the bodies that it moves."
        ) from error
    return x


def _inertia(now: PinocchioInstant) -> np.ndarray:
    """M (n_v, n_v) of the tree in the rates of gauss; joints that close loops have no inertia of their own."""
    M = pin.crba(now.twin.model, now.twin.model.createData(), now.at.q)
    M = np.triu(M) + np.triu(M, 1).T  # some versions of Pinocchio fill the upper half only
    return now.at.T.T @ M @ now.at.T


def _force_residual(now: PinocchioInstant, x: np.ndarray) -> np.ndarray:
    """Q − M x (n_v,) by inverse dynamics: the generalised constraint forces, negative."""
    model, at = now.twin.model, now.at
    return now.P - at.T.T @ pin.rnea(model, model.createData(), at.q, at.v, at.T @ x + at.bias, now.external)


def _rows(now: PinocchioInstant, state: State) -> tuple[np.ndarray, np.ndarray]:
    system = now.twin.system
    data = now.twin.model.createData()
    pin.computeJointJacobians(now.twin.model, data, now.at.q)
    pin.forwardKinematics(now.twin.model, data, now.at.q, now.at.v, now.at.bias)
    K, k = [np.zeros((0, system.n_v))], [np.zeros(0)]
    for index in system.structure.closures:
        name = system.structure.constraints[index].name
        if index < len(system.joints):
            rows, right = _loop_rows(now, data, system.joints[index], state)
        elif name in system.scene.couplings:
            coupling = system.scene.couplings[name]
            rows, right = _coupling_row(system, {coupling.driven: 1.0, coupling.driver: -coupling.ratio})
        elif isinstance(relation := system.scene.relations.get(name), LinearCoupling):
            rows, right = _coupling_row(system, dict(zip(relation.coupled, relation.coefficients, strict=True)))
        else:
            raise GaussError(
                f"constraint {name!r}: a crosscheck knows joints and couplings, not this relation; leave it out."
            )
        K.append(rows)
        k.append(right)
    return np.concatenate(K), np.concatenate(k)


def _coupling_row(system: System, terms: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Row of a sum of rates, coefficients by joint or rate."""
    row = np.zeros((1, system.n_v))
    for joint, coefficient in terms.items():
        row[0, system.column(joint)] = coefficient
    return row, np.zeros(1)


def _loop_rows(now: PinocchioInstant, data: pin.Data, joint: PlacedJoint, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Relative acceleration of the two sides of a joint = acceleration along its motion subspace, in parent axes."""
    J, bias = _relative_motion(now, data, joint)
    E, E_bias = _alone(joint, state)
    J[:, joint.v] -= E
    return J, E_bias - bias


def _relative_motion(now: PinocchioInstant, data: pin.Data, joint: PlacedJoint) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (6, n_v) and zero-acceleration bias (6,), linear first, of the child's side seen from the parent's."""
    (R, x_p, J_p, V_p, A_p), (_, x_c, J_c, V_c, A_c) = (
        _side_motion(now.twin.model, data, side) for side in (now.twin.parent_side(joint), now.twin.child_side(joint))
    )
    s, W = x_c - x_p, V_p.angular
    J = J_c - J_p
    J[:3] += skew(s) @ J_p[3:]  # the parent's side carries the point where the child's side is now
    velocity = V_c.linear - V_p.linear - cross(W, s)
    linear = A_c.linear - A_p.linear - cross(A_p.angular, s) - cross(W, cross(W, s)) - 2.0 * cross(W, velocity)
    angular = A_c.angular - A_p.angular - cross(W, V_c.angular - W)
    J = block_diag(R.T, R.T) @ J
    return J @ now.at.T, np.concatenate([R.T @ linear, R.T @ angular])


def _side_motion(model: pin.Model, data: pin.Data, side):
    """Rotation, origin, Jacobian, velocity and classical acceleration of a frame behind a joint, in world axes."""
    index, frame = side.joint, side.central
    pose = data.oMi[index] * frame
    J = pin.getFrameJacobian(model, data, index, frame, WORLD_ALIGNED).reshape(6, -1)
    velocity = pin.getFrameVelocity(model, data, index, frame, WORLD_ALIGNED)
    return (
        pose.rotation,
        pose.translation,
        J,
        velocity,
        pin.getFrameClassicalAcceleration(model, data, index, frame, WORLD_ALIGNED),
    )


def _alone(joint: PlacedJoint, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Motion subspace (6, k) and its bias (6,), linear first, from a model of the joint alone."""
    joint_map, model = forward(joint), pin.Model()
    index = model.addJoint(0, joint_map.model, pin.SE3.Identity(), joint.name)
    q, v = state.q[joint.q], state.v[joint.v]
    T, data = joint_map.T(q), model.createData()
    pin.computeJointJacobians(model, data, joint_map.configuration(q))
    pin.forwardKinematics(model, data, joint_map.configuration(q), T @ v, joint_map.bias(q, v))
    # of a model with one freedom Pinocchio returns a vector
    E = pin.getJointJacobian(model, data, index, WORLD_ALIGNED).reshape(6, -1) @ T
    bias = pin.getClassicalAcceleration(model, data, index, WORLD_ALIGNED)
    return E, np.concatenate([bias.linear, bias.angular])
