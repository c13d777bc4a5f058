"""Environments of Gymnasium for scenes with inputs, one at a time or many in the lanes of vector registers."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
