"""Functions of a state agree with Pinocchio and MuJoCo, with each other, with derivatives."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.errors import SimulationError, StateError
from gauss.system import State, random_state, retract
from tests.support import mechanisms
from tests.support.state_functions import names, relative

LEAST_SQUARES = 1e-8  # of linear models of overconstrained loops, whose null space is cut off by a rank
AGREEMENT = 1e-12  # relative to the largest entry, of sums in another order
OF_STEPS = 1e-7  # of central differences, relative
STEP = 1e-5
REFERENCES = "world", "local", "local_world_aligned"
TREES = {
    "tree of all kinds": lambda: gauss.load("random_tree", n=6, seed=0),
    "balls": lambda: mechanisms.two_bodies("ball"),
    "reversed": mechanisms.three_bodies,
}
QUICK_ROBOTS = ("panda",)
ROBOTS = ("ur5", "talos", "kinova", "anymal", "hyq", "tiago", "double_pendulum", "allegro_left_hand", "solo12", "baxter")
LOOPS = {"four-bar": ("four_bar", "A"), "bricard": ("bricard", "J1"), "slider-crank": ("slider_crank", "A")}


def by_pinocchio(system, state, frame, reference):
    """The same functions by Pinocchio, in the rates and the order of gauss."""
    import pinocchio as pin

    from gauss.analysis.crosscheck.pinocchio_ import twin

    pair = twin(system)
    at, model, placed = pair.configuration(state), pair.model, system.frame(frame)
    side = pair._side(placed.body, placed.R, placed.p)
    probe = model.addFrame(pin.Frame("probe", side.joint, 0, side.central, pin.FrameType.OP_FRAME))
    data, axes = model.createData(), getattr(pin, reference.upper())
    T, turn = at.T, lambda A: np.concatenate([A[3:], A[:3]])  # noqa: E731
    slow = pair.configuration(State(0.0, retract(system, state.q, -STEP * state.v), state.v)).T
    fast = pair.configuration(State(0.0, retract(system, state.q, STEP * state.v), state.v)).T
    T_rate = (fast - slow) / (2 * STEP)
    pin.crba(model, data, at.q)
    M = np.triu(data.M) + np.triu(data.M, 1).T
    pin.computeJointJacobiansTimeVariation(model, data, at.q, at.v)
    pin.framesForwardKinematics(model, data, at.q)
    J, J_rate = (f(model, data, probe, axes).copy() for f in (pin.getFrameJacobian, pin.getFrameJacobianTimeVariation))
    C = pin.computeCoriolisMatrix(model, data, at.q, at.v).copy()
    found = {
        "mass_matrix": T.T @ M @ T,
        "gravity_forces": T.T @ pin.computeGeneralizedGravity(model, data, at.q),
        "coriolis_matrix": T.T @ (C @ T + M @ T_rate),
        "bias_forces": T.T @ pin.rnea(model, data, at.q, at.v, at.bias),
        "center_of_mass": pin.centerOfMass(model, data, at.q).copy(),
        "kinetic_energy": pin.computeKineticEnergy(model, data, at.q, at.v),
        "momentum_matrix": turn(pin.computeCentroidalMap(model, data, at.q) @ T),
        "momentum": turn(pin.computeCentroidalMomentum(model, data, at.q, at.v).vector),
        "forward_kinematics": (data.oMf[probe].rotation.copy(), data.oMf[probe].translation.copy()),
        "jacobian": turn(J @ T),
        "jacobian_rate": turn(J_rate @ T + J @ T_rate),
    }
    if any(joint.map.model.shortname() == "JointModelComposite" for joint in pair.tree_joints):
        del found["coriolis_matrix"], found["jacobian_rate"]  # Pinocchio's own C v + g is not its own rnea(q, v, 0) then
    return found, AGREEMENT if np.abs(T_rate).max() == 0.0 else OF_STEPS


def check_against_pinocchio(scene, references):
    pytest.importorskip("pinocchio")
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(0))
    frame = list(system.frames)[-1]
    for reference in references:
        found = system.evaluate(names(system), state.q, state.v, reference=reference)
        expected, of_rates = by_pinocchio(system, state, frame, reference)
        for full, value in found.items():
            name = full.partition(":")[0]
            if name in expected:
                pairs = (
                    zip(value, expected[name], strict=True) if name == "forward_kinematics" else [(value, expected[name])]
                )
                tolerance = of_rates if name in ("coriolis_matrix", "jacobian_rate") else AGREEMENT
                assert max(relative(*pair) for pair in pairs) <= tolerance, (name, reference)


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_trees_agree_with_pinocchio(name):
    check_against_pinocchio(TREES[name](), REFERENCES)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*QUICK_ROBOTS, *(pytest.param(name, marks=pytest.mark.slow) for name in ROBOTS)])
def test_robots_agree_with_pinocchio(name):
    check_against_pinocchio(gauss.load(f"robot:{name}", mimic=False), ["local"])


@pytest.mark.slow
@pytest.mark.parametrize("name", [*QUICK_ROBOTS, *(pytest.param(name, marks=pytest.mark.slow) for name in ROBOTS)])
def test_robots_agree_with_mujoco(name):
    mujoco = pytest.importorskip("mujoco")
    from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree
    from gauss.io.mjcf.write import to_mjcf

    scene = gauss.load(f"robot:{name}", mimic=False)
    system = gauss.compile_scene(scene)
    state, body = random_state(system, np.random.default_rng(0)), list(scene.bodies)[-1]
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    data = mujoco.MjData(model)
    limbs = [limb(system, *edge) for edge in spanning_tree(scene)[0]]
    at = lambda v: mujoco_state(system, limbs, kinematics(system, State(0.0, state.q, v)))  # noqa: E731
    data.qpos, data.qvel = at(state.v)
    T = np.array([at(unit)[1] for unit in np.eye(system.n_v)]).T
    mujoco.mj_forward(model, data)
    M, J = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))
    mujoco.mj_fullM(model, M, data.qM) if hasattr(data, "qM") else mujoco.mj_fullM(model, data, M)
    M = M - np.diag(model.dof_armature)
    mujoco.mj_jac(model, data, J[3:], J[:3], data.body(body).xpos, data.body(body).id)
    found = system.evaluate(
        ("mass_matrix", "bias_forces", f"forward_kinematics:{body}", f"jacobian:{body}"), state.q, state.v
    )
    rotation, position = found[f"forward_kinematics:{body}"]
    assert relative(found["mass_matrix"], T.T @ M @ T) <= AGREEMENT
    assert relative(found["bias_forces"], T.T @ data.qfrc_bias) <= AGREEMENT
    assert relative(found[f"jacobian:{body}"], J @ T) <= AGREEMENT
    assert relative(rotation, data.body(body).xmat.reshape(3, 3)) <= AGREEMENT
    assert relative(position, data.body(body).xpos) <= AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_the_terms_agree_with_each_other(name):
    system = gauss.compile_scene(TREES[name]())
    state = random_state(system, np.random.default_rng(1))
    q, v, frame = state.q, state.v, list(system.frames)[-1]
    M, C = system.mass_matrix(q), system.coriolis_matrix(q, v)
    h, g = system.bias_forces(q, v), system.gravity_forces(q)
    J, A = system.jacobian(q, frame), system.momentum_matrix(q)
    motion = kinematics(system, state)
    assert relative(C @ v + g, h) <= AGREEMENT
    assert relative(v @ M @ v / 2, system.kinetic_energy(q, v)) <= AGREEMENT
    assert relative(A @ v, system.momentum(q, v)) <= AGREEMENT
    assert relative(J @ v, [*motion.angular_velocity(frame), *motion.velocity(frame)]) <= AGREEMENT
    slow, fast = (retract(system, q, sign * STEP * v) for sign in (-1, 1))
    rate = lambda f: (f(fast) - f(slow)) / (2 * STEP)  # noqa: E731
    assert relative(C + C.T, rate(system.mass_matrix)) <= OF_STEPS
    assert relative(system.jacobian_rate(q, v, frame), rate(lambda q: system.jacobian(q, frame))) <= OF_STEPS
    assert relative(system.momentum(q, v)[3:], system.Phi[3::6].sum() * rate(system.center_of_mass)) <= OF_STEPS
    assert rate(system.potential_energy) == pytest.approx(g @ v, rel=OF_STEPS)


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_the_coriolis_matrix_has_the_symmetry_of_christoffel_symbols(name):
    """C(v) w − C(w) v = M [v, w], the bracket of rates: v × w of angular velocities about moving axes, else zero."""
    system = gauss.compile_scene(TREES[name]())
    rng = np.random.default_rng(2)
    q, v, w = random_state(system, rng).q, *rng.standard_normal((2, system.n_v))
    bracket = np.zeros(system.n_v)
    for joint in system.joints:
        if joint.pair.quaternion is not None:
            place = slice(joint.v.start + joint.pair.quaternion, joint.v.stop)
            bracket[place] = np.cross(v[place], w[place])
    torsion = system.coriolis_matrix(q, v) @ w - system.coriolis_matrix(q, w) @ v
    size = np.abs(system.coriolis_matrix(q, v) @ w).max()
    assert np.abs(torsion - system.mass_matrix(q) @ bracket).max() <= AGREEMENT * size


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_terms_for_independent_coordinates_are_those_of_the_constrained_motion(name):
    scene, joint = LOOPS[name]
    system = gauss.compile_scene(gauss.load(scene))
    start = system.initial_state()
    moved = start.q.copy()
    moved[system.joint(joint).q] += 0.2
    q = system.initial_state(moved, keep=[joint]).q
    frame, column, which = list(system.frames)[-1], system.column(joint), {"independent": (joint,)}
    N = system.null_space(q, **which)
    v = 1.5 * N[:, 0]
    _, K, _ = system.loop_constraints(q, v)
    M, C, h, g, J, J_rate = system.function(
        *("mass_matrix", "coriolis_matrix", "bias_forces", "gravity_forces", f"jacobian:{frame}", f"jacobian_rate:{frame}"),
        **which,
    )(q, v)
    acceleration = system.accelerations(State(0.0, q, v))
    projected = N.T @ (system.mass_matrix(q) @ acceleration + system.bias_forces(q, v))
    assert N[column, 0] == 1.0 and np.abs(K @ N).max() <= 1e-12
    assert relative(M, N.T @ system.mass_matrix(q) @ N) <= AGREEMENT
    assert relative(J, system.jacobian(q, frame) @ N) <= AGREEMENT
    assert np.abs(M[0] * acceleration[column] + h - projected).max() <= AGREEMENT * np.abs(h).max()
    assert relative(C[0] * 1.5 + g, h) <= 1e-11
    load = np.zeros(system.n_v)
    load[column] = 1.7  # an effort along the independent joint: constraint forces drop out of what it makes
    moved = system.accelerations(State(0.0, q, v), load)
    effort = system.function("inverse_dynamics", **which)(q, v, moved)
    assert effort == pytest.approx([1.7], abs=1e-10 * max(1.0, np.abs(h).max()))
    slow, fast = (system.projected(State(0.0, q + sign * STEP * v, v)).q for sign in (-1, 1))
    rate = lambda f: (f(fast) - f(slow)) / (2 * STEP)  # noqa: E731
    assert relative(2.0 * C, rate(lambda q: system.mass_matrix(q, **which))) <= 1e-6
    assert relative(J_rate, rate(lambda q: system.jacobian(q, frame, **which))) <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_derivatives_for_independent_coordinates_are_those_of_the_motion_on_the_constraints(name):
    """Against the linear model of the same state, and against each other: inverse dynamics undoes the accelerations."""
    scene, joint = LOOPS[name]
    system = gauss.compile_scene(gauss.load(scene))
    which, start = {"independent": (joint,)}, system.initial_state()
    N = system.null_space(start.q, **which)
    state = system.initial_state(start.q, 1.3 * N[:, 0], keep=[joint])
    by_q, by_v, by_effort = system.function("acceleration_derivatives", **which)(state.q, state.v, np.zeros(system.n_v))
    model = gauss.linearise(system, state, **which)
    scale = np.abs(model.A).max()
    assert np.abs([by_q[0, 0] - model.A[1, 0], by_v[0, 0] - model.A[1, 1]]).max() <= LEAST_SQUARES * scale
    assert relative(by_effort, np.linalg.inv(system.mass_matrix(state.q, **which))) <= AGREEMENT
    acceleration = system.accelerations(state)
    efforts = system.function("inverse_dynamics_derivatives", **which)(state.q, state.v, acceleration)
    for found, undone in zip(efforts, (by_q, by_v), strict=True):
        assert np.abs(by_effort @ found + undone).max() <= 1e-9 * scale


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_independent_rates_meet_the_loop_constraints(name):
    scene, joint = LOOPS[name]
    system = gauss.compile_scene(gauss.load(scene))
    start = system.initial_state()
    v = 1.3 * system.null_space(start.q, independent=(joint,))[:, 0]
    residual, J, bias = system.function("loop_constraints", independent=(joint,))(start.q, v)
    _, whole, rest = system.loop_constraints(start.q, v)
    assert J.shape == (len(residual), 1) and residual.shape == bias.shape
    assert np.abs(J).max() <= 1e-11 * max(1.0, np.abs(whole).max())
    assert np.abs(bias).max() <= 1e-10 * max(1.0, np.abs(rest).max())


DIFFERENTIATED = {
    "tree of all kinds": lambda: gauss.load("random_tree", n=4, seed=1),
    "damped": lambda: gauss.load("cart_pole"),
    "four-bar": lambda: gauss.load("four_bar"),
    "coupled": lambda: gauss.load("gear_pair"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DIFFERENTIATED)
def test_derivatives_agree_with_those_of_one_state(name):
    system = gauss.compile_scene(DIFFERENTIATED[name]())
    (state, *_), (load, *_) = mechanisms.consistent_states(system)
    found = system.acceleration_derivatives(state.q, state.v, load, t=state.t)
    expected = gauss.derivatives(system, state, load)
    for part, other in zip(found, (expected.q, expected.v, expected.load), strict=True):
        assert relative(part, other) <= 1e-11 or not other.any()


@pytest.mark.slow
def test_derivatives_of_inverse_dynamics_undo_those_of_the_accelerations():
    system = gauss.compile_scene(TREES["tree of all kinds"]())
    state = random_state(system, np.random.default_rng(4))
    load = np.linspace(-1.0, 1.0, system.n_v)
    by_q, by_v, by_load = system.acceleration_derivatives(state.q, state.v, load)
    efforts = system.inverse_dynamics_derivatives(state.q, state.v, system.accelerations(state, load))
    M = system.mass_matrix(state.q)
    assert relative(M @ by_load, np.eye(system.n_v)) <= 1e-10
    assert relative(-M @ by_q, efforts[0]) <= 1e-10 and relative(-M @ by_v, efforts[1]) <= 1e-10


def test_coordinates_that_determine_nothing_are_refused():
    system = gauss.compile_scene(gauss.load("slider_crank"))
    start = system.initial_state()
    with pytest.raises(StateError, match="null_space: guide"):  # at the dead centre
        system.null_space(start.q, independent="guide")
    with pytest.raises(StateError, match="q does not meet the constraints, by "):
        system.null_space(start.q + 0.1, independent="A")


def test_derivatives_of_a_joint_that_moves_no_inertia_are_refused():
    scene = gauss.Scene("rods")
    arm = scene.body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.5, 0, 0))
    rod = scene.body("rod", mass=1.0, inertia=(0.1, 0.1, 0.0))
    scene.revolute("A", "ground", arm)
    scene.revolute("B", arm, rod)
    system = gauss.compile_scene(scene)
    with pytest.raises(SimulationError, match="'B'"):
        system.acceleration_derivatives(np.zeros(2), np.zeros(2), np.zeros(2))
