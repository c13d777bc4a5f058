"""Planar wrenches on links, and reactions of joints."""

from typing import NamedTuple

from gauss.linkages.elements import LinkJoint
from gauss.linkages.placed import Complex, Pose, Real, moment
from gauss.linkages.plane import dot, left, pair


class Wrench(NamedTuple):
    """Force and moment about a point."""

    x: Complex  # the point [m]
    force: Complex  # force [N]
    moment: Real  # moment about x [N m]

    def about(self, x: Complex) -> "Wrench":
        """Return the same wrench about another point."""
        return Wrench(x, self.force, self.moment + moment(self.x, self.force, x))

    def __add__(self, other: "Wrench") -> "Wrench":  # type: ignore[override]  # a sum, not a longer tuple
        other = other.about(self.x)
        return Wrench(self.x, self.force + other.force, self.moment + other.moment)

    def __neg__(self) -> "Wrench":
        return Wrench(self.x, -self.force, -self.moment)


def reaction(joint: LinkJoint, child: Pose, on_child: Wrench) -> Complex:
    """Reaction of a joint as R_x + i R_y at a pin, R_n + i R_m at a slide, from its wrench on the child."""
    if joint.kind == "revolute":
        return on_child.force
    at = on_child.about(child.point(joint.point(joint.child)))
    normal = left(joint.direction(joint.child) * child.e)
    return pair(dot(normal, at.force), at.moment)
