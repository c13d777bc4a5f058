"""Engines: sources of accelerations along a motion, one a file."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
