"""Synthesis of four-bars against linkages that are known, Freudenstein's equation, and finite differences."""

import numpy as np
import pytest

from gauss import linkages
from gauss.errors import ArgumentError, LinkageError
from gauss.linkages import FourBarDesign
from gauss.linkages.four_bar import DIMENSIONS, of_angles
from gauss.linkages.motion_generation import _equations

ROUNDING = 1e-9  # of lengths of about one metre, through least squares
DIFFERENCES = 1e-7  # of central differences
KNOWN = np.array([0.2, -0.1, 1.3, 0.3, 0.4, 1.0, 0.8, 0.5, 0.35])  # a crank-rocker


def known(angles, mode=1):
    return FourBarDesign(
        dict(zip(DIMENSIONS, KNOWN, strict=True)), mode, np.asarray(angles, dtype=float), np.zeros(len(angles))
    )


def curve(design, angles=None):
    """Coupler points by the analysis of linkages."""
    cycle = design.linkage().cycle(design.crank_angles if angles is None else angles)
    return cycle.point("coupler", design.point).position


def rocker_angles(design):
    """Angles of the rocker by the analysis of linkages."""
    return np.angle(design.linkage().cycle(design.crank_angles).motion.links["rocker"].e)


def missed(design, outputs):
    """Errors of the outputs by the analysis of linkages."""
    return np.angle(np.exp(1j * (rocker_angles(design) + design.turned - outputs)))


@pytest.mark.parametrize("mode", [1, -1])
def test_traced_four_bars_are_those_of_the_analysis(mode):
    angles = np.linspace(0.0, 6.0, 9)
    design = known(angles, mode)
    found, slopes = of_angles(KNOWN, angles, mode)
    np.testing.assert_allclose(found[:, :2], curve(design), atol=1e-13)
    np.testing.assert_allclose(np.arctan2(found[:, 3], found[:, 2]), rocker_angles(design), atol=1e-13)
    for k in range(len(DIMENSIONS) + 1):
        step = 1e-6 * np.eye(len(DIMENSIONS) + 1)[k]
        ends = [of_angles(KNOWN + s * step[:-1], angles + s * step[-1], mode)[0] for s in (1.0, -1.0)]
        np.testing.assert_allclose(slopes[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=DIFFERENCES)


@pytest.mark.parametrize("timed", [True, False])
def test_a_coupler_curve_is_found_again(timed):
    angles = np.linspace(0.0, 2 * np.pi, 13)[:-1]
    points = curve(known(angles))
    near = KNOWN * (1.0 + 0.03 * np.random.default_rng(2).uniform(-1, 1, KNOWN.size))
    start = FourBarDesign(dict(zip(DIMENSIONS, near, strict=True)), 1, angles + 0.05, np.zeros(12))
    design = linkages.path_generation(points, start, timed=timed)
    assert design.errors.max() <= ROUNDING
    np.testing.assert_allclose(curve(design), points, atol=ROUNDING)
    assert np.linalg.norm(curve(start) - points, axis=1).max() > 1e-2


def test_nine_points_have_an_exact_four_bar():
    angles = np.array([0.0, 0.5, 1.1, 1.8, 2.4, 3.1, 3.9, 4.8, 5.6])
    points = curve(known(angles)) + 2e-3 * np.random.default_rng(4).uniform(-1, 1, (9, 2))
    assert linkages.path_generation(points, known(angles)).errors.max() <= ROUNDING


def test_three_pairs_of_angles_are_freudensteins():
    inputs, outputs = np.radians([40.0, 70.0, 100.0]), np.radians([95.0, 113.0, 135.0])
    design = linkages.function_generation(inputs, outputs)
    np.testing.assert_allclose(missed(design, outputs), 0.0, atol=ROUNDING)
    np.testing.assert_allclose(np.cos(design.crank_angles - inputs) ** 2, 1.0, atol=ROUNDING)  # a link may point backwards
    a, b, c = (design.dimensions[name] for name in ("crank", "coupler", "rocker"))
    phi, psi = design.crank_angles, rocker_angles(design)
    left = np.cos(psi) / a - np.cos(phi) / c + (a * a - b * b + c * c + 1.0) / (2 * a * c)
    np.testing.assert_allclose(left, np.cos(phi - psi), atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("count", [5, 12])
def test_a_function_is_found_again(count):
    angles = np.linspace(0.4, 2.2, count)
    outputs = rocker_angles(known(angles))
    design = linkages.function_generation(angles - 0.3, outputs + 0.2, references="free")
    np.testing.assert_allclose(missed(design, outputs + 0.2), 0.0, atol=1e-6)
    assert design.errors.max() <= 1e-6


@pytest.mark.slow
def test_more_pairs_have_less_error_than_three_precise_ones():
    """y = x² on [1, 2], over 60° of both links, with three precise pairs at Chebyshev's points."""
    inputs_of, outputs_of = (lambda x: np.radians(40 + 60 * (x - 1.0))), (lambda x: np.radians(90 + 20 * (x**2 - 1.0)))
    x, precise = np.linspace(1.0, 2.0, 21), 1.5 - 0.5 * np.cos(np.pi * np.array([1, 3, 5]) / 6)
    fitted = linkages.function_generation(inputs_of(x), outputs_of(x))
    three = linkages.function_generation(inputs_of(precise), outputs_of(precise))
    turned = three.crank_angles[0] - inputs_of(precise[0])
    whole = FourBarDesign(three.dimensions, three.mode, inputs_of(x) + turned, three.errors, three.turned)
    root = lambda error: np.sqrt(np.mean(error**2))  # noqa: E731
    np.testing.assert_allclose(np.abs(missed(fitted, outputs_of(x))), fitted.errors, atol=ROUNDING)
    assert root(fitted.errors) < root(missed(whole, outputs_of(x))) < 0.05


def poses_of(angles, turned=0.4):
    """Poses of a frame on the coupler of the known four-bar."""
    coupler = known(angles).linkage().cycle(angles).motion.links["coupler"]
    return np.column_stack([curve(known(angles)), np.angle(coupler.e) + turned])


@pytest.mark.slow
def test_five_poses_have_the_four_bar_that_made_them():
    poses = poses_of([0.3, 1.0, 1.9, 2.7, 3.6])
    designs = linkages.motion_generation(poses)
    assert all(design.errors.max() <= ROUNDING for design in designs)
    misses = [np.abs(np.array(list(design.dimensions.values())) - KNOWN).max() for design in designs]
    assert min(misses) <= 1e-6
    best = designs[int(np.argmin(misses))]
    cycle = best.linkage().cycle(best.crank_angles)
    np.testing.assert_allclose(cycle.point("coupler", best.point).position, poses[:, :2], atol=1e-7)
    turned = np.angle(cycle.motion.links["coupler"].e * np.exp(1j * (best.turned - poses[:, 2])))
    np.testing.assert_allclose(turned, 0.0, atol=1e-7)


def test_three_poses_near_given_pivots():
    poses = poses_of([0.3, 1.4, 2.5])
    B = KNOWN[:2] + 0.4 * np.array([np.cos(0.3), np.sin(0.3)])
    angle = rocker_angles(known([0.3]))[0]
    C = KNOWN[2:4] + 0.8 * np.array([np.cos(angle), np.sin(angle)])
    near = [(KNOWN[:2] + 0.03, B), (KNOWN[2:4], C - 0.05)]
    design = linkages.motion_generation(poses, near=near)[0]
    found = curve(design)
    np.testing.assert_allclose(found, poses[:, :2], atol=1e-7)


def test_equations_of_dyads_have_exact_derivatives():
    poses, rng = poses_of([0.3, 1.0, 1.9, 2.7, 3.6]), np.random.default_rng(3)
    z = rng.normal(size=4)
    slopes = [(_equations(poses, z + 1e-6 * e)[0] - _equations(poses, z - 1e-6 * e)[0]) / 2e-6 for e in np.eye(4)]
    np.testing.assert_allclose(_equations(poses, z)[1], np.array(slopes).T, atol=DIFFERENCES)


def far_start():
    design = known([0.0, 1.0])
    return FourBarDesign(design.dimensions | {"coupler": 0.01, "rocker": 0.1}, 1, design.crank_angles, design.errors)


REFUSED = {
    "NaN": (lambda: linkages.path_generation([[0.0, np.nan], [1.0, 1.0]], known([0, 1])), ArgumentError, "points"),
    "shape": (lambda: linkages.path_generation([1.0, 2.0], known([0, 1])), ArgumentError, "points"),
    "start": (lambda: linkages.path_generation(np.zeros((2, 2)), {"crank": 1.0}), ArgumentError, "FourBarDesign"),
    "angles": (lambda: linkages.path_generation(np.zeros((3, 2)), known([0, 1])), ArgumentError, "3 crank angles"),
    "open": (lambda: linkages.path_generation([[0, 0], [1, 1]], far_start()), LinkageError, "close"),
    "two pairs": (lambda: linkages.function_generation([0.0, 1.0], [0.0, 1.0]), ArgumentError, "3 or more"),
    "pairs": (lambda: linkages.function_generation([0.0, 1.0, 2.0], [0.0, 1.0, 2.0, 3.0]), ArgumentError, "outputs"),
    "references": (lambda: linkages.function_generation([0, 1, 2], [0, 1, 2], references="fre"), ArgumentError, "free"),
    "branch": (lambda: linkages.function_generation([0.1, 1.5, 3.0], [1.0, -2.0, 2.0]), LinkageError, "function_generation"),
    "poses": (lambda: linkages.motion_generation([[0, 0, 0], [1, 0, 0.1], [2, 1, 0.2]]), ArgumentError, "near"),
    "no poses": (lambda: linkages.motion_generation("poses"), ArgumentError, "poses"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_by_name(what):
    call, error, words = REFUSED[what]
    with pytest.raises(error, match=words):
        call()
