"""Passes: each turns a subsystem into smaller ones with the same motion, and gives its reasons."""

from gauss.system.passes.cut import cut
from gauss.system.passes.islands import islands
from gauss.system.passes.plane import plane
from gauss.system.passes.plane_loops import plane_loops
from gauss.system.passes.repeated import repeated
from gauss.system.passes.rigid import rigid
from gauss.system.passes.sphere import sphere
from gauss.system.passes.trains import trains
from gauss.system.passes.weld import weld

__all__ = ["PASSES", "cut", "islands", "plane", "plane_loops", "repeated", "rigid", "sphere", "trains", "weld"]

# Sentence of explain(), and the pass, in the order in which they run.
PASSES = {
    "bodies without relative motion are one": weld,
    "loops that cannot move are rigid bodies": rigid,
    "islands that do not interact are stepped apart": islands,
    "mechanisms in a plane are laid into it": plane,
    "spherical mechanisms have all joints in their centre": sphere,
    "loops are cut at the cheapest joints": cut,
    "loops in a plane are closed by two rows": plane_loops,
    "joints that repeat others bring no rows": repeated,
    "gear and belt trains are one reduced inertia": trains,
}
