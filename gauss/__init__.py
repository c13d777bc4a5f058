"""Dynamics of mechanisms by Gauss's principle of least constraint.

A scene is compiled into a system; in every state the system has a compulsion, whose least value gives the accelerations
and reactions; a simulation follows them to a trajectory::

    Scene --compile_scene--> System --assemble--> Compulsion --solve--> Solution
    Scene --simulate--> Trajectory --reactions, energy--> numbers

Planar linkages are also solved by Assur groups, a whole cycle in one call: :class:`gauss.Linkage`.
"""

from gauss.assembly import Motion, assemble
from gauss.audit import constraint_forces, drive_forces, energy, inverse_dynamics, reactions
from gauss.backends import choose, solve
from gauss.compulsion import Compulsion, Solution
from gauss.crosscheck import crosscheck
from gauss.errors import GaussError
from gauss.io import catalog, load, load_linkage, save
from gauss.linkages import Linkage
from gauss.scene import Body, Constraint, Coupling, Drive, Force, Frame, Joint, JointSpring, Scene, Spring, Start
from gauss.simulation import Trajectory, assembly_modes, compile_scene, mobility, rollout, simulate
from gauss.system import State, System

__all__ = [
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
    "Linkage",
    "Motion",
    "Scene",
    "Solution",
    "Spring",
    "Start",
    "State",
    "System",
    "Trajectory",
    "assemble",
    "assembly_modes",
    "catalog",
    "choose",
    "compile_scene",
    "constraint_forces",
    "crosscheck",
    "drive_forces",
    "energy",
    "inverse_dynamics",
    "load",
    "load_linkage",
    "mobility",
    "reactions",
    "rollout",
    "save",
    "simulate",
    "solve",
]
