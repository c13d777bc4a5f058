"""Planar linkages: a crank and Assur groups, solved group by group; the same linkage as a Gauss scene.

Kinematics runs forward along the groups in closed form, forces run backward by one small linear system a group; a whole
cycle of crank angles is one call::

    Linkage --decompose--> Chain --cycle--> Cycle --work, shaking, transmission--> numbers
    Linkage --to_scene--> Scene
"""

from gauss.linkages.balancing import shaking
from gauss.linkages.chain import Chain, Dyad, Triad
from gauss.linkages.columns import table
from gauss.linkages.cycles import Cycle, cycle
from gauss.linkages.dynamics import Reduced, Run, run
from gauss.linkages.elements import Driver, Here, Link, LinkJoint, Load, Motor
from gauss.linkages.energy import kinetic, potential, power_balance, work
from gauss.linkages.kernels import cycle_kernel, reduced_kernel
from gauss.linkages.linkage import Linkage
from gauss.linkages.scene import scene_state, to_scene
from gauss.linkages.summary import report

__all__ = [
    "Chain",
    "Cycle",
    "Driver",
    "Dyad",
    "Here",
    "Link",
    "LinkJoint",
    "Linkage",
    "Load",
    "Motor",
    "Reduced",
    "Run",
    "Triad",
    "cycle",
    "cycle_kernel",
    "kinetic",
    "potential",
    "power_balance",
    "reduced_kernel",
    "report",
    "run",
    "scene_state",
    "shaking",
    "table",
    "to_scene",
    "work",
]
