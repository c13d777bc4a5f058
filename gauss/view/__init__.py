"""Figures. Needs the extra ``view``: pip install 'gauss[view]'."""

from gauss.view.plots import plot_motion

__all__ = ["plot_motion"]
