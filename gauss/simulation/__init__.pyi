from gauss.simulation.batch.rollout import Rollout, rollout
from gauss.simulation.integrators import INTEGRATORS
from gauss.simulation.simulate import simulate
from gauss.simulation.trajectory import BodyMotion, Stats, Trajectory
from gauss.simulation.zero_crossings import crossings

__all__ = [
    "INTEGRATORS",
    "BodyMotion",
    "Rollout",
    "Stats",
    "Trajectory",
    "crossings",
    "rollout",
    "simulate",
]
