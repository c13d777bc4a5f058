"""Planar linkages: a crank and Assur groups, solved group by group; the same linkage as a Gauss scene.

Kinematics runs forward along the groups in closed form, forces run backward by one small linear system a group; a whole
cycle of crank angles is one call::

    Linkage --decompose--> Chain --cycle--> Cycle --work, shaking, transmission--> numbers
    Linkage --to_scene--> Scene
"""

from gauss.arguments import named_arguments, named_methods
from gauss.linkages.balancing import shaking
from gauss.linkages.chain import Chain, Dyad, Triad
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.cycles import cycle
from gauss.linkages.dynamics import CrankRun, ReducedLinkage, run
from gauss.linkages.elements import CrankMotor, Driver, Here, LinkJoint, Load, PlanarLink
from gauss.linkages.energy import kinetic, potential, power_balance, work
from gauss.linkages.four_bar import FourBarDesign
from gauss.linkages.kernels import cycle_kernel, reduced_kernel
from gauss.linkages.linkage import Linkage
from gauss.linkages.motion_generation import motion_generation
from gauss.linkages.report import coupler_curves, report, table
from gauss.linkages.scene import scene_state, to_scene
from gauss.linkages.synthesis import function_generation, path_generation
from gauss.versions import current_name

__all__ = [
    "Chain",
    "CrankMotor",
    "CrankRun",
    "Cycle",
    "Driver",
    "Dyad",
    "FourBarDesign",
    "Here",
    "LinkJoint",
    "Linkage",
    "Load",
    "PlanarLink",
    "ReducedLinkage",
    "Triad",
    "coupler_curves",
    "cycle",
    "cycle_kernel",
    "function_generation",
    "kinetic",
    "motion_generation",
    "path_generation",
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

RENAMED = {  # former names, and those of today
    "Link": "PlanarLink",
    "Motor": "CrankMotor",
    "Reduced": "ReducedLinkage",
    "Run": "CrankRun",
}


named_methods(named_arguments(Linkage))


def __getattr__(name: str):
    """Return what goes by another name now."""
    return globals()[current_name(__name__, RENAMED, name)]
