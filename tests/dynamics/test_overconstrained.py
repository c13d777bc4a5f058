"""Overconstrained spatial loops: constraints that are redundant on the constraint manifold, and independent off it."""

import numpy as np
import pytest

import gauss

ALPHA, LINK, OTHER = 0.6, 1.0, 1.3  # twist [rad] and length [m] of two links of Bennett's, length of the other two
BETA = np.arcsin(OTHER * np.sin(ALPHA) / LINK)  # their twist: Bennett's condition sin α / a = sin β / b
RATIO = np.sin((BETA + ALPHA) / 2) / np.sin((BETA - ALPHA) / 2)  # tan(θ₁/2) tan(θ₂/2), Bennett 1903
START = 0.9  # θ₁ [rad]
TIMES = np.linspace(0.0, 3.0, 31)
SHARE = 100.0  # times rtol: global error of a smooth motion of 3 s, 20 with partitioning
SAME_LINKAGE = 1e-8  # [rad], of lengths that are off by 1e-11
FIXED = 1e-9  # [rad], of 3 s in steps of 2 ms by RK4
ROUNDING = 1e-11  # what neither method goes below at rtol 1e-12
ORDER = 0.3  # below four: the next term of the error is not small at the longest step
MANIFOLD = 1e-12  # [rad], of states on the constraints


def _turn(angle, length, twist):
    c, s, C, S = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array([[c, -s * C, s * S, length * c], [s, c * C, -c * S, length * s], [0, S, C, 0], [0, 0, 0, 1.0]])


def bennett(off: float = 0.0) -> gauss.Scene:
    """Loop of four hinges, the last link being the ground, that starts with θ̇₁ = 1 rad/s under gravity.

    ``off``: displacement of the last hinge along each axis [m].
    """
    second = 2.0 * np.arctan(RATIO / np.tan(START / 2))
    frames = [np.eye(4)]
    links = ((LINK, ALPHA), (OTHER, BETA)) * 2
    for angle, (length, twist) in zip((START, second, -START, -second), links, strict=True):
        frames.append(frames[-1] @ _turn(angle, length, twist))
    assert np.abs(frames[-1] - np.eye(4)).max() < 1e-14
    scene = gauss.Scene("Bennett's linkage", gravity=(0.0, -2.0, -9.81))
    names = ("ground", "first", "second", "third", "ground")
    for k, name in enumerate(names[1:4]):
        middle = (frames[k][:3, 3] + frames[k + 1][:3, 3]) / 2
        scene.body(name, 1.0 + 0.3 * k, (0.05, 0.06, 0.07), com=(0.1, -0.05 * k, 0.08), position=tuple(middle))
    for k, frame in enumerate(frames[:4]):
        at = frame[:3, 3] + (off if k == 3 else 0.0)
        scene.revolute(f"hinge{k}", names[k], names[k + 1], at=tuple(at), axis=tuple(frame[:3, 2]))
    scene.start("hinge0", 0.0, 1.0)
    return scene


@pytest.fixture(scope="module")
def system():
    """The linkage, compiled once."""
    return gauss.compile_scene(bennett())


@pytest.fixture(scope="module")
def reference(system):
    """Motion by another treatment of the constraints: independent coordinates alone are integrated."""
    return _motion(system, 1e-13, stabilisation="partitioning")


def _motion(system, rtol, **options):
    return gauss.simulate(system, TIMES[-1], rtol=rtol, atol=rtol / 10, times=TIMES, progress=False, **options)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-12])
def test_redundant_constraints_cost_no_digits(system, reference, rtol):
    """Projected stages do what the tolerance says, though off the constraints three rows contradict the others."""
    found = _motion(system, rtol)
    assert np.abs(found.q - reference.q).max() <= max(SHARE * rtol, ROUNDING)
    energy = gauss.energy(found)
    assert np.abs(energy.balance).max() <= max(SHARE * rtol, ROUNDING) * np.max(energy.scale)


@pytest.mark.slow
def test_angles_obey_bennetts_closed_form(system):
    found = _motion(system, 1e-10)
    first, second = START + found.q[:, 0], 2.0 * np.arctan(RATIO / np.tan(START / 2)) + found.q[:, 1]
    off = np.tan(first / 2) * np.tan(second / 2) / RATIO - 1.0
    assert np.abs(off).max() <= MANIFOLD
    assert np.ptp(first) > 0.5  # it moves


def test_mobility_is_one_by_rank(system):
    mobility = gauss.mobility(system)
    assert mobility.freedoms == 1 and mobility.counted == -2


@pytest.mark.slow
def test_fixed_steps_keep_their_order(system, reference):
    """Stages of RK4 beside the constraints would find accelerations that rows contradicting each other make up."""
    steps = np.array([2e-2, 1e-2, 5e-3])
    errors = [
        np.abs(gauss.simulate(system, TIMES[-1], integrator="rk4", step=h, times=TIMES).q - reference.q).max() for h in steps
    ]
    orders = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert (orders >= 4.0 - ORDER).all()


@pytest.mark.slow
def test_a_batch_confirms_every_motion(system, reference):
    """Rows that determine the motion at the start do not at a pose that it passes, where others do."""
    q, v = (np.tile(start, (3, 1)) for start in (reference.q[0], reference.v[0]))
    found = gauss.rollout(system, q, v, integrator="rk4", step=2e-3, steps=1500, every=1500)
    assert np.abs(found.q[:, -1] - reference.q[-1]).max() <= FIXED


@pytest.mark.slow
def test_lengths_with_twelve_digits_are_moved_to_the_end(system, reference):
    """Rows that depend on each other but for round-off of the drawing leave no motion to another route on its way."""
    drawn = gauss.compile_scene(bennett(off=1e-11))
    found = _motion(drawn, 1e-10)
    assert found.stats.handed_over is None
    assert np.abs(found.q - reference.q).max() <= SAME_LINKAGE
