"""Motion generation: four-bars whose coupler takes given poses, from the dyads of Burmester's theory.

A point w of the coupler, in its first pose, stays on a circle about m through all poses (R_j, d_j) against the first one if

    (d_j + (R_j − 1) w) · m = d_j · R_j w + |d_j|² / 2,   j = 1 … k − 1

(McCarthy and Soh, Geometric Design of Linkages, 2nd ed., 2011, ch. 5). Five poses have up to four such dyads; two of them
make a four-bar. They are found from many starts by Gauss–Newton steps with exact derivatives.
"""

from itertools import permutations

import numpy as np

from gauss.arguments import named_arguments
from gauss.errors import ArgumentError, LinkageError
from gauss.linkages.four_bar import DIMENSIONS, FourBarDesign, numbers

STARTS, SPREAD = 400, 3.0  # starts, and their distance from the poses in sizes of these
EQUAL_SOLUTIONS = 1e-6  # share of the size, within which two solutions are one
RESIDUAL_SHARE = 1e-9  # share of the square of the size, below which an equation is met
FARTHEST = 100.0  # sizes; farther pivots are those of slides


@named_arguments
def motion_generation(poses, near=None) -> list[FourBarDesign]:
    """Four-bars whose coupler takes poses in one assembly mode.

    Parameters
    ----------
    poses : array_like, shape (k, 3)
        Poses x, y [m], angle [rad], three or more; five are met exactly by up to twelve four-bars, with more of them these
        are the least-squares ones.
    near : sequence of two pairs of points, optional
        For crank and rocker a fixed pivot and a moving one in the first pose, near those wanted; needed for fewer than five
        poses, of which there are infinitely many four-bars.

    Returns
    -------
    list of FourBarDesign
        Best first; the coupler point is the origin of the poses, ``turned`` the angle from the coupler to their frame.

    Raises
    ------
    ArgumentError
        If arguments do not fit.
    LinkageError
        If there is no such four-bar.
    """
    poses = numbers(poses, (3,), "motion_generation: poses", 3)
    size = np.ptp(poses[:, :2], axis=0).max() or 1.0
    if near is None and len(poses) < 5:
        raise ArgumentError("motion_generation: with fewer than five poses there are infinitely many four-bars; give near=.")
    if near is None:
        dyads = _dyads(poses, size)
    else:
        starts = numbers(near, (2, 2), "motion_generation: near", 2)
        dyads = [_solved(poses, start.ravel(), size)[0] for start in starts]
    designs = [_design(poses, crank, rocker, size) for crank, rocker in permutations(dyads, 2)]
    found = sorted((one for one in designs if one is not None), key=lambda design: design.errors.max())
    if not found:
        raise LinkageError(
            f"motion_generation: {len(dyads)} dyads take these poses, but no two in one assembly mode; change a pose."
        )
    return found


def _equations(poses: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (k − 1,) of the dyad z = (m, w), and their derivatives (k − 1, 4)."""
    m, w = z[:2], z[2:]
    R = [_turn(angle - poses[0, 2]) for angle in poses[1:, 2]]
    rows, slopes = [], []
    for turn, here in zip(R, poses[1:, :2], strict=True):
        d = here - turn @ poses[0, :2]  # the first pose goes over into this one by x ↦ R x + d
        arm = d + turn @ w - w
        rows.append(arm @ m - d @ (turn @ w) - d @ d / 2.0)
        slopes.append([*arm, *(m @ (turn - np.eye(2)) - d @ turn)])
    return np.array(rows), np.array(slopes)


def _turn(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _solved(poses: np.ndarray, z: np.ndarray, size: float) -> tuple[np.ndarray, float]:
    """Dyad near a start, and its largest residual in squares of the size."""
    from scipy.optimize import least_squares

    found = least_squares(
        lambda x: _equations(poses, x * size)[0] / size**2,
        z / size,
        lambda x: _equations(poses, x * size)[1] / size,
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return found.x * size, float(np.abs(found.fun).max())


def _dyads(poses: np.ndarray, size: float) -> list[np.ndarray]:
    """All dyads that are found, each once."""
    rng, center = np.random.default_rng(0), np.tile(poses[:, :2].mean(axis=0), 2)
    found = list[np.ndarray]()
    solved = [_solved(poses, center + SPREAD * size * rng.uniform(-1.0, 1.0, 4), size) for _ in range(STARTS)]
    least = min(residual for _, residual in solved)
    for z, residual in sorted(solved, key=lambda one: one[1]):
        is_finite = np.abs(z - center).max() < FARTHEST * size and np.linalg.norm(z[:2] - z[2:]) > EQUAL_SOLUTIONS * size
        is_new = all(np.abs(z - other).max() > EQUAL_SOLUTIONS * size for other in found)
        if is_finite and is_new and residual <= max(RESIDUAL_SHARE, 2.0 * least):
            found.append(z)
    return found


def _design(poses: np.ndarray, crank: np.ndarray, rocker: np.ndarray, size: float) -> FourBarDesign | None:
    """Four-bar of two dyads; None if it changes its assembly mode or has no coupler."""
    (A, B), (D, C) = crank.reshape(2, 2), rocker.reshape(2, 2)
    if min(np.linalg.norm(C - B), np.linalg.norm(D - A)) < 1e-3 * size:
        return None
    modes, angles, errors = [], [], []
    lengths = np.linalg.norm(B - A), np.linalg.norm(C - B), np.linalg.norm(C - D)
    for x, y, angle in poses:
        turn = _turn(angle - poses[0, 2])
        b, c = (np.array([x, y]) + turn @ (point - poses[0, :2]) for point in (B, C))
        modes.append(np.sign((D - b)[0] * (c - b)[1] - (D - b)[1] * (c - b)[0]))
        angles.append(np.arctan2(*(b - A)[::-1]))
        errors.append(max(abs(np.linalg.norm(b - A) - lengths[0]), abs(np.linalg.norm(c - D) - lengths[2])))
    if len(set(modes)) > 1 or not modes[0]:
        return None
    along = (C - B) / lengths[1]
    origin = poses[0, :2] - B
    point = along @ origin, along[0] * origin[1] - along[1] * origin[0]
    turned = float(poses[0, 2] - np.arctan2(along[1], along[0]))
    dimensions = dict(zip(DIMENSIONS, map(float, [*A, *D, *lengths, *point]), strict=True))
    return FourBarDesign(dimensions, int(modes[0]), np.array(angles), np.array(errors), turned)
