"""Analysis of systems and motions: reactions, forces of constraints and drives, inverse dynamics, energy, mobility."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
