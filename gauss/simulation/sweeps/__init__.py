"""Parameter sweeps: motions of one scene for many values of its parameters, as one labelled dataset."""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
