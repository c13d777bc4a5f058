"""Figures. Needs the extra ``view``: pip install matplotlib viser."""

from gauss.errors import extra

with extra("view"):
    from gauss.view.comparison import plot_comparison
    from gauss.view.linkages import animate_linkage, plot_linkage
    from gauss.view.phase import plot_phase
    from gauss.view.plots import plot_coordinates, plot_energy, plot_motion, plot_reactions, plot_speeds
    from gauss.view.rotors import draw_network, plot_rotors
    from gauss.view.servo import plot_tracking
    from gauss.view.stroboscope import plot_stroboscope

__all__ = [
    "animate_linkage",
    "draw_network",
    "plot_comparison",
    "plot_coordinates",
    "plot_energy",
    "plot_linkage",
    "plot_motion",
    "plot_phase",
    "plot_reactions",
    "plot_rotors",
    "plot_speeds",
    "plot_stroboscope",
    "plot_tracking",
]
