"""Whole-body control and inverse dynamics of legged robots on their feet, humanoids among them.

Unknown are the accelerations q̈ of base and joints, the forces f at points of the feet and the torques τ of the joints:

    M q̈ + h = Sᵀ τ + Jᵀ f,   J q̈ + J̇ q̇ = 0 at every foot,   |f_x|, |f_y| ≤ μ f_z / √2,   |τ| ≤ τ_max

and the weighted squares of the task errors are minimised (Herzog et al. 2016). Models are those of example-robot-data, read
by Pinocchio, whose recursions give M, h and J.
"""

from collections.abc import Iterator
from functools import lru_cache, partial

import numpy as np

from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.errors import FileError
from gauss.io.urdf.robots import robot

FEET = {  # frames of the feet, and half the length and width of their soles [m]; zero of a point
    "talos_reduced": (("left_sole_link", "right_sole_link"), (0.10, 0.06)),
    "icub": (("l_sole", "r_sole"), (0.06, 0.03)),
    "romeo": (("l_sole", "r_sole"), (0.08, 0.04)),
    "solo12": (("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"), (0.0, 0.0)),
    "go2": (("FL_foot", "FR_foot", "RL_foot", "RR_foot"), (0.0, 0.0)),
    "hyq_no_sensors": (("lf_foot", "rf_foot", "lh_foot", "rh_foot"), (0.0, 0.0)),
}
FRICTION = 0.7
PYRAMID = np.array([[1, 0, -1], [-1, 0, -1], [0, 1, -1], [0, -1, -1]]) * (1, 1, FRICTION / np.sqrt(2))  # within the cone
SLOW = 0.2  # rad/s, m/s
WEIGHTS = {"base": 1.0, "posture": 1e-2, "force": 1e-6, "torque": 1e-5}
"""Of the tasks: accelerations of the base and of the joints, forces [1/N²] and torques [1/(N m)²]."""


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for name in FEET:
        for seed in (0, 1):
            yield f"whole body {name} {seed}", partial(control, name, seed)
        yield f"whole body {name} lift", partial(control, name, 2, lifted=1)
        yield f"inverse dynamics {name}", partial(_inverse_dynamics, name)


def control(
    name: str, seed: int, *, lifted: int = 0, most: float = np.inf, shift: float = 0.5, kind: str = "whole body", **more
) -> SuiteInstance:
    """Whole-body control of a robot in a random pose.

    Parameters
    ----------
    name, seed : str, int
        Robot and pose.
    lifted : int
        Number of feet off the ground, the last ones.
    most : float
        Largest normal force at each point of the last foot [N].
    shift : float
        Lateral acceleration task of the base [m/s²].
    kind : str
        Class; "cones" has friction cones, the others friction pyramids.
    **more
        Other fields of the instance: its name, a sequence.
    """
    model, data, J, drift = _state(name, seed)
    M, h = data.M, data.nle
    n_v, points = model.nv, J.shape[0] // 3
    free = n_v - 6
    n = n_v + 3 * points + free
    force, torque = slice(n_v, n_v + 3 * points), slice(n_v + 3 * points, n)
    carrying = points - lifted * points // len(FEET[name][0])
    motion = np.zeros((n_v, n))
    motion[:, :n_v], motion[:, force], motion[6:, torque] = M, -J.T, -np.eye(free)
    foot = np.zeros((3 * carrying, n))
    foot[:, :n_v] = J[: 3 * carrying]
    independent = _independent_rows(J[: 3 * carrying])
    A = np.vstack([motion, foot[independent]])
    b = np.concatenate([-h, -drift[: 3 * carrying][independent]])
    weight = np.concatenate(
        [
            np.full(6, WEIGHTS["base"]),
            np.full(free, WEIGHTS["posture"]),
            np.full(3 * points, WEIGHTS["force"]),
            np.full(free, WEIGHTS["torque"]),
        ]
    )
    wanted = np.zeros(n)
    rng = np.random.default_rng(seed)
    wanted[:6] = (0.3 * shift, shift, 0.2 * shift, 0.0, 0.1, 0.0)
    wanted[6:n_v] = rng.standard_normal(free)
    block = -np.array([[0, 0, FRICTION], [1, 0, 0], [0, 1, 0]]) if kind == "cones" else PYRAMID
    G = np.zeros((len(block) * carrying, n))
    G[:, n_v : n_v + 3 * carrying] = np.kron(np.eye(carrying), block)
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    lb[force], ub[force] = np.tile([-np.inf, -np.inf, 0.0], points), np.inf
    held = slice(n_v + 3 * carrying, n_v + 3 * points)
    lb[held], ub[held] = 0.0, 0.0
    last = np.arange(points - points // len(FEET[name][0]), points)
    ub[n_v + 3 * last + 2] = np.minimum(ub[n_v + 3 * last + 2], most)
    strongest = _torques(model)
    lb[torque], ub[torque] = -strongest, strongest
    story = (
        f"Robot {name} in pose {seed} on {carrying} points of its feet, friction {FRICTION:g}: the base is to accelerate by "
        f"{shift:g} m/s² aside, joints at random; dynamics, feet, friction and torques are rows."
    )
    title = f"whole body {name} {'lift' if lifted else seed}"
    data = {"A": A, "b": b, "G": G, "h": np.zeros(G.shape[0]), "lb": lb, "ub": ub, **_names(model, points)}
    cones = (3,) * carrying if kind == "cones" else ()
    return programme(more.pop("title", title), kind, story, np.diag(weight), -weight * wanted, cones=cones, **data, **more)


def _inverse_dynamics(name: str) -> SuiteInstance:
    """Forces and torques of a given motion: least squares of torques, forces within their cones."""
    model, data, J, _ = _state(name, 3, still=True)
    n_v, points = model.nv, J.shape[0] // 3
    free, n = n_v - 6, 3 * points + n_v - 6
    A = np.zeros((n_v, n))
    A[:, : 3 * points], A[6:, 3 * points :] = J.T, np.eye(free)
    G = np.hstack([np.kron(np.eye(points), PYRAMID), np.zeros((4 * points, free))])
    weight = np.concatenate([np.full(3 * points, 2.0**-12), np.ones(free)])
    story = f"Robot {name} on {points} points of its feet: the least torques that hold it at rest, forces within friction."
    names = _names(model, points)
    names = {key: value[n_v:] for key, value in names.items()}
    return programme(
        f"inverse dynamics {name}",
        "whole body",
        story,
        np.diag(weight),
        np.zeros(n),
        A=A,
        b=data.nle,
        G=G,
        h=np.zeros(4 * points),
        **names,
    )


@lru_cache
def _state(name: str, seed: int, still: bool = False):
    """Model, its data with mass matrix and bias, Jacobian of the points of the feet, and their drift."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(robot(name)), pin.JointModelFreeFlyer())
    data, rng = model.createData(), np.random.default_rng(seed)
    span = np.concatenate([np.zeros(6), (0.02 if still else 0.15) * rng.standard_normal(model.nv - 6)])
    q = pin.integrate(model, pin.neutral(model), span)
    frames, (length, width) = FEET[name]
    missing = [frame for frame in frames if not model.existFrame(frame)]
    if missing:
        raise FileError(f"robot {name!r} has no frame {missing[0]!r}; it has {', '.join(f.name for f in model.frames)}.")
    numbers = [model.getFrameId(frame) for frame in frames]

    def rows(v):
        """Jacobian and drift of the corners of the soles; world axes."""
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        found, drifts = [], []
        corners = {(x, y, 0.0) for x in (length, -length) for y in (width, -width)}
        for number in numbers:
            R = data.oMf[number].rotation
            J = pin.getFrameJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            a = pin.getFrameClassicalAcceleration(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            omega = J[3:] @ v
            for corner in sorted(corners, reverse=True):
                arm = R @ np.array(corner)
                found.append(J[:3] - pin.skew(arm) @ J[3:])
                drifts.append(a.linear + np.cross(a.angular, arm) + np.cross(omega, np.cross(omega, arm)))
        return np.vstack(found), np.concatenate(drifts)

    J = rows(np.zeros(model.nv))[0]
    v = (0.0 if still else SLOW) * rng.standard_normal(model.nv)
    v -= np.linalg.lstsq(J, J @ v, rcond=1e-9)[0]  # feet at rest
    J, drift = rows(v)
    pin.crba(model, data, q)
    data.M[:] = np.triu(data.M) + np.triu(data.M, 1).T
    pin.nonLinearEffects(model, data, q, v)
    return model, data, J, drift


def _independent_rows(J: np.ndarray) -> np.ndarray:
    """Rows of the points of rigid feet that are independent."""
    from scipy.linalg import qr

    _, R, order = qr(J.T, mode="economic", pivoting=True)
    return np.sort(order[: int((np.abs(R.diagonal()) > 1e-9 * abs(R[0, 0])).sum())])


def _torques(model) -> np.ndarray:
    limit = np.array(model.upperEffortLimit[6:] if hasattr(model, "upperEffortLimit") else model.effortLimit[6:])
    weight = 9.81 * sum(inertia.mass for inertia in model.inertias)
    return np.where((limit > 0.0) & (limit < 1e6), limit, weight)  # of joints without a limit: weight times a metre


def _names(model, points: int) -> dict:
    base = [f"base.{axis}" for axis in ("ax", "ay", "az", "alpha_x", "alpha_y", "alpha_z")]
    joints = list(model.names)[2:]  # the first two are the world and the free base
    forces = [f"point{k}.f{axis}" for k in range(points) for axis in "xyz"]
    variables = (*base, *(f"{joint}.acceleration" for joint in joints), *forces, *(f"{joint}.torque" for joint in joints))
    units = (*("m/s²",) * 3, *("rad/s²",) * (3 + len(joints)), *("N",) * len(forces), *("N m",) * len(joints))
    return {"variables": variables, "units": units}
