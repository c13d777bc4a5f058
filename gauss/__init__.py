"""Dynamics of mechanisms by Gauss's principle of least constraint.

A scene is compiled into a system; in every state the system has a compulsion, whose least value gives the accelerations
and reactions; a simulation follows them to a trajectory::

    Scene --compile_scene--> System --assemble--> Compulsion --solve--> Solution
    Scene --simulate--> Trajectory --reactions, energy--> numbers

Planar linkages are also solved by Assur groups, a whole cycle in one call: :class:`gauss.Linkage`.
"""

from importlib import import_module
from importlib.util import find_spec

from gauss.lazy import attach
from gauss.versions import VERSION as __version__  # noqa: F401
from gauss.versions import current_name, warn_of_former_name

# Imported when they are first asked for: the time from nothing to a first result counts.
__all__, later, _ = attach(__name__, __file__)

RENAMED = {  # former names, and those of today
    "Motion": "Kinematics",
    "grip_forces": "set_valued_forces",
    "outlook": "advise",
}
MODULES = ("errors", "linkages", "math", "rotors", "scene", "servo", "view")  # to be used by name
NEEDS = {"show": ("matplotlib", "viser"), "view": ("matplotlib",)}  # packages without which a name is not there


def __getattr__(name: str):
    """Return a public name or a module of this package, or what goes by another name now."""
    if name == "sweeps":
        warn_of_former_name("gauss.sweeps", "gauss.simulation.sweeps")
        return import_module("gauss.simulation.sweeps")
    return later(current_name(__name__, RENAMED, name) if name in RENAMED else name)


def __dir__() -> list[str]:
    """Names that are meant to be used."""
    missing = {name for name, packages in NEEDS.items() if not all(find_spec(package) for package in packages)}
    there = {name for name in globals() if name.startswith("__")}
    return sorted(there | {*__all__, *MODULES} - missing)
