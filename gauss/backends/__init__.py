"""Compulsion → Solution: one method a file, one table, one rule of choice."""

from gauss.backends.certificate import certify
from gauss.backends.solution import Answer
from gauss.backends.solve import BACKENDS, Backend, available, choose, make, ready, solve

__all__ = ["BACKENDS", "Answer", "Backend", "available", "certify", "choose", "make", "ready", "solve"]
