"""Scenes and motions in files and by name."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
