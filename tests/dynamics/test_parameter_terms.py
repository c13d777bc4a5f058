"""Derivatives by parameters: against scenes with other parameters, Pinocchio's regressor, batches, refusals."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, StateError
from gauss.system import random_state

EXACT = 1e-9  # relative, of central differences of polynomials of degree two, with large steps
OF_STEPS = 1e-6  # of central differences, relative
STEP = 1e-6  # m, of differences of places of joints, which leave a loop open by as much
AGREEMENT = 1e-12  # of sums in another order


def sprung_tree() -> gauss.Scene:
    scene = gauss.load("random_tree", n=4, seed=1)
    bodies = list(scene.bodies)
    scene.spring("S", bodies[0], bodies[-1], (0.1, 0.0, 0.0), (0.0, 0.2, 0.1), stiffness=20.0, damping=0.5, length=0.3)
    scene.force("F", bodies[-1], force=(1.0, -2.0, 0.5))
    return scene


def moved(scene: gauss.Scene, parameter: str, k: int, change: float) -> gauss.Scene:
    """Scene with another value of a parameter."""
    kind, _, name = parameter.partition(":")
    if kind == "gravity":
        gravity = np.array(scene.gravity)
        gravity[k] += change
        return replace(scene, gravity=tuple(gravity))
    if kind in ("mass", "com", "inertia"):
        body = scene.bodies[name]
        J, R = body.principal()
        tensor, com = R @ np.diag(J) @ R.T, np.array(body.com)
        i, j = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))[k]
        if kind == "com":
            com[k] += change
        elif kind == "inertia":
            tensor[i, j] += change
            tensor[j, i] = tensor[i, j]
        mass = body.mass + change * (kind == "mass")
        other = replace(body, mass=mass, com=tuple(com), inertia=tensor, inertia_axes=(0.0, 0.0, 0.0))
        return replace(scene, bodies={**scene.bodies, name: other})
    load = scene.loads[name]
    return replace(scene, loads={**scene.loads, name: replace(load, **{kind: getattr(load, kind) + change})})


def by_difference(scene, parameter: str, size: int, value, step: float) -> np.ndarray:
    """Central differences (n, size) of a function of a compiled scene."""
    pairs = [[value(gauss.compile_scene(moved(scene, parameter, k, sign * step))) for sign in (1, -1)] for k in range(size)]
    return np.array([(plus - minus) / (2.0 * step) for plus, minus in pairs]).T


def relative(found, expected) -> float:
    return np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300)


@pytest.mark.slow
@pytest.mark.parametrize("kind, size, step", [("mass", 1, 0.1), ("com", 3, 0.05), ("inertia", 6, 1e-3), ("gravity", 3, 1.0)])
def test_inertial_parameters_of_a_tree(kind, size, step):
    scene = sprung_tree()
    system = gauss.compile_scene(scene)
    state, a = random_state(system, np.random.default_rng(2)), np.linspace(-1.0, 1.0, system.n_v)
    for body in list(scene.bodies)[1:3]:
        parameter = kind if kind == "gravity" else f"{kind}:{body}"
        found = system.function(f"inverse_dynamics_by:{parameter}")(state.q, state.v, a)
        value = lambda other: other.function("inverse_dynamics")(state.q, state.v, a)  # noqa: E731
        assert relative(found, by_difference(scene, parameter, size, value, step)) <= EXACT
        slopes = system.parameter_derivatives(parameter)(state.q, state.v, 0.0 * a)
        own = system.forward_dynamics(state.q, state.v, 0.0 * a)
        by = system.function(f"inverse_dynamics_by:{parameter}")(state.q, state.v, own)
        assert relative(-system.mass_matrix(state.q) @ slopes, by) <= EXACT


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["stiffness:S", "damping:S", "length:S"])
def test_constants_of_loads(parameter):
    scene = sprung_tree()
    system = gauss.compile_scene(scene)
    state, a = random_state(system, np.random.default_rng(3)), np.linspace(-1.0, 1.0, system.n_v)
    found = system.function(f"inverse_dynamics_by:{parameter}")(state.q, state.v, a)
    value = lambda other: other.function("inverse_dynamics")(state.q, state.v, a)  # noqa: E731
    assert relative(found, by_difference(scene, parameter, 1, value, 0.1)) <= EXACT


def with_moved_joint(system, where: str, name: str, shift: np.ndarray):
    """System whose joint has another place in the frame of its parent or child."""
    joint = next(one for one in system.joints if one.name == name)
    field, body = ("p_parent", joint.parent) if where == "parent_at" else ("p_child", joint.child)
    axes = np.eye(3) if body < 0 else system.frames[system.structure.bodies[body]].R
    other = replace(joint, **{field: getattr(joint, field) + axes @ shift})
    joints = tuple(other if one is joint else one for one in system.joints)
    return replace(system, joints=joints, dynamics=system.mechanics.anew())


@pytest.mark.slow
@pytest.mark.parametrize("where", ["parent_at", "child_at"])
def test_lengths_of_a_tree(where):
    system = gauss.compile_scene(gauss.load("random_tree", n=4, seed=1))
    state, a = random_state(system, np.random.default_rng(4)), np.linspace(-1.0, 1.0, system.n_v)
    name, step = system.joints[2].name, 0.05

    def efforts(shift: np.ndarray) -> np.ndarray:
        return with_moved_joint(system, where, name, shift).function("inverse_dynamics")(state.q, state.v, a)

    found = system.function(f"inverse_dynamics_by:{where}:{name}")(state.q, state.v, a)
    expected = [(efforts(step * axis) - efforts(-step * axis)) / (2.0 * step) for axis in np.eye(3)]
    assert relative(found, np.array(expected).T) <= EXACT


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["child_at:A", "parent_at:B", "parent_at:C", "child_at:D"])
def test_lengths_of_a_loop_at_fixed_coordinates(parameter):
    scene = gauss.load("four_bar")
    scene.spring("S", "crank", "rocker", (0.1, 0.0, 0.0), (0.0, 0.2, 0.0), stiffness=20.0, length=0.3)
    system = gauss.compile_scene(scene)
    start, load = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
    (where, _, name), step = parameter.partition(":"), STEP

    def accelerations(shift: np.ndarray) -> np.ndarray:
        compulsion = gauss.assemble(with_moved_joint(system, where, name, shift), start, load)
        return gauss.solve(compulsion, tolerance=STEP).qdd

    found = system.parameter_derivatives(parameter)(start.q, start.v, load)
    expected = [(accelerations(step * axis) - accelerations(-step * axis)) / (2.0 * step) for axis in np.eye(3)[:2]]
    assert relative(found[:, :2], np.array(expected).T) <= OF_STEPS
    assert not found[:, 2].any()  # across the plane: the rows that it would contradict are redundant


@pytest.mark.slow
def test_lengths_of_a_loop_along_closed_linkages():
    """With the coordinates and rates that keep the loop closed: ∂q̈/∂p + ∂q̈/∂q dq/dp + ∂q̈/∂v dv/dp, the crank held."""
    system = gauss.compile_scene(gauss.load("four_bar"))
    start, load, step = system.initial_state(), np.zeros(system.n_v), 1e-5
    ends = []
    for sign in (1.0, -1.0):
        other = with_moved_joint(system, "child_at", "D", np.array([sign * step, 0.0, 0.0]))
        state = other.initial_state(start.q, start.v, keep=["A"])
        ends.append((state.q, state.v, other.forward_dynamics(state.q, state.v, load)))
    dq, dv, expected = ((plus - minus) / (2.0 * step) for plus, minus in zip(*ends, strict=True))
    by_q, by_v, _ = system.acceleration_derivatives(start.q, start.v, load)
    found = system.parameter_derivatives("child_at:D")(start.q, start.v, load)[:, 0] + by_q @ dq + by_v @ dv
    assert relative(found, expected) <= OF_STEPS


PARAMETERS_OF_LOOPS = {"mass:coupler": 1, "com:coupler": 3, "inertia:crank": 6, "stiffness:S": 1}


@pytest.mark.slow
@pytest.mark.parametrize("parameter", PARAMETERS_OF_LOOPS)
def test_parameters_of_a_loop(parameter):
    scene = gauss.load("four_bar")
    scene.joint_spring("S", list(scene.joints)[1], stiffness=3.0)
    crank = replace(scene.bodies["crank"], inertia=(0.02, 0.02, 0.02))
    scene = replace(scene, bodies={**scene.bodies, "crank": crank})
    system = gauss.compile_scene(scene)
    start, load = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
    found = system.parameter_derivatives(parameter)(start.q, start.v, load)
    value = lambda other: other.forward_dynamics(start.q, start.v, load)  # noqa: E731
    expected = by_difference(scene, parameter, PARAMETERS_OF_LOOPS[parameter], value, 1e-5)
    assert np.abs(found - expected).max() <= OF_STEPS * max(np.abs(expected).max(), 1.0)


BY_INDEPENDENT = {"A": ("mass:coupler", "com:coupler", "inertia:rocker", "gravity"), "D": ("com:rocker", "mass:crank")}


@pytest.mark.slow
@pytest.mark.parametrize("joint", BY_INDEPENDENT)
def test_parameters_for_independent_coordinates(joint):
    """Accelerations and efforts of the independent coordinate, against scenes with other parameters."""
    scene = replace(gauss.load("four_bar"), gravity=(0.3, -9.81, 0.0))
    bodies = {name: replace(one, inertia=(0.02, 0.03, 0.04)) for name, one in scene.bodies.items()}
    scene = replace(scene, bodies=bodies)
    system, which = gauss.compile_scene(scene), {"independent": (joint,)}
    start, given = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
    place = [system.column(joint)]
    for parameter in BY_INDEPENDENT[joint]:
        accelerations = lambda other: other.forward_dynamics(start.q, start.v, given)[place]  # noqa: E731
        efforts = lambda other: other.function("inverse_dynamics", **which)(start.q, start.v, given)  # noqa: E731
        found = system.parameter_derivatives(parameter, **which)(start.q, start.v, given)
        expected = by_difference(scene, parameter, found.shape[1], accelerations, 1e-5)
        assert relative(found, expected) <= OF_STEPS
        found = system.function(f"inverse_dynamics_by:{parameter}", **which)(start.q, start.v, given)
        assert relative(found, by_difference(scene, parameter, found.shape[1], efforts, 1e-5)) <= OF_STEPS


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["A", "B"])
@pytest.mark.parametrize("parameter", ["child_at:A", "parent_at:B", "parent_at:C", "child_at:D"])
def test_lengths_of_a_loop_for_independent_coordinates(joint, parameter):
    """The other coordinates and rates follow the length: against linkages that are assembled with other lengths."""
    scene = gauss.load("four_bar")
    scene.spring("S", "crank", "rocker", (0.1, 0.0, 0.0), (0.0, 0.2, 0.0), stiffness=20.0, length=0.3)
    system, (where, _, name), step = gauss.compile_scene(scene), parameter.partition(":"), 1e-5
    which, place = {"independent": (joint,)}, system.column(joint)
    start, given = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
    v = system.null_space(start.q, **which)[:, 0] * 1.3
    by_place = system.parameter_derivatives(parameter, **which)(start.q, v, given)
    of_efforts = system.function(f"inverse_dynamics_by:{parameter}", **which)(start.q, v, given)
    for axis in range(2):
        ends = []
        for sign in (1.0, -1.0):
            other = with_moved_joint(system, where, name, sign * step * np.eye(3)[axis])
            state = other.initial_state(start.q, v, keep=[joint])
            effort = other.function("inverse_dynamics", **which)(state.q, state.v, given)
            ends.append((other.forward_dynamics(state.q, state.v, given)[place], effort[0]))
        accelerations, efforts = ((plus - minus) / (2.0 * step) for plus, minus in zip(*ends, strict=True))
        assert by_place[0, axis] == pytest.approx(accelerations, rel=OF_STEPS, abs=OF_STEPS)
        assert of_efforts[0, axis] == pytest.approx(efforts, rel=OF_STEPS, abs=OF_STEPS)
    assert not by_place[:, 2].any()  # across the plane: the rows that it would contradict are redundant


@pytest.mark.slow
def test_all_coordinates_of_a_tree_are_independent():
    system = gauss.compile_scene(sprung_tree())
    state, a = random_state(system, np.random.default_rng(6)), np.linspace(-1.0, 1.0, system.n_v)
    which = {"independent": system.coordinates}
    for parameter in ("mass:" + system.structure.bodies[1], "stiffness:S", "child_at:" + system.joints[2].name):
        names = f"accelerations_by:{parameter}", f"inverse_dynamics_by:{parameter}"
        for found, expected in zip(
            system.function(*names, **which)(state.q, state.v, a, a),
            system.function(*names)(state.q, state.v, a, a),
            strict=True,
        ):
            assert relative(found, expected) <= EXACT


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["B", "D"])
@pytest.mark.parametrize("parameter", ["stiffness:S", "damping:S"])
def test_constants_of_loads_along_joints_of_a_loop(joint, parameter):
    """Of the joint that closes the loop, too: its forces act on the links of the tree."""
    scene = gauss.load("four_bar")
    scene.joint_spring("S", joint, stiffness=3.0, damping=0.2, rest=0.4)
    system = gauss.compile_scene(scene)
    start, a = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
    values = {
        system.parameter_derivatives(parameter): lambda other: other.forward_dynamics(start.q, start.v, a),
        system.function(f"inverse_dynamics_by:{parameter}"): lambda o: o.function("inverse_dynamics")(start.q, start.v, a),
    }
    for derivative, value in values.items():
        expected = by_difference(scene, parameter, 1, value, 0.1)
        assert np.abs(expected).max() > OF_STEPS
        assert relative(derivative(start.q, start.v, a), expected) <= EXACT


@pytest.mark.slow
def test_the_regressor_is_that_of_pinocchio():
    pin = pytest.importorskip("pinocchio")
    from gauss.analysis.crosscheck.pinocchio_ import twin

    system = gauss.compile_scene(gauss.load("random_tree", n=4, seed=3, kinds=("revolute",)))
    state, a = random_state(system, np.random.default_rng(5)), np.linspace(-1.0, 1.0, system.n_v)
    pair = twin(system)
    at, model = pair.configuration(state), pair.model
    Y = pin.computeJointTorqueRegressor(model, model.createData(), at.q, at.v, np.linalg.solve(at.T, a))
    expected = at.T.T @ Y @ np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])
    bodies = system.scene.bodies.values()
    names = [f"inverse_dynamics_by:{kind}:{body.name}" for body in bodies for kind in ("mass", "inertia")]
    parts, found = iter(system.function(*names)(state.q, state.v, a)), np.zeros(system.n_v)
    for body in bodies:
        J, R = body.principal()
        tensor = R @ np.diag(J) @ R.T
        found += next(parts)[:, 0] * body.mass + next(parts) @ tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert relative(found, expected) <= AGREEMENT
    assert relative(found, system.function("inverse_dynamics")(state.q, state.v, a)) <= AGREEMENT


@pytest.mark.slow
def test_batches_are_single_states():
    system = gauss.compile_scene(gauss.load("four_bar"))
    start = system.initial_state()
    f = system.parameter_derivatives("mass:coupler", "com:crank")
    many = f(np.tile(start.q, (9, 1)), np.tile(start.v, (9, 1)), np.zeros((9, system.n_v)))
    one = f(start.q, start.v, np.zeros(system.n_v))
    for rows, single in zip(many, one, strict=True):
        assert rows.shape[1:] == single.shape and relative(rows[4], single) <= AGREEMENT


@pytest.mark.parametrize(
    "parameter, error",
    [("mass:nobody", StateError), ("weight:F", ArgumentError), ("stiffness:T", StateError), ("", ArgumentError)],
)
def test_parameters_that_do_not_exist_are_refused(parameter, error):
    system = gauss.compile_scene(sprung_tree())
    with pytest.raises(error):
        system.parameter_derivatives(parameter)
    scene = gauss.load("four_bar")
    scene.distance("rope", "crank", "rocker", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), length=0.7)
    with pytest.raises(ArgumentError, match="beside relations"):
        gauss.compile_scene(scene).parameter_derivatives("child_at:B")
