"""Optimality residuals of an answer, and proofs of verdicts, in twice the precision.

Every residual is relative to the sum of the absolute values of its own terms, row by row, so that no choice of units
matters. An unknown that is zero counts as large as it is without constraints, |q_j| / P_jj, or as a small share of the
largest ½ P_kk x_k².
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.bench.suite.doubled import Doubled, product, taken, wide, zeros
from gauss.bench.suite.instance import SuiteInstance

LEAST_SIZE = 1e-300  # keeps 0/0 from being asked
SHARE = 1e-6  # of the largest root of P_kk x_k²: zeros that rows leave are noise of about 1e-32 of it


class Residuals(NamedTuple):
    """Relative residuals of stationarity, of the rows and bounds, of the signs of multipliers, and of complementarity."""

    stationarity: float
    primal: float
    dual: float
    complementarity: float


def residuals(instance: SuiteInstance, x, y, z, z_box) -> Residuals:
    """Residuals of the conditions of Karush, Kuhn and Tucker, or of Coulomb's law.

    Parameters
    ----------
    instance : SuiteInstance
        The programme.
    x, y, z, z_box : Doubled or ndarray, shape (n,), (m,), (s,), (n,)
        The answer.
    """
    x, y, z, z_box = (wide(part) for part in (x, y, z, z_box))
    size = sizes(instance, x.hi)
    z_box = z_box * (np.isfinite(instance.lb) | np.isfinite(instance.ub)).astype(float)  # no bound, no multiplier
    pull = product(instance.A.T, y) + product(instance.G.T, z) + z_box
    rates = product(instance.P, x) + instance.q
    terms = abs(instance.P) @ size + np.abs(instance.q) + abs(instance.A.T) @ np.abs(y.hi) + abs(instance.G.T) @ np.abs(z.hi)
    rates, terms = _with_sliding(instance, rates, terms)
    stationarity = _largest(abs(rates + pull), terms)
    primal = _largest(abs(product(instance.A, x) - instance.b), abs(instance.A) @ size + np.abs(instance.b))
    rows, right = instance.plain_rows()
    reach = abs(rows) @ size + np.abs(right)
    slack = (right - product(rows, x)).rounded()
    plain = plain_multipliers(instance, z.rounded(), z_box.rounded())
    primal = max(primal, _largest(Doubled(np.maximum(-slack, 0.0)), reach))
    most = largest_multiplier(instance, plain, terms)
    dual = float(np.maximum(-plain, 0.0).max(initial=0.0) / most)
    both = np.minimum(np.abs(slack) / np.maximum(reach, LEAST_SIZE), np.abs(plain) / most)
    found = Residuals(stationarity, primal, dual, float(both.max(initial=0.0)))
    return Residuals(*map(max, found, _of_cones(instance, x, z, size, terms)))


def certificate_residual(instance: SuiteInstance, y, z, z_box) -> tuple[float, float]:
    """Residual of a Farkas certificate, and how much below zero it adds the right-hand sides up, both relative."""
    y, z, z_box = (wide(part) for part in (y, z, z_box))
    pull = product(instance.A.T, y) + product(instance.G.T, z) + z_box
    least = SHARE * max(np.abs(part.hi).max(initial=0.0) for part in (y, z, z_box))
    sizes_of = (np.maximum(np.abs(part.hi), least) for part in (y, z))
    terms = sum((abs(M.T) @ size for M, size in zip((instance.A, instance.G), sizes_of, strict=True)), np.abs(z_box.hi))
    plain = plain_multipliers(instance, z.rounded(), z_box.rounded())
    right = np.concatenate([instance.b, instance.plain_rows()[1]])
    all_multipliers = np.concatenate([y.rounded(), plain])
    negative = np.maximum(-plain, 0.0).max(initial=0.0) / max(np.abs(all_multipliers).max(initial=0.0), LEAST_SIZE)
    value, magnitude = right @ all_multipliers, np.abs(right) @ np.abs(all_multipliers)
    return max(_largest(abs(pull), terms), float(negative)), float(-value / max(magnitude, LEAST_SIZE))


def ray_residual(instance: SuiteInstance, ray) -> tuple[float, float]:
    """Residual of a ray of descent (it bends nothing, keeps all rows), and how steep it is, both relative."""
    ray = wide(ray)
    size, (rows, _) = np.abs(ray.hi), instance.plain_rows()
    bent = _largest(abs(product(instance.P, ray)), abs(instance.P) @ size)
    held = _largest(abs(product(instance.A, ray)), abs(instance.A) @ size)
    crossed = _largest(Doubled(np.maximum(product(rows, ray).rounded(), 0.0)), abs(rows) @ size)
    return max(bent, held, crossed), float(-(instance.q @ ray.hi) / max(np.abs(instance.q) @ size, LEAST_SIZE))


def plain_multipliers(instance: SuiteInstance, z: np.ndarray, z_box: np.ndarray) -> np.ndarray:
    """Multipliers of :meth:`SuiteInstance.plain_rows`; one at a bound that is not there shows as negative at the other."""
    up, down = np.isfinite(instance.ub), np.isfinite(instance.lb)
    upper = np.where(down, np.maximum(z_box, 0.0), z_box)[up]
    lower = np.where(up, np.maximum(-z_box, 0.0), -z_box)[down]
    return np.concatenate([z[: instance.orthant], upper, lower])


def sizes(instance: SuiteInstance, x: np.ndarray) -> np.ndarray:
    """Scale of each unknown (n,) by which the terms of a row are weighed."""
    weight = instance.P.diagonal()
    weight = np.where(weight > 0.0, weight, np.inf)
    found = np.maximum(np.abs(x), np.abs(instance.q) / weight)
    share = SHARE * np.sqrt((np.where(np.isfinite(weight), weight, 0.0) * found**2).max(initial=0.0))
    return np.maximum(found, share / np.sqrt(weight))


def largest_multiplier(instance: SuiteInstance, z: np.ndarray, terms: np.ndarray) -> float:
    """Size that multipliers are compared with: that of the largest, or a small share of what stationarity adds up."""
    largest = np.abs(instance.G.data).max(initial=0.0) or 1.0
    return max(float(np.abs(z).max(initial=0.0)), SHARE * float(terms.max(initial=0.0)) / largest, LEAST_SIZE)


def _with_sliding(instance: SuiteInstance, u: Doubled, terms: np.ndarray) -> tuple[Doubled, np.ndarray]:
    """Velocities with μ |u_t| added to the normal ones, and their sizes."""
    if not instance.friction.size:
        return u, terms
    normal, speed = np.arange(0, u.hi.size, 3), speeds(u)
    added = zeros(u.hi.size)
    slide = speed * instance.friction
    added.hi[normal], added.lo[normal] = slide.hi, slide.lo
    terms = terms.copy()
    terms[normal] += instance.friction * np.hypot(terms[normal + 1], terms[normal + 2])
    return u + added, terms


def speeds(u: Doubled) -> Doubled:
    """Lengths |u_t| of the tangential parts of vectors of three, normal first."""
    one, two = taken(u, slice(1, None, 3)), taken(u, slice(2, None, 3))
    return (one * one + two * two) ** 0.5


def _of_cones(instance: SuiteInstance, x: Doubled, z: Doubled, size: np.ndarray, terms: np.ndarray) -> Residuals:
    """Residuals of the cones: s and z within them, and sᵀ z = 0."""
    worst = Residuals(0.0, 0.0, 0.0, 0.0)
    if not instance.cones:
        return worst
    most = largest_multiplier(instance, z.hi[instance.orthant :], terms)
    slack = instance.h - product(instance.G, x)
    reach = abs(sparse.csr_array(instance.G)) @ size + np.abs(instance.h)
    for block in instance.blocks:
        s, w = taken(slack, block), taken(z, block)
        scale = max(reach[block].max(), LEAST_SIZE)
        both = sums_of(s * w)
        found = (0.0, _outside(s) / scale, _outside(w) / most, abs(both) / (scale * most))
        worst = Residuals(*map(max, worst, found))
    return worst


def sums_of(terms: Doubled) -> float:
    """Sum of a doubled vector, rounded."""
    total = Doubled(0.0)
    for hi, lo in zip(terms.hi, terms.lo, strict=True):
        total = total + Doubled(hi, lo)
    return float(total.rounded())


def _outside(s: Doubled) -> float:
    """Distance of a vector from the second-order cone."""
    square = Doubled(0.0)
    for hi, lo in zip(s.hi[1:], s.lo[1:], strict=True):
        square = square + Doubled(hi, lo) * Doubled(hi, lo)
    return max(float((square**0.5 - Doubled(s.hi[0], s.lo[0])).rounded()), 0.0)


def _largest(part: Doubled, size: np.ndarray) -> float:
    return float((np.abs(part.rounded()) / np.maximum(size, LEAST_SIZE)).max(initial=0.0))
