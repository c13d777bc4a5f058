from gauss.simulation.sweeps.parameters import ranges
from gauss.simulation.sweeps.sweep import load_sweep, sweep

__all__ = ["load_sweep", "ranges", "sweep"]
