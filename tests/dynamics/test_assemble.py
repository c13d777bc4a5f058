"""The compulsion against closed forms, finite differences and the reference tree."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.backends.columns import from_blocks
from gauss.dynamics.assemble import closure_rates
from gauss.dynamics.engines.certified import Assembler
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.scene import PAIRS
from gauss.system import State, random_state, retract
from tests.support import mechanisms

ROUNDING = 1e-12  # of sums of a few dozen products of numbers of order 1 to 10
CENTRAL_DIFFERENCE = 1e-7  # h² of a step 1e-5 times third derivatives, plus rounding/h


def _quasi_velocities(system, state):
    return kinematics(system, state).quasi_velocities()


@pytest.mark.slow
@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("seed", range(3))
def test_rows_hold_for_every_motion(kind, seed):
    system = gauss.compile_scene(mechanisms.two_bodies(kind, seed))
    state = random_state(system, np.random.default_rng(seed))
    compulsion = gauss.assemble(system, state)
    rows = compulsion.A @ _quasi_velocities(system, state) + compulsion.B @ state.v
    assert np.abs(rows - compulsion.C).max() <= ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("seed", range(3))
def test_right_hand_side_is_the_derivative_of_the_rows(kind, seed):
    """A a + B q̈ = D with a by central differences along a motion with constant random q̈."""
    system = gauss.compile_scene(mechanisms.two_bodies(kind, seed))
    rng = np.random.default_rng(seed)
    state = random_state(system, rng)
    qdd = rng.standard_normal(system.n_v)

    def moved(h, parts=40):
        q = state.q
        for i in range(parts):  # midpoint rule on the manifold: its error is far below that of the difference
            q = retract(system, q, (state.v + qdd * (i + 0.5) * h / parts) * h / parts)
        return _quasi_velocities(system, replace(state, q=q, v=state.v + qdd * h))

    h = 1e-5
    a = (moved(h) - moved(-h)) / (2 * h)
    compulsion = gauss.assemble(system, state)
    assert np.abs(compulsion.A @ a + compulsion.B @ qdd - compulsion.D).max() <= CENTRAL_DIFFERENCE


def test_pendulum_by_hand():
    """One rod on a hinge at angle q below the horizontal: Φ, a_free, A, B, D written out."""
    scene = gauss.Scene("pendulum", gravity=(0, -9.81, 0))
    scene.body("rod", mass=2.0, inertia=(0.1, 0.3, 0.4), com=(0.5, 0, 0))
    scene.revolute("A", "ground", "rod")
    system = gauss.compile_scene(scene)
    q, w = 0.3, 1.7
    c, s = np.cos(q), np.sin(q)
    compulsion = gauss.assemble(system, system.state([q], [w]), load=[5.0])
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    r = -0.5 * np.array([c, s, 0])  # from the centre of mass to the hinge
    r_cross = np.array([[0, 0, r[1]], [0, 0, -r[0]], [-r[1], r[0], 0]])
    assert np.allclose(compulsion.Phi, [0.1, 0.3, 0.4, 2, 2, 2], atol=0)
    assert np.allclose(compulsion.a_free, [0, 0, 0, 0, -9.81, 0], atol=ROUNDING)
    assert np.allclose(compulsion.A, np.block([[R, np.zeros((3, 3))], [-r_cross @ R, np.eye(3)]]), atol=ROUNDING)
    assert np.allclose(compulsion.B, [[0], [0], [-1], [0], [0], [0]], atol=ROUNDING)
    assert np.allclose(compulsion.D, [0, 0, 0, *(w * w * r)], atol=ROUNDING)
    assert compulsion.P == pytest.approx([5.0])
    expected = (5.0 - 2 * 9.81 * 0.5 * c) / (0.4 + 2 * 0.25)
    assert gauss.solve(compulsion).qdd == pytest.approx([expected], rel=1e-14)


def test_slider_on_turning_table_feels_coriolis():
    """A slider at distance x on a table that turns with ω: ẍ = ω² x, and the table's moment is 2 m ω ẋ x."""
    scene = gauss.Scene("turntable", gravity=(0, 0, 0))
    scene.body("table", 4.0, (1.0, 1.0, 2.0))
    scene.body("slider", 0.5, (0.01, 0.01, 0.01))
    scene.revolute("turn", "ground", "table")
    scene.prismatic("slide", "table", "slider", axis=(1, 0, 0))
    system = gauss.compile_scene(scene)
    x, omega, rate = 0.8, 3.0, 1.1
    compulsion = gauss.assemble(system, system.state([0.0, x], [omega, rate]))
    inertia = 2.0 + 0.01 + 0.5 * x * x
    expected = [-2 * 0.5 * x * omega * rate / inertia, omega**2 * x]
    assert gauss.solve(compulsion).qdd == pytest.approx(expected, rel=1e-13)
    rows = next(c.rows for c in system.structure.constraints if c.name == "slide")
    coriolis = np.array([0, 2 * omega * rate, 0])
    centripetal = np.array([-(omega**2) * x, 0, 0])
    assert np.allclose(compulsion.D[rows][3:], coriolis + centripetal, atol=ROUNDING)


def test_universal_joint_by_hand():
    """Both axes turning: D of the angular rows is (e₁ × e₂) q̇₁ q̇₂."""
    scene = gauss.Scene("cardan", gravity=(0, 0, 0))
    scene.body("cross", 1.0, (0.1, 0.2, 0.25))
    scene.universal("U", "ground", "cross", axis=(0, 0, 1), second_axis=(1, 0, 0))
    system = gauss.compile_scene(scene)
    compulsion = gauss.assemble(system, system.state([0.4, 0.7], [1.3, -0.6]))
    e1, e2 = np.array([0, 0, 1.0]), np.array([np.cos(0.4), np.sin(0.4), 0.0])
    assert np.allclose(compulsion.D[:3], np.cross(e1, e2) * 1.3 * -0.6, atol=ROUNDING)


def test_reference_tree():
    """Accelerations and all reactions of spatial-tree.json (Pinocchio aba and rnea, 13 digits)."""
    data = mechanisms.reference("spatial-tree")
    scene = gauss.Scene("tree")
    for b in data["bodies"]:
        pose = {"on": b["parent"], "position": b["frame_xyz"], "rotation": b["frame_rpy"]}
        scene.body(b["name"], b["mass"], b["principal_inertia"], b["com"], inertia_axes=b["inertia_rpy"], **pose)
        scene.joint(b["name"], b["joint"], b["parent"], b["name"], axis=b["axis_in_child"], frame=b["name"])
    system = gauss.compile_scene(scene)
    state = system.state(data["state"]["q"], data["state"]["qd"])
    solution = gauss.solve(gauss.assemble(system, state, data["state"]["drive"]))
    tolerance = 1e-12
    assert np.abs(solution.qdd - data["expected"]["qdd"]).max() <= tolerance * np.abs(data["expected"]["qdd"]).max()
    for expected, constraint in zip(data["expected"]["reactions"], system.structure.constraints, strict=True):
        moment, force = np.split(-solution.multipliers[constraint.rows], 2)
        assert np.abs(force - expected["force_on_child"]).max() <= tolerance * np.abs(expected["force_on_child"]).max()
        reference = np.array(expected["moment_on_child_at_joint"])
        assert np.abs(moment - reference).max() <= tolerance * np.abs(reference).max()


@pytest.mark.parametrize("kind", PAIRS)
def test_dense_and_sparse_are_the_same(kind):
    system = gauss.compile_scene(mechanisms.two_bodies(kind))
    compulsion = gauss.assemble(system, random_state(system, np.random.default_rng(1)))
    assert np.array_equal(compulsion.A, compulsion.A_sparse.toarray())
    assert np.array_equal(compulsion.B, compulsion.B_sparse.toarray())


def test_solution_is_the_least_compulsion():
    """Any other motion that the rows allow has a larger compulsion."""
    system = gauss.compile_scene(mechanisms.rods(4))
    rng = np.random.default_rng(3)
    state = random_state(system, rng)
    compulsion = gauss.assemble(system, state, load=rng.standard_normal(4))
    best = gauss.solve(compulsion)
    least = compulsion.value(best.a, best.qdd)
    for _ in range(20):
        qdd = best.qdd + 0.1 * rng.standard_normal(4)
        a = np.linalg.solve(compulsion.A, compulsion.D - compulsion.B @ qdd)  # a tree: A is square and regular
        assert compulsion.value(a, qdd) > least


def _with_laws():
    scene = gauss.load("four_bar")
    scene.drive("B", torque=lambda t: math.sin(3.0 * t), name="swing")
    scene.force("push", "coupler", force=lambda t, motion: -2.0 * motion.velocity("coupler"))
    return scene


COMPILED = {
    "panda": lambda: gauss.load("robot:panda"),
    "random tree": lambda: gauss.load("random_tree", n=9),
    "Cardan shaft": lambda: gauss.load("cardan"),
    "gear pair": lambda: gauss.load("gear_pair"),
    "four-bar with laws": _with_laws,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPILED)
def test_machine_code_assembles_the_same_compulsion(name):
    system = gauss.compile_scene(COMPILED[name]())
    assembler, rng = Assembler(system), np.random.default_rng(0)
    start = system.initial_state()
    for _ in range(3):
        state = State(rng.uniform(), start.q, start.v + rng.standard_normal(system.n_v))  # off the constraints in velocity
        load = rng.standard_normal(system.n_v)
        expected, (found, power) = gauss.assemble(system, state, load), assembler(state, load)
        for part in ("A", "B", "C", "D", "P", "impressed", "constraint_residual"):
            one, two = (np.asarray(getattr(compulsion, part)) for compulsion in (expected, found))
            assert np.abs(one - two).max(initial=0.0) <= 1e-13 * max(1.0, np.abs(one).max(initial=0.0)), part
        at_rest = assembler(State(state.t, state.q, np.zeros(system.n_v)))[1]
        applied = Applied(kinematics(system, state))
        assert np.allclose(power, applied.power, rtol=1e-12, atol=1e-12)
        assert not at_rest.any()  # each call returns its own


def test_sparse_matrices_of_blocks_add_what_lies_in_one_place():
    rng = np.random.default_rng(0)
    places = [((2, 3), 0, 0), ((3, 2), 2, 3), ((2, 3), 0, 0), ((1, 1), 1, 4)]
    for _ in range(2):
        entries = [(rng.standard_normal(shape), r, c) for shape, r, c in places]
        dense = np.zeros((6, 7))
        for block, r, c in entries:
            dense[r : r + block.shape[0], c : c + block.shape[1]] += block
        columns = from_blocks(entries, dense.shape)
        found = columns.csc()
        assert np.array_equal(columns.toarray(), dense) and np.array_equal(found.toarray(), dense)
        assert found.nnz == 13 and found.has_canonical_format
    assert from_blocks([], (3, 4)).csc().shape == (3, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "planetary_gears", "stewart_platform"])
def test_loop_constraints_alone_have_a_velocity_residual(name):
    """A v + B q̇ − C of all rows, with rates that meet no loop: zero in the tree."""
    system = gauss.compile_scene(gauss.load(name))
    for seed in range(3):
        state = random_state(system, np.random.default_rng(seed))
        motion, nothing = kinematics(system, state), np.zeros(system.structure.n_rows)
        compulsion = gauss.assemble(system, state).about_rest()
        _, rows, _ = compulsion.residuals(motion.quasi_velocities(), state.v, nothing)
        loops = np.concatenate([np.arange(system.structure.n_rows)[c.rows] for c in _closures(system)])
        size = ROUNDING * np.abs(state.v).max()
        assert closure_rates(motion) == pytest.approx(rows[loops], abs=size)
        assert np.abs(np.delete(rows, loops)).max(initial=0.0) <= size
        assert np.abs(rows[loops]).max() > 1e6 * size


def _closures(system):
    return [system.structure.constraints[index] for index in system.structure.closures]
