"""Optimal motions: direct collocation with CasADi and IPOPT, and iLQR on the derivatives of compiled steps."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
