"""Sweeps: one scene with many values of its parameters, as one labelled set of motions."""

from gauss.sweeps.sweep import load_sweep, sweep
from gauss.sweeps.vary import ranges

__all__ = ["load_sweep", "ranges", "sweep"]
