from gauss.dynamics.compile_scene import compile_scene
from gauss.dynamics.contact.paradox import Paradox, paradoxes
from gauss.dynamics.contact.resolve_overlaps import resolve_overlaps
from gauss.dynamics.mobility import Mobility, Redundancy, mobility
from gauss.dynamics.rules import Plan
from gauss.dynamics.stabilisation import STABILISATIONS, Baumgarte

__all__ = [
    "Baumgarte",
    "Mobility",
    "Paradox",
    "Plan",
    "Redundancy",
    "STABILISATIONS",
    "compile_scene",
    "mobility",
    "paradoxes",
    "resolve_overlaps",
]
