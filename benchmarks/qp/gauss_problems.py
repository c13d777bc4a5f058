"""Quadratic programmes of mechanisms as a test set of qpbenchmark.

qpbenchmark --results-path results.csv gauss_problems.py run --author NAME
"""

from pathlib import Path

from qpbenchmark import Problem, TestSet


class GaussProblems(TestSet):
    """The problems in the .npz files beside this file."""

    @property
    def title(self) -> str:
        """Title of the report."""
        return "Gauss problems"

    @property
    def description(self) -> str:
        """What the problems are."""
        return "Accelerations of mechanisms as least compulsion under their constraints."

    @property
    def sparse_only(self) -> bool:
        """Whether only sparse solvers are asked."""
        return False

    def __iter__(self):
        """Yield the problems by name."""
        for file in sorted(Path(__file__).parent.glob("*.npz")):
            yield Problem.load(str(file))
