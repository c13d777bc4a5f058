"""What comes out: the answer of a backend, and the certified solution made of it."""

from dataclasses import dataclass, field

import numpy as np

from gauss.compulsion.compulsion import Compulsion
from gauss.shapes import Shaped


@dataclass(frozen=True)
class Answer:
    """What a backend says, not yet believed.

    Parameters
    ----------
    a : ndarray, shape (6n,)
        Quasi-accelerations.
    qdd : ndarray, shape (p,)
        Joint accelerations.
    multipliers : ndarray, shape (r,)
        λ of the equality rows.
    inequality_multipliers : ndarray, shape (s,)
        Multipliers ≥ 0 of the inequality rows.
    found : bool
        Whether the backend claims success.
    message : str
        The backend's own words.
    iterations : int
        Iterations or refinement steps used; 0 for a direct method without any.
    """

    a: Shaped[np.ndarray, " n6"]
    qdd: Shaped[np.ndarray, " p"]
    multipliers: Shaped[np.ndarray, " r"]
    inequality_multipliers: Shaped[np.ndarray, " s"]
    found: bool = True
    message: str = "solved"
    iterations: int = 0


def failure(compulsion: Compulsion, message: str, iterations: int = 0) -> Answer:
    """Answer of a backend that found none."""
    structure = compulsion.structure
    sizes = 6 * structure.n_bodies, structure.n_columns, structure.n_rows, compulsion.h.size
    return Answer(*(np.full(size, np.nan) for size in sizes), False, message, iterations)


@dataclass(frozen=True)
class Certificate:
    """What residuals and one refinement step say about the accelerations of an answer.

    Residuals are independent of how the answer was found. The factorisation that weighs them is independent, too, for every
    backend but "recursion", the one that "auto" takes where no row is one-sided: its answers are judged with their own
    factorisation. Multipliers, and with them reactions, are not judged; ``not_unique`` says which of them are one choice of
    many.

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
        Largest violation among G x ≤ h, μ ≥ 0 and μ (G x − h) = 0, relative.
    not_unique : tuple of str
        Constraints whose multipliers are not unique, because rows are redundant.
    loose : ndarray of bool, shape (r,)
        Which multipliers these are; empty when there are none.
    """

    error: float
    body_errors: Shaped[np.ndarray, " n"]
    worst: str
    row_residual: float
    worst_row: str
    complementarity: float
    not_unique: tuple[str, ...] = ()
    loose: Shaped[np.ndarray, " r"] = field(default_factory=lambda: np.zeros(0, dtype=bool))


@dataclass(frozen=True)
class Status:
    """Outcome of a solve; ``str`` of it is "solved" only if the answer is certified.

    Parameters
    ----------
    certified : bool
        Whether the certificate confirms the answer within the tolerance.
    reason : str
        Why it does not; empty when it does.
    found : bool
        What the backend itself claims.
    message : str
        The backend's own words.
    rescued : str
        Methods that failed before, and why, where "auto" has let another one step in; empty if the first did.
    """

    certified: bool
    reason: str
    found: bool
    message: str
    rescued: str = ""

    @property
    def honest(self) -> bool:
        """Whether the backend's claim agrees with the certificate."""
        return self.found == self.certified

    def __str__(self):
        """Return "solved", or "not solved" with the reason."""
        return "solved" if self.certified else f"not solved: {self.reason}"


@dataclass(frozen=True)
class Solution:
    """Accelerations and reactions of one instant, with their certificate.

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
    status : Status
        "solved" only if certified.
    certificate : Certificate
        The evidence, for the accelerations. Its residuals are its own; of backend "recursion", and so of "auto" without
        one-sided rows, the factorisation that turns them into an error is the one that the answer was found with. The
        multipliers are not judged.
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
    status: Status
    certificate: Certificate
    backend: str
    iterations: int
    compulsion: Compulsion = field(repr=False)

    @property
    def answer(self) -> Answer:
        """What the backend said."""
        fields = (self.a, self.qdd, self.multipliers, self.inequality_multipliers)
        return Answer(*fields, self.status.found, self.status.message, self.iterations)
