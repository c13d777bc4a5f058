"""Contests of forward dynamics with loops, beside constraintDynamics, lcaba and MuJoCo."""

import mujoco
import numpy as np
import pinocchio as pin

import gauss
from benchmarks.speed.dynamics import padded
from gauss.analysis.crosscheck import random_states
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.bench.contest import OURS, Competitor, Contest, Goal, difference
from gauss.codegen import trace
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mechanism import forward_dynamics
from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.system import State, retract

CONSTRAINED, LCABA, MUJOCO = "pin.constraintDynamics", "pin.lcaba", "mj_forward"
PROXIMAL = {CONSTRAINED: (1e-12, 1e-6, 5), LCABA: (1e-12, 1e-6, 5)}  # accuracy, μ, iterations
ROUND = 64  # states
REPEATED = 16  # times that gauss does them in one call, so that neither the call nor the clock counts
DIFFERENCE = 1e-5  # s, step of the central difference that tells the accelerations in MuJoCo's coordinates


def loops(name: str, scene: gauss.Scene, goal: float) -> Contest:
    """Accelerations of a mechanism with loops in consistent states without loads, one state after another.

    Parameters
    ----------
    name : str
        What it is called.
    scene : Scene
        Loops closed by hinges in a plane or by ball joints, so that a point of contact is all that a peer needs.
    goal : float
        Times as fast as each peer.
    """
    scene.loads.clear()
    system = gauss.compile_scene(scene)
    n, states = system.n_v, list(random_states(system, ROUND, seed=0))
    kernel = trace(lambda q, v, f: forward_dynamics(system, q, v, f), system.n_q, n, n, batch=False)
    given = np.array([np.concatenate([state.q, state.v, np.zeros(n)]) for state in states]).T
    many, out = padded(np.tile(given, REPEATED)), padded(np.zeros((n, REPEATED * ROUND)))
    exact = [gauss.solve(gauss.assemble(system, state)).qdd for state in states]
    tasks, off = {OURS: Competitor(lambda: kernel(many, out), REPEATED * ROUND)}, []
    for peer in (CONSTRAINED, LCABA):
        run, error = _pinocchio(system, states, exact, peer)
        tasks[peer] = Competitor(run, ROUND)
        off.append(f"{peer} by {error:.0e}")
    run, error = _mujoco(system, states, exact)
    tasks[MUJOCO] = Competitor(run, ROUND)
    off.append(f"{MUJOCO} by {error:.0e}")
    return Contest(
        f"forward dynamics, one state, {name}",
        tasks,
        tuple(Goal(peer, goal) for peer in (CONSTRAINED, LCABA, MUJOCO)),
        difference(kernel(given).T, np.array(exact)),
        f"agreement is with the certified solution of the full problem, from which {', '.join(off)} are off",
    )


def _pinocchio(system, states, exact, method: str):
    """What evaluates all states, and the largest relative error."""
    tree = twin(system)
    closing = [system.joints[i] for i in system.structure.closures]
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for joint in closing:
        one, two = tree.parent_side(joint), tree.child_side(joint)
        place = (tree.model, one.joint, one.central, two.joint, two.central)
        models.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, *place, pin.ReferenceFrame.LOCAL))
    for model in models:
        datas.append(model.createData())
    data, settings = tree.model.createData(), pin.ProximalSettings(*PROXIMAL[method])
    if method == LCABA:
        pin.computeJointMinimalOrdering(tree.model, data, models)
        solve = pin.lcaba
    else:
        pin.initConstraintDynamics(tree.model, data, models, datas)
        solve = pin.constraintDynamics
    at = [tree.configuration(state) for state in states]
    parts = [(np.ascontiguousarray(x.q), np.ascontiguousarray(x.v), np.zeros(tree.model.nv)) for x in at]

    def run():
        for q, v, none in parts:
            solve(tree.model, data, q, v, none, models, datas, settings)

    found = [solve(tree.model, data, *given, models, datas, settings).copy() for given in parts]
    return run, max(difference(a, x.T @ e + x.bias) for a, x, e in zip(found, at, exact, strict=True))


def _mujoco(system, states, exact):
    """What evaluates all states, and the relative error in the first of them."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(system.scene))
    for name, bit in mujoco.mjtDisableBit.__members__.items():
        if name.startswith("mjDSBL_") and name not in ("mjDSBL_GRAVITY", "mjDSBL_CONSTRAINT", "mjDSBL_EQUALITY"):
            model.opt.disableflags |= int(bit)
    data, limbs = mujoco.MjData(model), [limb(system, *edge) for edge in spanning_tree(system.scene)[0]]
    parts = [mujoco_state(system, limbs, kinematics(system, state)) for state in states]

    def run():
        for qpos, qvel in parts:
            data.qpos, data.qvel = qpos, qvel
            mujoco.mj_forward(model, data)

    def rates(h):
        q = retract(system, states[0].q, h * states[0].v + h * h / 2 * exact[0])
        return mujoco_state(system, limbs, kinematics(system, State(0.0, q, states[0].v + h * exact[0])))[1]

    data.qpos, data.qvel = parts[0]
    mujoco.mj_forward(model, data)
    return run, difference(data.qacc, (rates(DIFFERENCE) - rates(-DIFFERENCE)) / (2 * DIFFERENCE))
