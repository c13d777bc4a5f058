"""Compulsion → Solution: one method a file, one table, one rule of choice."""

from gauss.backends.certificate import certify
from gauss.backends.solve import BACKENDS, Backend, available, choose, make, ready, solve
from gauss.compulsion import Answer

__all__ = ["BACKENDS", "Answer", "Backend", "available", "certify", "choose", "make", "ready", "solve"]
