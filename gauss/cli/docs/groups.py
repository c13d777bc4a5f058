"""Public names by task: the chapters of the reference."""

from importlib import import_module
from typing import NamedTuple

from gauss import errors


class Group(NamedTuple):
    """A chapter of the reference."""

    key: str  # name of its page
    title: str  # title, text: heading and introduction
    text: str
    names: tuple[str, ...]  # full public names


def _of(package: str, names: str = "") -> tuple[str, ...]:
    """Full names of some names of a package, or of all."""
    return tuple(f"{package}.{name}" for name in names.split() or import_module(package).__all__)


ERRORS = [name for name, thing in vars(errors).items() if isinstance(thing, type) and thing.__module__ == errors.__name__]
GROUPS = (
    Group(
        "scene",
        "Build a scene",
        "A scene holds bodies, joints, constraints and loads; its methods add them. All elements: :doc:`gauss.scene`.",
        _of("gauss", "Scene Body Frame Joint Coupling Constraint Drive Force Spring JointSpring Start"),
    ),
    Group(
        "files",
        "Read and write files",
        "Scenes, linkages, networks, motions and sweeps; :doc:`/formats` describes the files.",
        _of("gauss", "load save catalog load_linkage load_rotors save_rotors load_motion load_sweep to_dataset to_table"),
    ),
    Group(
        "simulate",
        "Simulate",
        "From one motion to many, from a call to a loop of your own. Which route a motion takes: :doc:`/concepts/plan`.",
        _of("gauss", "simulate Trajectory Simulator SimulatorBatch prepare rollout sweep crossings Plan Baumgarte Taylor")
        + _of("gauss", "Sleeping generalised_alpha advise"),
    ),
    Group(
        "instant",
        "One state",
        "A scene compiled into a system, whose functions of a state are machine code, and the compulsion that its "
        "accelerations minimise.",
        _of("gauss", "compile_scene System State Kinematics assemble Compulsion solve Solution choose"),
    ),
    Group(
        "forces",
        "Forces and energy",
        "What joints, constraints, drives and contacts take, at one instant or along a motion.",
        _of("gauss", "reactions constraint_forces drive_forces contact_forces friction_forces set_valued_forces")
        + _of("gauss", "contact_points inverse_dynamics energy"),
    ),
    Group(
        "analysis",
        "Analyse a mechanism",
        "Freedoms, ways of assembly, states of rest, linear models and their modes, derivatives, and the check against "
        "Pinocchio.",
        _of("gauss", "mobility assembly_modes equilibrium equilibria StaticEquilibrium linearise LinearModel LinearModes")
        + _of("gauss", "derivatives crosscheck paradoxes resolve_overlaps friction_problem sensitivities Sensitivities")
        + _of("gauss", "motion_gradient MotionGradient root_locus RootLocus modes mode_motion prepare_linear_model")
        + _of("gauss", "torch_dynamics torch_motion jax_dynamics jax_motion"),
    ),
    Group(
        "inverse_kinematics",
        "Inverse kinematics and planned motions",
        "States and rates for targets, with loops closed and limits kept; motions of coordinates within limits of speed and "
        "acceleration. Guide: :doc:`/guides/arms`.",
        _of("gauss", "inverse_kinematics differential_inverse_kinematics InverseKinematics PoseTarget PointTarget")
        + _of("gauss", "DistanceTarget CenterOfMassTarget PostureTarget plan_motion plan_path PlannedMotion"),
    ),
    Group(
        "identification",
        "Identify parameters",
        "Masses, centres of mass, inertias and friction from measured motions and forces, loops included.",
        _of("gauss", "identify Identification base_parameters BaseParameters regressor Regressor")
        + _of("gauss", "fit_motion MotionFit excitation Excitation"),
    ),
    Group(
        "optimal",
        "Optimal motions",
        "Motions of least time, effort or any cost by direct collocation (extra ``export``), and by iLQR with feedback. "
        "Guide: :doc:`/guides/optimisation`.",
        _of("gauss", "optimal_motion OptimalMotion optimal_hybrid_motion MotionPhase HybridMotion ilqr FeedbackMotion"),
    ),
    Group(
        "view",
        "Look at a motion",
        "Figures of matplotlib, the viewer in the browser, self-contained pages and films. Needs the extra ``view``.",
        ("gauss.show", *_of("gauss.view"), *_of("gauss.view.viewer", "Page Viewer export_film export_html page")),
    ),
    Group(
        "laws",
        "Functions for laws",
        "Functions that work on numbers and are traced into machine code: what laws of drives, forces and constraints may "
        "call beside numpy's.",
        _of("gauss.math"),
    ),
    Group(
        "actuators",
        "Actuators with states",
        "Motors, controllers, filters, muscles and friction with states of their own, made of :meth:`gauss.Scene.state`.",
        _of("gauss.scene.actuators", "dc_motor hydraulic_cylinder pi_controller low_pass muscle lugre_friction"),
    ),
    Group(
        "linkages",
        "Planar linkages",
        "Assur groups: positions in closed form, reactions, a cycle in one call, balancing. Guide: :doc:`/guides/linkages`.",
        ("gauss.Linkage", *(name for name in _of("gauss.linkages") if name != "gauss.linkages.Linkage")),
    ),
    Group("rotors", "Rotor networks", "Drive trains of machines. Guide: :doc:`/guides/rotors`.", _of("gauss.rotors")),
    Group(
        "servo",
        "Servo-constraints",
        "Relations held by controlled forces. Guide: :doc:`/guides/servo`.",
        _of("gauss.servo"),
    ),
    Group(
        "export",
        "Code of other languages",
        "Functions of a state as C99, CasADi, JAX and formulas, and units of FMI 3. Guide: :doc:`/guides/export`.",
        _of("gauss.export"),
    ),
    Group(
        "gym",
        "Environments for learning",
        "Environments of Gymnasium, one at a time or many in SIMD lanes. Needs the extra ``gym``.",
        _of("gauss.gym"),
    ),
    Group(
        "errors",
        "Errors and warnings",
        "Every error of gauss is a :class:`gauss.GaussError`; its message names the place, the value and the remedy.",
        ("gauss.GaussError", *(f"gauss.errors.{name}" for name in ERRORS if name != "GaussError")),
    ),
)
ROOMS = (
    "gauss.scene",
    "gauss.simulation",
    "gauss.simulation.sweeps",
    "gauss.analysis",
    "gauss.analysis.crosscheck",
    "gauss.analysis.optimal",
    "gauss.backends",
    "gauss.integrators",
    "gauss.dynamics",
    "gauss.system",
    "gauss.io",
    "gauss.codegen",
    "gauss.codegen.kernels",
)
MADE_BY = {  # names that one seldom types, and what makes such objects: a public name, or a method
    "gauss.BaseParameters": "gauss.base_parameters",
    "gauss.Body": ".body",
    "gauss.Constraint": ".constrain",
    "gauss.Coupling": ".couple",
    "gauss.Drive": ".drive",
    "gauss.FeedbackMotion": "gauss.ilqr",
    "gauss.Force": ".force",
    "gauss.Frame": ".frame",
    "gauss.Identification": "gauss.identify",
    "gauss.Joint": ".revolute",
    "gauss.JointSpring": ".joint_spring",
    "gauss.Spring": ".spring",
    "gauss.Start": ".start",
    "gauss.Compulsion": "gauss.assemble",
    "gauss.InverseKinematics": "gauss.inverse_kinematics",
    "gauss.LinearModel": "gauss.linearise",
    "gauss.LinearModes": ".modes",
    "gauss.Excitation": "gauss.excitation",
    "gauss.MotionFit": "gauss.fit_motion",
    "gauss.RootLocus": "gauss.root_locus",
    "gauss.MotionGradient": "gauss.motion_gradient",
    "gauss.OptimalMotion": "gauss.optimal_motion",
    "gauss.HybridMotion": "gauss.optimal_hybrid_motion",
    "gauss.MotionPhase": "gauss.optimal_hybrid_motion",
    "gauss.PlannedMotion": "gauss.plan_motion",
    "gauss.Regressor": "gauss.regressor",
    "gauss.Sensitivities": "gauss.sensitivities",
    "gauss.Solution": "gauss.solve",
    "gauss.State": ".initial_state",
    "gauss.StaticEquilibrium": "gauss.equilibrium",
    "gauss.System": "gauss.compile_scene",
    "gauss.Trajectory": "gauss.simulate",
}
