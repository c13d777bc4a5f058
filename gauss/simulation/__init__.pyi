from gauss.simulation.batch.batch_result import Rollout
from gauss.simulation.batch.rollout import rollout
from gauss.simulation.batch.simulator_batch import SimulatorBatch
from gauss.simulation.contact_export import friction_problem
from gauss.simulation.initial_overlaps import resolve_overlaps
from gauss.simulation.integrators import INTEGRATORS
from gauss.simulation.moreau.sleeping import Sleeping
from gauss.simulation.prepared_motion import PreparedMotion, prepare
from gauss.simulation.simulate import simulate
from gauss.simulation.simulator import Simulator
from gauss.simulation.trajectory import BodyMotion, Stats, Trajectory
from gauss.simulation.zero_crossings import crossings

__all__ = [
    "INTEGRATORS",
    "BodyMotion",
    "PreparedMotion",
    "Rollout",
    "Simulator",
    "SimulatorBatch",
    "Sleeping",
    "Stats",
    "Trajectory",
    "crossings",
    "prepare",
    "friction_problem",
    "resolve_overlaps",
    "rollout",
    "simulate",
]
