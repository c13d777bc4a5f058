from gauss.backends.backend import BACKENDS, Backend
from gauss.backends.certificate import certify
from gauss.backends.registry import available, choose, make, ready
from gauss.backends.solution import Answer
from gauss.backends.solve import solve

__all__ = ["BACKENDS", "Answer", "Backend", "available", "certify", "choose", "make", "ready", "solve"]
