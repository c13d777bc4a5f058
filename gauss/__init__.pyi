from gauss import (
    analysis as analysis,
)
from gauss import (
    backends as backends,
)
from gauss import (
    codegen as codegen,
)
from gauss import (
    dynamics as dynamics,
)
from gauss import (
    errors as errors,
)
from gauss import (
    export as export,
)
from gauss import (
    integrators as integrators,
)
from gauss import (
    io as io,
)
from gauss import (
    linkages as linkages,
)
from gauss import (
    math as math,
)
from gauss import (
    rotations as rotations,
)
from gauss import (
    rotors as rotors,
)
from gauss import (
    scene as scene,
)
from gauss import (
    servo as servo,
)
from gauss import (
    simulation as simulation,
)
from gauss import (
    system as system,
)
from gauss import (
    view as view,
)
from gauss.analysis import (
    constraint_forces,
    contact_forces,
    contact_points,
    drive_forces,
    energy,
    friction_forces,
    inverse_dynamics,
    reactions,
    set_valued_forces,
)
from gauss.analysis.assembly_modes import assembly_modes
from gauss.analysis.base_parameters import BaseParameters, base_parameters
from gauss.analysis.crosscheck import crosscheck
from gauss.analysis.derivatives import derivatives
from gauss.analysis.equilibrium import StaticEquilibrium, equilibria, equilibrium
from gauss.analysis.excitation import Excitation, excitation
from gauss.analysis.fitted_motion import MotionFit
from gauss.analysis.identification import Identification, identify
from gauss.analysis.inverse_kinematics import InverseKinematics, differential_inverse_kinematics, inverse_kinematics
from gauss.analysis.linear_model import LinearModel, linearise
from gauss.analysis.linear_modes import LinearModes
from gauss.analysis.modes import mode_motion, modes
from gauss.analysis.motion_fit import fit_motion
from gauss.analysis.optimal import (
    FeedbackMotion,
    HybridMotion,
    MotionPhase,
    OptimalMotion,
    ilqr,
    optimal_hybrid_motion,
    optimal_motion,
)
from gauss.analysis.planned_motion import PlannedMotion, plan_motion
from gauss.analysis.planned_path import plan_path
from gauss.analysis.prepared_linear_model import prepare_linear_model
from gauss.analysis.recommendation import advise
from gauss.analysis.regressor import Regressor, regressor
from gauss.analysis.root_locus import RootLocus, root_locus
from gauss.analysis.sensitivities import MotionGradient, Sensitivities, motion_gradient, sensitivities
from gauss.analysis.sensitivity.jax_functions import jax_dynamics, jax_motion
from gauss.analysis.sensitivity.torch_functions import torch_dynamics, torch_motion
from gauss.analysis.targets import CenterOfMassTarget, DistanceTarget, PointTarget, PoseTarget, PostureTarget
from gauss.backends import choose, solve
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.dynamics import Baumgarte, Plan, compile_scene, mobility, paradoxes
from gauss.dynamics.assemble import assemble
from gauss.dynamics.kinematics import Kinematics
from gauss.errors import GaussError
from gauss.integrators import Taylor, generalised_alpha
from gauss.io import catalog, load, save
from gauss.io.dataset import load_motion, to_dataset, to_table
from gauss.io.linkage import load_linkage
from gauss.io.rotors import load_rotors, save_rotors
from gauss.linkages import Linkage
from gauss.scene import Body, Constraint, Coupling, Drive, Force, Frame, Joint, JointSpring, Scene, Spring, Start
from gauss.simulation import (
    Simulator,
    SimulatorBatch,
    Sleeping,
    Trajectory,
    crossings,
    friction_problem,
    prepare,
    resolve_overlaps,
    rollout,
    simulate,
)
from gauss.simulation.sweeps import load_sweep, sweep
from gauss.system import State, System
from gauss.view.viewer import show

__version__: str

__all__ = [
    "BaseParameters",
    "Baumgarte",
    "Body",
    "CenterOfMassTarget",
    "Compulsion",
    "Constraint",
    "Coupling",
    "DistanceTarget",
    "Drive",
    "Excitation",
    "FeedbackMotion",
    "Force",
    "Frame",
    "GaussError",
    "HybridMotion",
    "Identification",
    "InverseKinematics",
    "Joint",
    "JointSpring",
    "Kinematics",
    "LinearModel",
    "LinearModes",
    "Linkage",
    "MotionFit",
    "MotionGradient",
    "MotionPhase",
    "OptimalMotion",
    "Plan",
    "PlannedMotion",
    "PointTarget",
    "PoseTarget",
    "PostureTarget",
    "Regressor",
    "RootLocus",
    "Scene",
    "Sensitivities",
    "Simulator",
    "SimulatorBatch",
    "Sleeping",
    "Solution",
    "Spring",
    "Start",
    "State",
    "StaticEquilibrium",
    "System",
    "Taylor",
    "Trajectory",
    "advise",
    "assemble",
    "assembly_modes",
    "base_parameters",
    "catalog",
    "choose",
    "compile_scene",
    "constraint_forces",
    "contact_forces",
    "contact_points",
    "crosscheck",
    "crossings",
    "derivatives",
    "differential_inverse_kinematics",
    "drive_forces",
    "energy",
    "equilibria",
    "equilibrium",
    "excitation",
    "fit_motion",
    "friction_forces",
    "friction_problem",
    "generalised_alpha",
    "identify",
    "ilqr",
    "inverse_dynamics",
    "inverse_kinematics",
    "jax_dynamics",
    "jax_motion",
    "linearise",
    "load",
    "load_linkage",
    "load_motion",
    "load_rotors",
    "load_sweep",
    "mobility",
    "mode_motion",
    "modes",
    "motion_gradient",
    "optimal_hybrid_motion",
    "optimal_motion",
    "paradoxes",
    "plan_motion",
    "plan_path",
    "prepare",
    "prepare_linear_model",
    "reactions",
    "regressor",
    "resolve_overlaps",
    "rollout",
    "root_locus",
    "save",
    "save_rotors",
    "sensitivities",
    "set_valued_forces",
    "show",
    "simulate",
    "solve",
    "sweep",
    "to_dataset",
    "to_table",
    "torch_dynamics",
    "torch_motion",
]
