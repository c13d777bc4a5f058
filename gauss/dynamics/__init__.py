"""Mechanics of a system at one instant: accelerations, consistent states, mobility, assembly modes, derivatives."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
