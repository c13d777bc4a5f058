"""Figures. Needs the extra ``view``: pip install 'gauss[view]'."""

from gauss.view.linkages import animate_linkage, plot_linkage
from gauss.view.plots import plot_motion
from gauss.view.rotors import draw_network, plot_rotors
from gauss.view.servo import plot_tracking

__all__ = ["animate_linkage", "draw_network", "plot_linkage", "plot_motion", "plot_rotors", "plot_tracking"]
