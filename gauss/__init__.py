"""Dynamics of mechanisms by Gauss's principle of least constraint.

A scene is compiled into a system; in every state the system has a compulsion, whose least value gives the accelerations
and reactions; a simulation follows them to a trajectory::

    Scene --compile_scene--> System --assemble--> Compulsion --solve--> Solution
    Scene --simulate--> Trajectory --reactions, energy--> numbers

Planar linkages are also solved by Assur groups, a whole cycle in one call: :class:`gauss.Linkage`.

.. include:: glossary.md
"""

from importlib import import_module
from importlib.util import find_spec
from warnings import warn

from gauss.lazy import (
    constraint_forces,
    contact_forces,
    drive_forces,
    energy,
    friction_forces,
    inverse_dynamics,
    reactions,
    set_valued_forces,
)
from gauss.analysis.assembly_modes import assembly_modes
from gauss.analysis.crosscheck import crosscheck
from gauss.analysis.derivatives import derivatives
from gauss.analysis.recommendation import advise
from gauss.backends import choose, solve
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.dynamics import Baumgarte, Plan, compile_scene, mobility, paradoxes
from gauss.dynamics.assemble import assemble
from gauss.dynamics.kinematics import Kinematics
from gauss.errors import GaussError
from gauss.integrators import Taylor, generalised_alpha
from gauss.io import catalog, load, save
from gauss.scene import Body, Constraint, Coupling, Drive, Force, Frame, Joint, JointSpring, Scene, Spring, Start
from gauss.simulation import Trajectory, crossings, rollout, simulate
from gauss.system import State, System
from gauss.versions import VERSION as __version__  # noqa: F401
from gauss.versions import load_linkage
    from gauss.io.rotors import load_rotors, save_rotors
    from gauss.linkages import Linkage
    from gauss.simulation.sweeps import load_sweep, sweep
    from gauss.view.viewer import show

__all__ = [
    "Baumgarte",
    "Body",
    "Compulsion",
    "Constraint",
    "Coupling",
    "Drive",
    "Force",
    "Frame",
    "GaussError",
    "Joint",
    "JointSpring",
    "Kinematics",
    "Linkage",
    "Plan",
    "Scene",
    "Solution",
    "Spring",
    "Start",
    "State",
    "System",
    "Taylor",
    "Trajectory",
    "advise",
    "assemble",
    "assembly_modes",
    "catalog",
    "choose",
    "compile_scene",
    "constraint_forces",
    "contact_forces",
    "crosscheck",
    "crossings",
    "derivatives",
    "drive_forces",
    "energy",
    "friction_forces",
    "generalised_alpha",
    "inverse_dynamics",
    "load",
    "load_linkage",
    "load_motion",
    "load_rotors",
    "load_sweep",
    "mobility",
    "paradoxes",
    "reactions",
    "rollout",
    "save",
    "save_rotors",
    "set_valued_forces",
    "show",
    "simulate",
    "solve",
    "sweep",
    "to_dataset",
    "to_table",
]

# Imported when they are first asked for: the time from nothing to a first result counts.
__all__, later, _ = attach(__name__, __file__)

RENAMED = {
    "Motion": "Kinematics",
    "grip_forces": "set_valued_forces",
    "outlook": "advise",
}  # former names, and those of today
MODULES = ("errors", "linkages", "math", "rotors", "scene", "servo", "view")  # to be used by name
NEEDS = {"show": ("matplotlib", "viser"), "view": ("matplotlib",)}  # packages without which a name is not there


def __getattr__(name: str):
    """Return a public name or a module of this package, or what goes by another name now."""
    if name == "sweeps":
        warn("gauss.sweeps is called gauss.simulation.sweeps now.", DeprecationWarning, stacklevel=2)
        return import_module("gauss.simulation.sweeps")
    return later(current_name(__name__, RENAMED, name) if name in RENAMED else name)


def __dir__() -> list[str]:
    """Names that are meant to be used."""
    missing = {name for name, packages in NEEDS.items() if not all(find_spec(package) for package in packages)}
    there = {name for name in globals() if name.startswith("__")}
    return sorted(there | {*__all__, *MODULES} - missing)
