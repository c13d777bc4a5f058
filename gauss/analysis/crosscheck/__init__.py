"""Cross-check of a scene with Pinocchio: a table of differences of the order of rounding."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
