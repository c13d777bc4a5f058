"""Integrators: one-step methods on the configuration manifold, their error estimates, and step-size control."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
