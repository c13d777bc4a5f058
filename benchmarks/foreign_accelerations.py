"""Accelerations of a scene read from a MJCF file against those of MuJoCo, at random states and controls.

    M a + Jᵀ λ = f,   J a + J̇ v = 0

MuJoCo's equalities are soft; the reference takes its M, f and J, and J̇ v by differences along v, and keeps them hard.
"""

import mujoco
import numpy as np

import gauss
from gauss import rotations
from gauss.dynamics.inputs import driven_scene
from gauss.errors import GaussError
from gauss.io.guard import Source
from gauss.io.mjcf.activations import activation
from gauss.io.mjcf.actuators import actuators, controls, state_name
from gauss.io.mjcf.names import SCALAR, Named
from gauss.system import State, random_state

STATES = 3
SPREAD = 0.5  # of random coordinates where loops are closed from them, relative to those of an open tree
STEP = 1e-3  # s, of central differences
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # of them, of the order 8
DEPENDENT = 1e-10  # singular values of rows of one size, relative to the largest one: rows that repeat others
OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS", "WARMSTART")
EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)


class NotCompared(Exception):
    """MuJoCo or gauss has no accelerations at the random states."""


def deviation(path, scene: gauss.Scene) -> float:
    """Largest difference of accelerations, relative to the largest acceleration.

    NotCompared if there are none to compare, as of a scene of which nothing moves.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    for name in OFF:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    model.actuator_actearly[:] = 0  # time is continuous in gauss: it has no next step whose activation could act
    model.opt.jacobian = int(mujoco.mjtJacobian.mjJAC_DENSE)
    if not model.nv:
        raise NotCompared("nothing moves")
    scene.contacts.clear()
    scene.set_valued.clear()
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(STATES):
        ctrl = rng.normal(size=model.nu)
        named = {name if name in scene.inputs else f"actuator {name}": k for name, k in controls(model).items()}
        laws = {name: lambda t, u=ctrl[k]: u for name, k in named.items() if name in scene.inputs}
        driven = [k for name, k in named.items() if name not in scene.inputs]
        ctrl[driven] = 0.0
        system = gauss.compile_scene(driven_scene(scene, laws))
        try:
            state = _random(system, rng)
            found = gauss.solve(gauss.assemble(system, state)).qdd
        except GaussError as error:
            raise NotCompared(str(error)) from error
        ours, theirs = _compared(model, system, state, np.asarray(found), ctrl)
        worst = max(worst, float(abs(ours - theirs).max() / max(1.0, abs(theirs).max())))
    return worst


def _random(system, rng) -> State:
    """Random state that satisfies the constraints."""
    state = random_state(system, rng)
    scene = system.scene
    if not (scene.couplings or scene.relations or system.closes or len(scene.joints) > len(scene.bodies)):
        return state
    rest = system.reference
    q = rest.q + SPREAD * (state.q - rest.q) * (not system.quaternions)
    return system.projected(State(0.0, q, state.v))


def _compared(model, system, state: State, qdd: np.ndarray, ctrl: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations of gauss in MuJoCo's rates, and those of MuJoCo."""
    data = mujoco.MjData(model)
    named = Named(model, Source(None, None, {}))  # type: ignore[arg-type]  # names need no file
    ours = np.zeros(model.nv)
    for j, name in enumerate(named.joints):
        joint, place, dof = system.joint(name), model.jnt_qposadr[j], model.jnt_dofadr[j]
        q, v, a = state.q[joint.q], state.v[joint.v], qdd[joint.v]
        if named.kinds[j] in SCALAR:
            data.qpos[place] = model.qpos0[place] + q[0]
        elif named.kinds[j] == "ball":
            data.qpos[place : place + 4] = q
        else:
            Q_0 = model.qpos0[place + 3 : place + 7]
            R_0 = rotations.from_quaternion(Q_0)
            data.qpos[place : place + 3] = model.qpos0[place : place + 3] + q[:3]
            data.qpos[place + 3 : place + 7] = rotations.multiply(q[3:], Q_0)
            v, a = (np.concatenate([one[:3], R_0.T @ one[3:]]) for one in (v, a))
        data.qvel[dof : dof + len(v)], ours[dof : dof + len(v)] = v, a
    data.ctrl[:] = ctrl
    for name in set(system.scene.states) & {state_name(model, i) for i in actuators(model)}:
        i = next(i for i in actuators(model) if state_name(model, i) == name)
        acting = activation(model, i).bounded(state.v[system.joint(name).v][0])  # MuJoCo never has one beyond its range
        data.act[int(model.actuator_actadr[i])] = acting
    if not np.isfinite(ours).all():
        raise NotCompared("no accelerations")
    return ours, _accelerations(model, data)


def _accelerations(model, data) -> np.ndarray:
    mujoco.mj_forward(model, data)
    free = data.qacc_smooth.copy()
    if not model.neq:
        return free
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M) if _takes_data() else mujoco.mj_fullM(model, M, data.qM)
    moved, J, bias = mujoco.MjData(model), _rows(model, data), 0.0
    for number, weight in enumerate(WEIGHTS, start=1):
        for sign in (1, -1):
            moved.qpos[:], moved.qvel[:] = data.qpos, data.qvel
            mujoco.mj_integratePos(model, moved.qpos, data.qvel, sign * number * STEP)
            mujoco.mj_fwdPosition(model, moved)
            bias = bias + sign * weight / STEP * (_rows(model, moved) @ data.qvel)
    L = np.linalg.cholesky(M)
    scaled = np.linalg.solve(L, J.T).T  # J L⁻ᵀ: the least multipliers in the metric of M, row by row of one size
    size = np.maximum(np.linalg.norm(scaled, axis=1), np.finfo(float).tiny)
    pulled = np.linalg.lstsq(scaled / size[:, None], -(J @ free + bias) / size, rcond=DEPENDENT)[0]
    return free + np.linalg.solve(L.T, pulled)


def _rows(model, data) -> np.ndarray:
    rows = np.array(data.efc_type) == EQUALITY
    J = np.array(data.efc_J).reshape(-1, model.nv)
    if len(J) != len(rows):
        raise NotCompared("the Jacobian is sparse")
    return J[rows]


def _takes_data() -> bool:
    """Whether mj_fullM takes the data before the matrix, as from MuJoCo 4 on."""
    return "MjData" in (mujoco.mj_fullM.__doc__ or "").split("->")[0]
