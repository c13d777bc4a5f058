"""The loop from a start to a trajectory."""

from gauss.simulation.crossings import crossings
from gauss.simulation.outlook import Outlook, outlook
from gauss.simulation.simulate import INTEGRATORS, simulate
from gauss.simulation.together.rollout import Rollout, rollout
from gauss.simulation.trajectory import BodyMotion, Stats, Trajectory

__all__ = [
    "INTEGRATORS",
    "BodyMotion",
    "Outlook",
    "Rollout",
    "Stats",
    "Trajectory",
    "crossings",
    "outlook",
    "rollout",
    "simulate",
]
