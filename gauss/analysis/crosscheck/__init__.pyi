from gauss.analysis.crosscheck.crosscheck import CrossCheck, Row, crosscheck, random_states

__all__ = ["CrossCheck", "Row", "crosscheck", "random_states"]
