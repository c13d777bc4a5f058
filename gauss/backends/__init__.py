"""Compulsion → Solution: one method a file, one table, one rule of choice."""

from gauss.backends.certificate import certify
from gauss.backends.solve import BACKENDS, available, choose, make, solve

__all__ = ["BACKENDS", "available", "certify", "choose", "make", "solve"]
