"""Equations of motion as code of other languages, from the traced graph of the mechanics: C99, CasADi, JAX, LaTeX."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
