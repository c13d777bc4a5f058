"""Accelerations and reactions against Pinocchio: robots, and random trees of all nine kinds of joints."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.analysis.crosscheck import random_states
from gauss.analysis.crosscheck.comparison import relative
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.analysis.crosscheck.pinocchio_dynamics import (
    articulated_accelerations,
    energies,
    instant,
    reactions,
    refined_accelerations,
)
from gauss.analysis.crosscheck.pinocchio_loops import constrained_accelerations
from gauss.backends import make
from gauss.backends.closure import Factor
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.io.urdf.robots import robot
from gauss.rotations import cross, from_quaternion, skew
from gauss.scene import PAIRS
from gauss.system import random_state
from tests.support import mechanisms

pytestmark = pytest.mark.slow

STATES = 100
BACKENDS = ("recursion", "kkt", "schur", "nullspace", "sparse")
ACCELERATION = 1e-12  # relative: rounding of both sides
REACTION = 1e-9  # relative, joint by joint
SHORT = 1e-3  # m: a moment is not judged more finely than what the joint's force makes on this lever
ROUNDING = 1e-13  # relative, against an answer in extended precision
KNOWN_LOSS = 1e-9  # relative, of aba alone there: up to 3e-10 was seen

ROBOTS = {
    "panda": lambda: gauss.load("robot:panda", mimic=False),
    "ur5": lambda: gauss.load("robot:ur5", mimic=False),
    "talos": lambda: gauss.load("robot:talos", mimic=False),
    "talos, free": lambda: gauss.load("robot:talos", root="free", mimic=False),
    "anymal, free": lambda: gauss.load("robot:anymal", root="free", mimic=False),
}
SIZES = (1, 2, 3, 5, 8, 13, 21, 40)


def random_tree(size: int, seed: int, kinds=tuple(PAIRS), spread: float = 1.0) -> gauss.Scene:
    """Tree of random bodies in random places; every third joint is passed by the tree from child to parent.

    With a small ``spread`` the mass of a body is close to its centre of mass, far from the joints.
    """
    rng = np.random.default_rng(seed)
    scene, bodies = gauss.Scene(f"tree {size}", gravity=rng.normal(size=3) * 5), ["ground"]
    offset = rng.integers(len(kinds))
    for i in range(size):
        inner, name, kind = bodies[-rng.integers(1, min(4, i + 2))], f"body{i}", kinds[(i + offset) % len(kinds)]
        scene.body(
            name,
            mass=rng.uniform(0.2, 2.0),
            inertia=spread**2 * np.array(mechanisms.inertia(rng)),
            com=0.2 * rng.normal(size=3),
            inertia_axes=rng.normal(size=3),
            on=inner,
            position=0.4 * rng.normal(size=3),
            rotation=rng.normal(size=3),
        )
        axes = {"rotation" if kind in ("ball", "free", "fixed") else "axis": rng.normal(size=3)}
        pitch = {"pitch": 0.2} if kind == "screw" else {}
        parent, child = (inner, name) if rng.random() < 2 / 3 else (name, inner)
        scene.joint(f"joint{i}", kind, parent, child, at=0.3 * rng.normal(size=3), frame=name, **axes, **pitch)
        bodies.append(name)
    return scene


def instants(system, seed=0, states=STATES):
    """Compulsion and Pinocchio's view of it, state by state."""
    model, rng = twin(system), np.random.default_rng(seed)
    for state in random_states(system, states, seed):
        motion = kinematics(system, state)
        applied, load = Applied(motion), rng.standard_normal(system.n_v)
        yield state, assemble_motion(motion, applied, load), instant(model, motion, applied, load)


def check(system, pinocchio_accelerations):
    """Accelerations and reactions of all backends in all states."""
    backends = [make(name) for name in BACKENDS]
    for _, compulsion, now in instants(system):
        qdd = pinocchio_accelerations(now)
        force, moment = reactions(now, qdd)
        for backend in backends:
            answer = backend(compulsion)
            assert answer.found, f"{backend.name}: {answer.message}"
            assert relative(answer.qdd, qdd) <= ACCELERATION, backend.name
            check_reactions(system, answer.multipliers, force, moment)


def check_reactions(system, multipliers, forces, moments):
    ours = -multipliers.reshape(-1, 6)
    for joint, row, force, moment in zip(system.joints, ours, forces, moments, strict=True):
        assert relative(row[3:], force, np.linalg.norm(moment)) <= REACTION, joint.name
        assert relative(row[:3], moment, SHORT * np.linalg.norm(force)) <= REACTION, joint.name


@pytest.mark.peer
@pytest.mark.parametrize("name", ROBOTS)
def test_robots(name):
    check(gauss.compile_scene(ROBOTS[name]()), articulated_accelerations)


@pytest.mark.peer
@pytest.mark.parametrize("name", ["panda", "ur5", "talos"])
def test_robots_as_pinocchio_reads_them(name):
    """The model that Pinocchio makes of the file moves like the one that is built from the scene."""
    system, model = gauss.compile_scene(ROBOTS[name]()), pin.buildModelFromUrdf(str(robot(name)))
    order = [system.joint(joint).v.start for joint in list(model.names)[1:]]
    for state, compulsion, now in instants(system, states=10):
        q = np.concatenate(
            [
                [x] if size == 1 else [np.cos(x), np.sin(x)]
                for x, size in zip(state.q[order], list(model.nqs)[1:], strict=True)
            ]
        )
        qdd = pin.aba(model, model.createData(), q, state.v[order], compulsion.P[order])
        assert relative(qdd, articulated_accelerations(now)[order]) <= ACCELERATION


@pytest.mark.peer
@pytest.mark.parametrize("size", SIZES)
def test_random_trees(size):
    check(gauss.compile_scene(random_tree(size, seed=size)), articulated_accelerations)


@pytest.mark.peer
@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="needs an extended precision that this machine lacks")
@pytest.mark.parametrize("kinds", [("ball", "revolute"), ("free", "revolute"), tuple(PAIRS)], ids="-".join)
def test_beyond_double(kinds):
    """Where small inertias sit far from the joints, ``aba`` loses digits; gauss, and ``aba`` refined by ``rnea``, do not.

    The judge is an answer in extended precision.
    """
    system, worst = gauss.compile_scene(random_tree(40, 4, kinds, spread=0.1)), 0.0
    for state, compulsion, now in instants(system, states=5):
        exact = extended_accelerations(system, state, compulsion.P)
        assert relative(make("recursion")(compulsion).qdd, exact) <= ROUNDING
        assert relative(refined_accelerations(now), exact) <= ROUNDING
        worst = max(worst, relative(articulated_accelerations(now), exact))
    print(worst)
    assert worst <= KNOWN_LOSS


def extended_accelerations(system, state, load) -> np.ndarray:
    """Joint accelerations from rows and residuals in extended precision, refined with a factorisation in double."""

    def exact(R):
        """Rotation nearest to R, orthogonal in extended precision."""
        R = R.astype(np.longdouble)
        for _ in range(3):
            R = R @ (3 * np.eye(3) - R.T @ R) / 2
        return R

    def placed(joint):
        points = {key: getattr(joint, key).astype(np.longdouble) for key in ("p_parent", "p_child")}
        return replace(joint, R_parent=exact(joint.R_parent), R_child=exact(joint.R_child), **points)

    def numbers(blocks):
        return tuple(tuple(block.astype(float) for block in row) for row in blocks)

    q = state.q.astype(np.longdouble)
    for joint in system.joints:
        if joint.pair.quaternion is not None:
            Q = q[joint.q.start + joint.pair.quaternion : joint.q.stop]
            Q /= np.sqrt(Q @ Q)
    long = replace(system, joints=tuple(map(placed, system.joints)), Phi=system.Phi.astype(np.longdouble))
    motion = kinematics(long, replace(state, q=q, v=state.v.astype(np.longdouble)))
    compulsion = assemble_motion(motion, Applied(motion), load)
    factor = Factor(
        replace(
            compulsion,
            Phi=system.Phi,
            A_blocks=numbers(compulsion.A_blocks),
            B_blocks=numbers(compulsion.B_blocks),
        )
    )
    answer = [np.zeros(size, np.longdouble) for size in (system.Phi.size, system.n_v, compulsion.D.size)]
    for _ in range(10):
        residuals = [part.astype(float) for part in compulsion.residuals(*answer)]
        answer = [part - step for part, step in zip(answer, factor.solve(*residuals), strict=False)]
    return answer[1]


@pytest.mark.peer
@pytest.mark.parametrize("size", [3, 40])
def test_null_space_and_energies(size):
    """The route for loops agrees with the recursion on trees, too; energies agree."""
    system = gauss.compile_scene(random_tree(size, seed=size))
    for state, compulsion, now in instants(system, states=10):
        assert relative(make("recursion")(compulsion).qdd, constrained_accelerations(now, state)) <= ACCELERATION
        v = kinematics(system, state).quasi_velocities()
        assert energies(now)[0] == pytest.approx(0.5 * v @ (system.Phi * v), rel=ACCELERATION)


# A joint with parent and child swapped is the inverse motion: q̃ = inverse(q) and ṽ = T v, with q̃ as in the scene.

S = np.array([[0.0, -1.0], [1.0, 0.0]])  # quarter turn of the plane


def _plane(q):
    return np.array([[np.cos(q[2]), -np.sin(q[2])], [np.sin(q[2]), np.cos(q[2])]])


def _conjugate(Q):
    return Q * np.array([1, -1, -1, -1])


def _planar_rates(q):
    R = _plane(q)
    return np.block([[-R.T, (S @ R.T @ q[:2])[:, None]], [np.zeros((1, 2)), -np.ones((1, 1))]])


def _free_rates(q):
    R = from_quaternion(q[3:])
    return np.block([[-R.T, -skew(R.T @ q[:3])], [np.zeros((3, 3)), -R]])


INVERSE = {kind: (lambda q: -q, lambda q: -np.eye(len(q))) for kind in PAIRS} | {
    "universal": (lambda q: -q[::-1], lambda q: -np.eye(2)[::-1]),
    "planar": (lambda q: np.array([*(-_plane(q).T @ q[:2]), -q[2]]), _planar_rates),
    "ball": (_conjugate, lambda q: -from_quaternion(q)),
    "free": (lambda q: np.array([*(-from_quaternion(q[3:]).T @ q[:3]), *_conjugate(q[3:])]), _free_rates),
}


def swappable(kind: str, swapped: bool) -> gauss.Scene:
    """Arm of three bodies whose middle joint goes from a to b, or from b to a."""
    rng = np.random.default_rng(7)
    scene = gauss.Scene(f"arm with {kind}")
    for name in "abc":
        scene.body(name, rng.uniform(0.5, 2.0), mechanisms.inertia(rng), com=rng.normal(size=3), rotation=rng.normal(size=3))
    scene.revolute("A", "ground", "a", at=rng.normal(size=3), axis=rng.normal(size=3))
    at, first, rotation = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    second = np.cross(first, rng.normal(size=3))
    axes = {"axis": first}
    if kind in ("ball", "free", "fixed"):
        axes = {"rotation": rotation}
    elif kind == "universal":
        axes = {"axis": second, "second_axis": first} if swapped else {"axis": first, "second_axis": second}
    pitch = {"pitch": 0.3} if kind == "screw" else {}
    scene.joint("J", kind, *("ba" if swapped else "ab"), at=at, **axes, **pitch)
    scene.ball("C", "b", "c", at=rng.normal(size=3))
    return scene


@pytest.mark.parametrize("kind", PAIRS)
def test_swapped_joint(kind):
    """Parent and child swapped: the same accelerations of all bodies, the opposite reaction at the swapped joint."""
    one, two = (gauss.compile_scene(swappable(kind, swapped)) for swapped in (False, True))
    inverse, rates = INVERSE[kind]
    J = one.joint("J")
    rng = np.random.default_rng(8)
    for _ in range(10):
        state, load = random_state(one, rng), rng.standard_normal(one.n_v)
        q, v, other_load, T = state.q.copy(), state.v.copy(), load.copy(), rates(state.q[J.q])
        q[J.q], v[J.v] = inverse(state.q[J.q]), T @ state.v[J.v]
        other_load[J.v] = np.linalg.solve(T.T, load[J.v])  # the same power
        motions = kinematics(one, state), kinematics(two, two.state(q, v))
        solutions = [
            gauss.solve(assemble_motion(motion, Applied(motion), effort))
            for motion, effort in zip(motions, (load, other_load), strict=True)
        ]
        assert relative(solutions[1].a, solutions[0].a) <= ACCELERATION
        (M, F), (M_swapped, F_swapped) = (-solution.multipliers.reshape(-1, 6)[1].reshape(2, 3) for solution in solutions)
        shift = motions[0].joints[1].P - motions[1].joints[1].P
        assert relative(F_swapped, -F) <= REACTION
        assert relative(M_swapped, -(M + cross(shift, F))) <= REACTION
