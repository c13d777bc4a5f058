"""Integrator loops and solvers in machine code; they call traced functions of a scene without Python between the steps."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
