"""The loop from a start to a trajectory."""

from gauss.simulation.compile import compile_scene
from gauss.simulation.crossings import crossings
from gauss.simulation.derivatives import Derivatives, derivatives
from gauss.simulation.drift import STABILISATIONS, Baumgarte
from gauss.simulation.mobility import Mobility, Redundancy, mobility
from gauss.simulation.modes import assembly_modes
from gauss.simulation.outlook import Outlook, outlook
from gauss.simulation.paradox import Paradox, paradoxes
from gauss.simulation.rollout import Rollout, rollout
from gauss.simulation.simulate import INTEGRATORS, simulate
from gauss.simulation.trajectory import BodyMotion, Stats, Trajectory

__all__ = [
    "INTEGRATORS",
    "STABILISATIONS",
    "Baumgarte",
    "BodyMotion",
    "Derivatives",
    "Mobility",
    "Outlook",
    "Paradox",
    "Redundancy",
    "Rollout",
    "Stats",
    "Trajectory",
    "assembly_modes",
    "compile_scene",
    "crossings",
    "derivatives",
    "mobility",
    "outlook",
    "paradoxes",
    "rollout",
    "simulate",
]
