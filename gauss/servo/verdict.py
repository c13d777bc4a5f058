"""Whether relations can be held by given efforts, decided on the numbers of one instant, and said in words."""

from dataclasses import dataclass

import numpy as np

from gauss.errors import SimulationError
from gauss.servo.instant import Instant
from gauss.shapes import Shaped

RANK = 1e-8  # singular value of cosines that counts as zero; rounding lies near 1e-15, and efforts lose as many digits
WEAK = 0.1  # singular value relative to the largest: its direction is the one that is being lost
SHARE = 0.1  # of the largest entry: relations and efforts with less in a lost direction are not named
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
    """Relations that the given forces cannot hold; ``verdict`` says why.

    Parameters
    ----------
    message : str
        What cannot be held, and why.
    verdict : Verdict, optional
        How far the forces reach.
    trajectory : Tracking, optional
        The motion up to there.
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
        Why, with the names of what clashes.
    degree : int
        Highest relative degree: how often a relation is differentiated until efforts appear.
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
        return float(largest / smallest) if smallest > RANK else np.inf

    def __str__(self):
        """Outcome, counts, conditioning and reason."""
        counts = f"r = {len(self.relations)} relations, j = {len(self.efforts)} efforts, rank {self.rank}"
        values = ", ".join(f"{value:.3g}" for value in self.singular_values)
        lines = [OUTCOMES[self.outcome], counts, f"singular values {values or '–'}, condition {self.condition:.3g}"]
        return "; ".join(lines) + (f"; {self.reason}" if self.reason else "")


def judge(instant: Instant, relations: tuple[str, ...], efforts: tuple[str, ...]) -> Verdict:
    """Verdict of one instant; "rank lost" when S has not rank r there, whatever it has elsewhere."""
    r, j = instant.S.shape
    cosines = instant.cosines
    sigma = np.linalg.svd(cosines, compute_uv=False) if r and j else np.zeros(0)
    rank = int((sigma > RANK).sum())

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


def rank_lost(instant: Instant, relations: tuple[str, ...], efforts: tuple[str, ...]) -> Verdict:
    """Verdict of an instant next to which efforts lose their hold: as it is there, along the weakest direction of S.

    Where no direction is weak, as with an effort that turns round, all of them are named.
    """
    sigma = np.linalg.svd(instant.cosines, compute_uv=False)
    if sigma[-1] < max(WEAK * sigma[0], RANK):
        reason = _lost(instant.cosines, relations, efforts)
    else:
        reason = f"no force of {_names(efforts)} accelerates {_names(relations)} there"
    return Verdict(relations, efforts, len(sigma) - 1, sigma, "rank lost", reason)


def _clash(instant: Instant, relations) -> str:
    """Rows that contacts decide, or that depend on each other."""
    sizes = np.abs(instant.G) @ np.abs(instant.X_G).max(axis=1, initial=0.0)
    dead = [
        name for name, length, size in zip(relations, instant.lengths**2, sizes, strict=True) if length <= RANK**2 * size
    ]
    if dead:
        return f"contacts alone decide {_names(dead)}: no force of a servo changes the acceleration of it"
    if len(relations) < 2:
        return ""
    gram = instant.G @ instant.X_G / np.outer(instant.lengths, instant.lengths)
    values, vectors = np.linalg.eigh((gram + gram.T) / 2)
    if values[0] > RANK:
        return ""
    return f"{_names(_named(vectors[:, 0], relations))} depend on each other: leave one of them out"


def _lost(cosines, relations, efforts) -> str:
    """Combination of relations that no effort moves, and of efforts that moves none of them."""
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
    return [name for name, entry in zip(names, vector, strict=True) if abs(entry) > SHARE * largest]


def _names(names) -> str:
    return ", ".join(repr(name) for name in names)
