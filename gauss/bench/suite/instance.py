"""An instance of the suite: a quadratic programme of mechanics with all that is known about it.

    ½ xᵀ P x + qᵀ x → min   subject to   A x = b,   h − G x ∈ K,   lb ≤ x ≤ ub

K is the positive orthant, but for the last rows of G, which may form second-order cones Q = {s : s₀ ≥ |s₁|}. With
multipliers y, z ∈ K and z_box the answer is where P x + q + Aᵀ y + Gᵀ z + z_box = 0 (positive z_box at upper bounds, as
in qpsolvers).

Friction by Coulomb's law is the same with one term more, and the minimum of nothing: x are forces (normal first), u = P x
+ q the velocities that they leave, and μ |u_t| is added to each normal velocity (De Saxcé, Feng 1998), so that u_n ≥ 0.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from gauss.bench.suite.doubled import zeros
from gauss.errors import BackendError
from gauss.linkages.doubled import Doubled

SOLVED, INFEASIBLE, UNBOUNDED = "solved", "infeasible", "unbounded"


@dataclass(frozen=True, eq=False)
class SuiteReference:
    """Solution to far more digits than a double holds, or the proof that there is none."""

    # x, y, z, z_box: solution and multipliers. Of an infeasible instance the multipliers are a Farkas certificate: they add
    # up its rows to 0 ≤ something negative. Of an unbounded one x is a feasible point, and ``ray`` leads downhill for ever.
    x: Doubled
    y: Doubled
    z: Doubled
    z_box: Doubled
    # active: rows of G that hold with equality, of a cone its first row
    active: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    active_bounds: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))  # variables at a bound
    residual: float = 0.0  # largest of :func:`gauss.bench.suite.optimality.residuals`, relative
    # digits: digits of x that are known; fewer than ten where rows contradict each other by rounding and are near dependent
    digits: float = 0.0
    # contradiction: residual of the rows that remains, relative: redundant rows that were rounded contradict each other by
    # so much
    contradiction: float = 0.0
    # unique: whether the multipliers are: active rows are independent. Otherwise those here are one choice of many.
    unique: bool = True
    # ray (n,): direction of descent without end; empty if there is none
    ray: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class SuiteInstance:
    """One programme: data, meaning, verdict and reference."""

    # name, kind, story: its name, its class, and what it is and what is hard about it
    name: str
    kind: str
    story: str
    # P, A, G (n, n), (m, n), (s, n): Hessian (both triangles), equality rows, inequality rows
    P: sparse.csc_matrix
    # q, b, h, lb, ub (n,), (m,), (s,), (n,), (n,): linear term, right-hand sides and bounds, ±inf where there is none
    q: np.ndarray
    A: sparse.csc_matrix
    b: np.ndarray
    G: sparse.csc_matrix
    h: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    # variables, units: names of the variables and their units
    variables: tuple[str, ...]
    units: tuple[str, ...]
    cones: tuple[int, ...] = ()  # sizes of the second-order cones that the last rows of G form
    # friction (c,): coefficients of friction of a complementarity problem, one a cone of three rows; empty if there is none
    friction: np.ndarray = field(default_factory=lambda: np.zeros(0))
    # stages: of optimal control: number of steps, states and inputs of a step, in this order; empty if there are none
    stages: tuple[int, ...] = ()
    # sequence: name of the sequence that the instance is a step of, in the order of the names; empty if it stands alone
    sequence: str = ""
    verdict: str = SOLVED  # "solved", "infeasible" or "unbounded"
    reference: SuiteReference | None = None  # what is right

    def __post_init__(self):
        """Refuse names and units that are not one a variable; BackendError if their numbers differ."""
        sizes = {"variables": len(self.variables), "units": len(self.units), "lb": self.lb.size, "ub": self.ub.size}
        wrong = [f"{size} {name}" for name, size in sizes.items() if size != self.n]
        if wrong:
            raise BackendError(f"{self.name}: {' and '.join(wrong)} for {self.n} unknowns.")

    @property
    def n(self) -> int:
        """Number of variables."""
        return self.q.size

    @property
    def proof(self) -> SuiteReference:
        """Its reference.

        BackendError if it has none.
        """
        if self.reference is None:
            raise BackendError(f"{self.name}: has no reference.")
        return self.reference

    @property
    def orthant(self) -> int:
        """Number of rows of G that are plain inequalities; those of cones follow."""
        return self.h.size - sum(self.cones)

    @property
    def blocks(self) -> list[slice]:
        """Rows of G of each cone."""
        ends = self.orthant + np.cumsum(self.cones, dtype=int)
        return [slice(end - size, end) for end, size in zip(ends, self.cones, strict=True)]

    def plain_rows(self) -> tuple[sparse.csr_array, np.ndarray]:
        """Rows R x ≤ r of all that is a plain inequality: of G, upper bounds, lower bounds."""
        unit, up, down = sparse.eye_array(self.n, format="csr"), np.isfinite(self.ub), np.isfinite(self.lb)
        G = sparse.csr_array(self.G)[: self.orthant]
        rows = sparse.vstack([G, unit[up], -unit[down]], format="csr")
        return sparse.csr_array(rows), np.concatenate([self.h[: self.orthant], self.ub[up], -self.lb[down]])

    def multipliers(self, plain: Doubled) -> tuple[Doubled, Doubled]:
        """Multipliers z of the plain rows of G, and z_box (n,), from those of :meth:`plain_rows`."""
        up, down = np.flatnonzero(np.isfinite(self.ub)), np.flatnonzero(np.isfinite(self.lb))
        box, first, last = zeros(self.n), self.orthant, self.orthant + up.size
        box.hi[up], box.lo[up] = plain.hi[first:last], plain.lo[first:last]
        lower = zeros(self.n)
        lower.hi[down], lower.lo[down] = plain.hi[last:], plain.lo[last:]
        return Doubled(plain.hi[:first], plain.lo[:first]), box - lower


def programme(
    name: str, kind: str, story: str, P, q, *, A=None, b=(), G=None, h=(), lb=None, ub=None, **more
) -> SuiteInstance:
    """Instance without reference; rows and bounds that are not given are none, and variables without names are numbered."""
    q, b, h = (np.asarray(part, dtype=float) + 0.0 for part in (q, b, h))  # no −0, which some files do not hold
    n = q.size
    A, G = (_matrix(M, n) for M in (A, G))
    P = _matrix(P, n)
    P = (P + P.T) / 2  # symmetric to the last bit: some files and solvers hold one triangle
    lb = np.full(n, -np.inf) if lb is None else np.asarray(lb, dtype=float)
    ub = np.full(n, np.inf) if ub is None else np.asarray(ub, dtype=float)
    names = {"variables": tuple(f"x{i}" for i in range(n)), "units": ("1",) * n}
    return SuiteInstance(name, kind, story, P, q, A, b, G, h, lb, ub, **names | more)


def with_reference(instance: SuiteInstance, reference: SuiteReference) -> SuiteInstance:
    """The same instance with its reference."""
    return replace(instance, reference=reference)


def _matrix(M, n: int) -> sparse.csc_matrix:
    found = sparse.csc_matrix((0, n)) if M is None else sparse.csc_matrix(M, copy=True)
    found.eliminate_zeros()
    found.sum_duplicates()
    found.indices, found.indptr = found.indices.astype(np.int32), found.indptr.astype(np.int32)  # as solvers want them
    return found.astype(float)
