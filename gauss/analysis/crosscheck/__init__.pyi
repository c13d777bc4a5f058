from gauss.analysis.crosscheck.crosscheck import CrossCheck, Row, crosscheck
from gauss.analysis.crosscheck.states import random_states

__all__ = ["CrossCheck", "Row", "crosscheck", "random_states"]
