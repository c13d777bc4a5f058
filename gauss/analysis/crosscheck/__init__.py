"""The same scene in Pinocchio: a table of differences that should be rounding."""

from gauss.analysis.crosscheck.crosscheck import CrossCheck, Row, crosscheck
from gauss.analysis.crosscheck.states import random_states

__all__ = ["CrossCheck", "Row", "crosscheck", "random_states"]
