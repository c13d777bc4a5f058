"""What a system is asked at one instant: accelerations, consistent states, mobility, assembly modes, derivatives."""

from gauss.dynamics.compile import compile_scene
from gauss.dynamics.derivatives import Derivatives, derivatives
from gauss.dynamics.drift import STABILISATIONS, Baumgarte
from gauss.dynamics.mobility import Mobility, Redundancy, mobility
from gauss.dynamics.modes import assembly_modes
from gauss.dynamics.paradox import Paradox, paradoxes
from gauss.dynamics.rules import Plan

__all__ = [
    "Baumgarte",
    "Derivatives",
    "Mobility",
    "Paradox",
    "Plan",
    "Redundancy",
    "STABILISATIONS",
    "assembly_modes",
    "compile_scene",
    "derivatives",
    "mobility",
    "paradoxes",
]
