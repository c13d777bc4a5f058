"""Simulation: arguments → problem → plan → driver → trajectory; batches and parameter sweeps."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
