"""The answer of a backend, and the certified solution made of it: accelerations (a, q̈), multipliers λ, μ, evidence."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.dual_certificate import DualCertificate
from gauss.shapes import Shaped

if TYPE_CHECKING:
    Multipliers = np.ndarray  # as soon as :func:`gauss.backends.answering.checked_answer` has seen the answer
else:
    Multipliers = Shaped[np.ndarray, " _"] | None


@dataclass(frozen=True)
class Answer:
    """Answer of a backend, not yet certified.

    Parameters
    ----------
    a : ndarray, shape (6n,)
        Quasi-accelerations.
    qdd : ndarray, shape (p,)
        Joint accelerations.
    multipliers : ndarray, shape (r,), or None
        λ of the equality rows; None of a backend that gives none.
    inequality_multipliers : ndarray, shape (s,), or None
        Multipliers ≥ 0 of the inequality rows, or None.
    found : bool
        Whether the backend claims success.
    message : str
        The backend's own words.
    iterations : int
        Iterations or refinement steps used; 0 for a direct method without any.
    """

    a: Shaped[np.ndarray, " n6"]
    qdd: Shaped[np.ndarray, " p"]
    multipliers: Multipliers
    inequality_multipliers: Multipliers
    found: bool = True
    message: str = "solved"
    iterations: int = 0


def failure(compulsion: Compulsion, message: str, iterations: int = 0) -> Answer:
    """Answer of a backend that found none."""
    structure = compulsion.structure
    sizes = 6 * structure.n_bodies, structure.n_columns, structure.n_rows, compulsion.h.size
    a, qdd, multipliers, mu = (np.full(size, np.nan) for size in sizes)
    return Answer(a, qdd, multipliers, mu, False, message, iterations)


@dataclass(frozen=True)
class Certificate:
    """Estimated errors of an answer, of its accelerations here, of its multipliers in ``dual``.

    Residuals are independent of how the answer was found. The factorisation that weighs them is independent, too, for every
    backend but "recursion", the one that "auto" takes where no row is one-sided: its answers are judged with their own
    factorisation. ``not_unique`` says which of the multipliers are one choice of many.

    Parameters
    ----------
    error : float
        Estimated relative error of the accelerations, the worst of all bodies and joints.
    body_errors : ndarray, shape (n,)
        Estimated relative error of each body's acceleration.
    worst : str
        Name of the body or joint with the largest error.
    row_residual : float
        Largest violation of a row that no correction removes, relative to the accelerations: rows that contradict
        each other leave one.
    worst_row : str
        Name of the constraint with this violation.
    complementarity : float
        Largest violation among G x ≤ h, μ ≥ 0 and μ (G x − h) = 0, relative, of what the backend gave.
    dual : DualCertificate
        Multipliers less their error, and estimated relative errors, constraint by constraint.
    not_unique : tuple of str
        Constraints whose multipliers are not unique, because rows are redundant.
    undetermined : ndarray of bool, shape (r,)
        Which multipliers are not unique; empty when all are.
    """

    error: float
    body_errors: Shaped[np.ndarray, " n"]
    worst: str
    row_residual: float
    worst_row: str
    complementarity: float
    dual: DualCertificate = field(repr=False)
    not_unique: tuple[str, ...] = ()
    undetermined: Shaped[np.ndarray, " r"] = field(default_factory=lambda: np.zeros(0, dtype=bool))


@dataclass(frozen=True)
class SolveStatus:
    """Outcome of a solve; ``str`` of it is "solved" only if accelerations and multipliers of the solution are certified.

    Parameters
    ----------
    certified : bool
        Whether the certificate confirms the accelerations within the tolerance.
    reason : str
        Why it does not; empty when it does.
    found : bool
        What the backend itself claims.
    message : str
        The backend's own words.
    rescued : str
        Methods that failed before, and why, where "auto" has let another one step in; empty if the first did.
    dual : DualCertificate, optional
        What the certificate says of the multipliers.
    tolerance : float
        Relative error above which they are not certified.
    """

    certified: bool
    reason: str
    found: bool
    message: str
    rescued: str = ""
    dual: DualCertificate | None = field(default=None, repr=False, compare=False)
    tolerance: float = np.inf

    @property
    def honest(self) -> bool:
        """Whether the backend's claim agrees with the certificate: of its accelerations, and of its own multipliers."""
        return self.found == (self.certified and not self.replaced)

    @property
    def replaced(self) -> str:
        """Why multipliers of the certificate are returned and not those of the backend; empty where these are certified."""
        dual = self.dual
        if dual is None or dual.given_error <= self.tolerance:
            return ""
        return f"estimated relative error {dual.given_error:.1e} of the backend's multipliers of {dual.given_worst!r}"

    @property
    def accelerations_only(self) -> str:
        """Why the multipliers that are returned are not certified, though the accelerations are; empty where they are."""
        dual = self.dual
        if dual is None or not self.certified or dual.error <= self.tolerance:
            return ""
        return f"estimated relative error {dual.error:.1e} of the multipliers of {dual.worst!r} exceeds {self.tolerance:.0e}"

    def __str__(self):
        """Return "solved", "solved, accelerations only" or "not solved", the latter with the reason."""
        if not self.certified:
            return f"not solved: {self.reason}"
        doubt = self.accelerations_only
        return f"solved, accelerations only: {doubt}" if doubt else "solved"


@dataclass(frozen=True)
class Solution:
    """Accelerations and reactions of one instant, with their certificate.

    Accelerations are those of the backend. Multipliers are its own less their error as the certificate estimates it: right
    to ``certificate.dual.errors``, whatever the backend gave, and of least norm where equality rows are redundant. Where
    not even these are certified, as next to a singular configuration, ``str(status)`` is "solved, accelerations only",
    and functions that return forces raise an error.

    Parameters
    ----------
    a : ndarray, shape (6n,)
        Quasi-accelerations [rad/s², m/s²].
    qdd : ndarray, shape (p,)
        Joint accelerations [rad/s², m/s²].
    multipliers : ndarray, shape (r,)
        λ; the reaction on the bodies is −Aᵀλ.
    inequality_multipliers : ndarray, shape (s,)
        Multipliers of G x ≤ h.
    status : SolveStatus
        "solved" only if certified.
    certificate : Certificate
        The evidence. Its residuals are its own; of backend "recursion", and so of "auto" without one-sided rows, the
        factorisation that turns them into an error is the one that the answer was found with.
    backend : str
        Name of the method.
    iterations : int
        Its iterations or refinement steps.
    compulsion : Compulsion
        The problem that was solved.
    """

    a: Shaped[np.ndarray, " n6"]
    qdd: Shaped[np.ndarray, " p"]
    multipliers: Shaped[np.ndarray, " r"]
    inequality_multipliers: Shaped[np.ndarray, " s"]
    status: SolveStatus
    certificate: Certificate
    backend: str
    iterations: int
    compulsion: Compulsion = field(repr=False)

    @property
    def answer(self) -> Answer:
        """Answer of the backend, with the multipliers that are returned."""
        fields = (self.a, self.qdd, self.multipliers, self.inequality_multipliers)
        return Answer(*fields, self.status.found, self.status.message, self.iterations)
