"""Cross-check of a scene with Pinocchio: a table of differences of the order of rounding."""

from gauss.analysis.crosscheck.crosscheck import CrossCheck, Row, crosscheck
from gauss.analysis.crosscheck.states import random_states

__all__ = ["CrossCheck", "Row", "crosscheck", "random_states"]
