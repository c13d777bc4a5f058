from gauss.dynamics.contact.paradox import Paradox, paradoxes
from gauss.dynamics.mobility import Mobility, Redundancy, mobility
from gauss.dynamics.rules import Plan
from gauss.dynamics.scene_compilation import compile_scene
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
]
