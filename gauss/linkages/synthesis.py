"""Dimensional synthesis of four-bars by exact derivatives: coupler curves through points, and functions of the crank angle.

Function generation starts from Freudenstein's equation, K₁ cos ψ − K₂ cos φ + K₃ = cos (φ − ψ), with K₁ = d/a, K₂ = d/c,
K₃ = (a² − b² + c² + d²) / (2 a c), which is linear in K (Freudenstein, Trans. ASME 77, 1955); both then minimise the errors
themselves (Levenberg–Marquardt in a trust region).
"""

import numpy as np

from gauss.arguments import named_arguments
from gauss.errors import ArgumentError, LinkageError
from gauss.linkages.four_bar import DIMENSIONS, FourBarDesign, numbers, of_angles

LEAST_LENGTH = 1e-3  # share of the size of the problem, below which no link is made
PRECISE = 1e-12  # of scipy's tolerances
EVALUATIONS = 2000  # most evaluations
TRIED = 24  # references from which a search is made
OTHER_BRANCH = 1.0  # error of an angle [rad], from which a point is on the other branch


@named_arguments
def path_generation(points, start: FourBarDesign, timed: bool = False) -> FourBarDesign:
    """Four-bar whose coupler point passes through points, by least squares near a start.

    Parameters
    ----------
    points : array_like, shape (k, 2)
        Points in order [m]; up to nine can be met exactly, five with prescribed angles.
    start : FourBarDesign
        Dimensions to start from, with a crank angle for each point.
    timed : bool
        Whether the differences of the crank angles are prescribed; they are found with the dimensions when not.

    Returns
    -------
    FourBarDesign
        Dimensions, crank angles, and distances from the points.

    Raises
    ------
    ArgumentError
        If arguments do not fit.
    LinkageError
        If the start does not close at its crank angles.
    """
    points = numbers(points, (2,), "path_generation: points", 2)
    _require_start(start, len(points), "path_generation")
    n, k = len(DIMENSIONS), len(points)
    size = np.ptp(points, axis=0).max()
    turns = np.ones((k, 1)) if timed else np.eye(k)

    def angles(x):
        return start.crank_angles + turns @ x[n:]

    def residuals(x):
        return (of_angles(x[:n], angles(x), start.mode)[0][:, :2] - points).ravel()

    def slopes(x):
        found = of_angles(x[:n], angles(x), start.mode)[1][:, :2]
        return np.concatenate([found[..., :n], found[..., n:] * turns[:, None, :]], axis=2).reshape(2 * k, -1)

    x = np.array([*start.dimensions.values(), *np.zeros(turns.shape[1])])
    x = _least(residuals, slopes, x, size, "path_generation")
    errors = np.linalg.norm(residuals(x).reshape(k, 2), axis=1)
    return FourBarDesign(dict(zip(DIMENSIONS, map(float, x), strict=False)), start.mode, angles(x), errors)


@named_arguments
def function_generation(inputs, outputs, references: str = "given") -> FourBarDesign:
    """Four-bar whose rocker turns as a function of its crank angle.

    Parameters
    ----------
    inputs, outputs : array_like, shape (k,)
        Angles of crank and rocker [rad], three pairs or more; three are met exactly, five where references are free.
    references : str
        "given": angles are from the line of the fixed pivots; "free": only their differences count, and what is to be
        added to each is found with the lengths.

    Returns
    -------
    FourBarDesign
        Lengths for a distance of 1 m between the fixed pivots, crank angles, and errors of the outputs.

    Raises
    ------
    ArgumentError
        If arguments do not fit.
    LinkageError
        If no four-bar has these angles, or it would have to be assembled anew between them.

    Examples
    --------
    >>> import numpy as np
    >>> from gauss import linkages
    >>> turned = np.radians([[40.0, 95.0], [70.0, 113.0], [100.0, 135.0]])
    >>> bar = linkages.function_generation(turned[:, 0], turned[:, 1])
    >>> bool(bar.errors.max() < 1e-12)
    True
    """
    inputs, outputs = (numbers(given, (), "function_generation", 3) for given in (inputs, outputs))
    if len(inputs) != len(outputs):
        raise ArgumentError(f"function_generation: {len(inputs)} inputs, but {len(outputs)} outputs.")
    if references not in ("given", "free"):
        raise ArgumentError(f"function_generation: references: expected 'given' or 'free', got {references!r}.")
    if references == "given":
        return _refined(inputs, outputs, np.zeros(2), free=False)
    grid = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    guesses = sorted(
        ((np.abs(_freudenstein(inputs + a, outputs + b)[1]).max(), a, b) for a in grid for b in grid), key=lambda one: one[0]
    )
    found = []
    for _, a, b in guesses[:TRIED]:
        try:
            found.append(_refined(inputs, outputs, np.array([a, b]), free=True))
        except LinkageError:
            continue
    if not found:
        raise LinkageError("function_generation: no four-bar with one assembly mode was found; prescribe other angles.")
    return min(found, key=lambda design: design.errors.max())


def _freudenstein(inputs, outputs) -> tuple[np.ndarray, np.ndarray]:
    """K (3,) by least squares, and residuals."""
    rows = np.stack([np.cos(outputs), -np.cos(inputs), np.ones(len(inputs))], axis=1)
    right = np.cos(inputs - outputs)
    K = np.linalg.lstsq(rows, right, rcond=None)[0]
    return K, rows @ K - right


def _refined(inputs, outputs, references: np.ndarray, free: bool) -> FourBarDesign:
    """Design near the solution of Freudenstein's equation; a negative length is a link turned by half a turn."""
    K, _ = _freudenstein(inputs + references[0], outputs + references[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        a, c = 1.0 / K[:2]
        square = a * a + c * c + 1.0 - 2.0 * a * c * K[2]
    if not np.isfinite([a, c, square]).all() or square <= 0.0 or not 1e-3 < min(abs(a), abs(c)) <= max(abs(a), abs(c)) < 1e3:
        raise LinkageError("function_generation: no four-bar has these angles: Freudenstein's equation gives no lengths.")
    half = np.where([a < 0.0, c < 0.0], np.pi, 0.0)
    lengths = np.array([abs(a), np.sqrt(square), abs(c)])
    tried = [_of_mode(inputs, outputs, references + half, lengths, mode, free) for mode in (1, -1)]
    best = min((one for one in tried if one is not None), key=lambda one: one.errors.max(), default=None)
    if best is None or best.errors.max() > OTHER_BRANCH:
        raise LinkageError(
            "function_generation: the four-bar would have to be assembled anew between the given angles"
            f"{_branches(best)}; prescribe others."
        )
    return best


def _branches(design: FourBarDesign | None) -> str:
    """Words on the pairs that are on the other branch."""
    other = [] if design is None else [int(k) for k in np.flatnonzero(design.errors > OTHER_BRANCH)]
    return f": pairs {other} are on the other branch" if other else ""


def _of_mode(inputs, outputs, references, lengths, mode: int, free: bool) -> FourBarDesign | None:
    """Least squares of the errors of the outputs in one assembly mode; None where it does not close."""
    n = len(lengths)

    def evaluated(x):
        dimensions = np.array([0.0, 0.0, 1.0, 0.0, *x[:n], 0.0, 0.0])
        a, b = x[n:] if free else references
        found, slopes = of_angles(dimensions, inputs + a, mode)
        goal = np.stack([np.cos(outputs + b), np.sin(outputs + b)], axis=1)
        return found[:, 2:], slopes[:, 2:], goal

    def residuals(x):
        e, _, goal = evaluated(x)
        return e[:, 0] * goal[:, 1] - e[:, 1] * goal[:, 0]

    def slopes(x):
        e, by, goal = evaluated(x)
        turned = by[:, 0] * goal[:, 1:] - by[:, 1] * goal[:, :1]
        columns = [turned[:, 4:7]]
        if free:
            columns += [turned[:, 9:], (e * goal).sum(axis=1)[:, None]]
        return np.concatenate(columns, axis=1)

    x = np.concatenate([lengths, references]) if free else lengths
    if not np.isfinite(residuals(x)).all():
        return None
    x = _least(residuals, slopes, x, 1.0, "function_generation")
    e, _, goal = evaluated(x)
    errors = np.abs(np.arctan2(e[:, 0] * goal[:, 1] - e[:, 1] * goal[:, 0], (e * goal).sum(axis=1)))
    a, b = x[n:] if free else references
    dimensions = dict(zip(DIMENSIONS, [0.0, 0.0, 1.0, 0.0, *map(float, x[:n]), 0.0, 0.0], strict=True))
    return FourBarDesign(dimensions, mode, inputs + a, errors, -float(b))


def _least(residuals, slopes, x: np.ndarray, size: float, what: str) -> np.ndarray:
    """Least squares within positive lengths."""
    from scipy.optimize import least_squares

    if not np.isfinite(residuals(x)).all():
        raise LinkageError(f"{what}: the start does not close at its crank angles; give other dimensions or angles.")
    low = np.full(x.size, -np.inf)
    lengths = range(4, 7) if x.size > len(DIMENSIONS) else range(3)
    low[list(lengths)] = LEAST_LENGTH * size
    found = least_squares(
        residuals,
        np.maximum(x, low),
        slopes,
        bounds=(low, np.inf),
        ftol=PRECISE,
        xtol=PRECISE,
        gtol=PRECISE * size,
        max_nfev=EVALUATIONS,
    )
    return found.x


def _require_start(start, count: int, what: str):
    if not isinstance(start, FourBarDesign) or tuple(start.dimensions) != DIMENSIONS:
        raise ArgumentError(f"{what}: start: expected a FourBarDesign with dimensions {', '.join(DIMENSIONS)}.")
    if len(start.crank_angles) != count:
        raise ArgumentError(
            f"{what}: start: expected {count} crank angles, one for each point, got {len(start.crank_angles)}."
        )
