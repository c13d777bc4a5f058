"""Realisability of servo-constraints at one instant: rank of S = G N H_N⁻¹ Nᵀ Wᵀ; relations and efforts in contradiction."""

from dataclasses import dataclass

import numpy as np

from gauss.errors import SimulationError
from gauss.servo.instant import ServoInstant
from gauss.shapes import Shaped

RANK_COSINE = 1e-8  # singular value of cosines that counts as zero: rounding is 1e-15, and efforts lose as many digits
WEAK_SINGULAR_VALUE = 0.1  # relative to the largest: of a direction that is being lost
NAMED_SHARE = 0.1  # of the largest entry of a lost direction: relations and efforts with less are not named
OUTCOMES = {
    "determinate": "determinate: as many efforts as relations",
    "indeterminate": "indeterminate: more efforts than relations; the least weighted norm is chosen",
    "higher degree": "determinate after index reduction",
    "contradictory": "not realisable: relations repeat or contradict each other",
    "impossible": "not realisable: more relations than efforts",
    "rank lost": "not realisable here: the efforts lose their hold on the relations",
    "no hold": "not realisable: the efforts do not act on the relations",
}
POSSIBLE = ("determinate", "indeterminate", "higher degree")


class UnrealisableError(SimulationError):
    """Servo-constraints that the given forces cannot hold; ``verdict`` gives the reason.

    Parameters
    ----------
    message : str
        Relations, and the reason.
    verdict : Verdict, optional
        Verdict of the instant.
    trajectory : Tracking, optional
        Motion until then.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> lean = servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin"))
    >>> rail = servo.ServoRelation("stay", lambda t, motion: motion.coordinate("rail"))
    >>> held = servo.Servo(gauss.load("cart_pole"), [lean, rail], [servo.Motor("motor", "rail")])
    >>> try:
    ...     run = servo.simulate(held, 0.1)
    ... except servo.UnrealisableError as error:
    ...     print(error.verdict.outcome)
    impossible
    """

    def __init__(self, message, verdict=None, trajectory=None):
        super().__init__(message, trajectory)
        self.verdict = verdict


@dataclass(frozen=True)
class Verdict:
    """Whether the relations can be held.

    Parameters
    ----------
    relations, efforts : tuple of str
        Names of the r scalar relations that servos hold, and of the j efforts.
    rank : int
        Rank of S, the accelerations of the relations under the efforts.
    singular_values : ndarray
        Of the normalised S: cosines between relations and efforts in the mass metric, largest first.
    outcome : str
        One of "determinate", "indeterminate", "higher degree", "contradictory", "impossible", "rank lost", "no hold".
    reason : str
        Reason, with the names of relations and efforts.
    degree : int
        Highest relative degree: number of differentiations until efforts appear.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> verdict = servo.realisable(gauss.load("servo/inverted_pendulum"))
    >>> verdict.outcome, verdict.rank
    ('determinate', 1)
    """

    relations: tuple[str, ...]
    efforts: tuple[str, ...]
    rank: int
    singular_values: Shaped[np.ndarray, " k"]
    outcome: str
    reason: str
    degree: int = 2

    def __bool__(self):
        """Whether the relations can be held."""
        return self.outcome in POSSIBLE

    @property
    def condition(self) -> float:
        """σ_max/σ_min of the normalised S; infinite where rank is lost."""
        if not self.singular_values.size:
            return 1.0
        largest, smallest = self.singular_values[0], self.singular_values[-1]
        return float(largest / smallest) if smallest > RANK_COSINE else np.inf

    def __str__(self):
        """Outcome, counts, conditioning and reason."""
        counts = f"r = {len(self.relations)} relations, j = {len(self.efforts)} efforts, rank {self.rank}"
        values = ", ".join(f"{value:.3g}" for value in self.singular_values)
        lines = [OUTCOMES[self.outcome], counts, f"singular values {values or '–'}, condition {self.condition:.3g}"]
        return "; ".join(lines) + (f"; {self.reason}" if self.reason else "")


def verdict_of(instant: ServoInstant, relations: tuple[str, ...], efforts: tuple[str, ...]) -> Verdict:
    """Verdict of one instant; "rank lost" where S has rank less than r there."""
    r, j = instant.S.shape
    cosines = instant.cosines
    sigma = np.linalg.svd(cosines, compute_uv=False) if r and j else np.zeros(0)
    rank = int((sigma > RANK_COSINE).sum())

    def verdict(outcome: str, reason: str = "") -> Verdict:
        return Verdict(relations, efforts, rank, sigma, outcome, reason)

    clash = _clash(instant, relations)
    if clash:
        return verdict("contradictory", clash)
    if rank < min(r, j) or (rank < r and not j):
        return verdict("rank lost", _lost(cosines, relations, efforts))
    if r > j:
        return verdict(
            "impossible",
            f"{r} relations ({', '.join(relations)}) but only {j} freely disposable efforts "
            f"({', '.join(efforts) or 'none'}): give {r - j} more, or leave {r - j} of the relations out",
        )
    if r < j:
        return verdict("indeterminate", f"{j - r} efforts are free: weights and preloads choose")
    return verdict("determinate")


def rank_lost(instant: ServoInstant, relations: tuple[str, ...], efforts: tuple[str, ...]) -> Verdict:
    """Verdict next to a loss of rank, along the weakest direction of S.

    Where no direction is weak, as with an effort that reverses, all of them are named.
    """
    sigma = np.linalg.svd(instant.cosines, compute_uv=False)
    if sigma[-1] < max(WEAK_SINGULAR_VALUE * sigma[0], RANK_COSINE):
        reason = _lost(instant.cosines, relations, efforts)
    else:
        reason = f"no force of {_names(efforts)} accelerates {_names(relations)} there"
    return Verdict(relations, efforts, len(sigma) - 1, sigma, "rank lost", reason)


def row_lost(instant: ServoInstant, rows: np.ndarray, relations: tuple[str, ...], efforts: tuple[str, ...]) -> Verdict:
    """Verdict next to a position at which some rows of the relations vanish, as where an arm is stretched out."""
    sigma = np.linalg.svd(instant.cosines, compute_uv=False)
    named, left = _names(relations[row] for row in rows), len(relations) - len(rows)
    reason = f"no motion of the joints changes {named} there: rank {left} of {len(relations)} is left"
    return Verdict(relations, efforts, left, sigma, "rank lost", reason)


def _clash(instant: ServoInstant, relations) -> str:
    """Names of rows that contacts determine, or that depend on each other; empty if there are none."""
    sizes = np.abs(instant.G) @ np.abs(instant.X_G).max(axis=1, initial=0.0)
    determined = [
        name
        for name, length, size in zip(relations, instant.lengths**2, sizes, strict=True)
        if length <= RANK_COSINE**2 * size
    ]
    if determined:
        return f"contacts alone decide {_names(determined)}: no force of a servo changes the acceleration of it"
    if len(relations) < 2:
        return ""
    gram = instant.G @ instant.X_G / np.outer(instant.lengths, instant.lengths)
    values, vectors = np.linalg.eigh((gram + gram.T) / 2)
    if values[0] > RANK_COSINE:
        return ""
    return f"{_names(_named(vectors[:, 0], relations))} depend on each other: leave one of them out"


def _lost(cosines, relations, efforts) -> str:
    """Combination of relations that no effort accelerates, and of efforts without effect."""
    if not efforts:
        return f"there is no effort to hold {_names(relations)}"
    U, _, Vt = np.linalg.svd(cosines)
    still = _named(Vt[-1], efforts)
    idle = f"{_names(still)} does" if len(still) == 1 else f"a combination of {_names(still)} does"
    lost = _named(U[:, -1], relations)
    what = f"{_names(lost)}" if len(lost) == 1 else f"a combination of {_names(lost)}"
    if len(relations) == len(efforts):
        return f"no effort accelerates {what}, and {idle} not move any relation"
    return f"no effort accelerates {what}"


def _named(vector, names) -> list[str]:
    largest = np.abs(vector).max()
    return [name for name, entry in zip(names, vector, strict=True) if abs(entry) > NAMED_SHARE * largest]


def _names(names) -> str:
    return ", ".join(repr(name) for name in names)
