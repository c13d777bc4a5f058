"""Forces of a chain of groups in a given motion: backward, group after group."""

from collections.abc import Sequence

from gauss.linkages import dyad as dyads
from gauss.linkages import triad as triads
from gauss.linkages.chain import Dyad
from gauss.linkages.elements import LinkJoint
from gauss.linkages.loads import acting, centre
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.placed import Complex, Pose, Real, Wrench
from gauss.linkages.plane import dot, left, pair
from gauss.scene import GROUND


def react(motion: LinkageKinematics) -> tuple[dict[str, Complex], Real]:
    """Reactions of all joints, and the torque that the motor exerts on the crank.

    Returns
    -------
    reactions : dict
        Joint → R_x + i R_y [N] of a pin, R_n + i R_m [N, N m] of a slide, on its child.
    torque : float
        M1 [N m].
    """
    chain, found = motion.chain, {}
    required = {link.name: inertial(motion, link) for link in chain.links}
    for load in chain.loads:
        required[load.link] += -acting(load, motion)

    def pass_on(leg, outer: Wrench) -> None:
        on_child = outer if leg.joint.child == leg.name else -outer
        found[leg.joint.name] = _reaction(leg.joint, motion.links[leg.joint.child], on_child)
        if leg.carrier != GROUND:
            required[leg.carrier] += outer

    for group, freedoms in zip(reversed(chain.groups), reversed(motion.freedoms), strict=True):
        needs = tuple(required[link.name] for link in group.links)
        outers: Sequence[Wrench]
        if isinstance(group, Dyad):
            found[group.inner.name], *outers = dyads.react(freedoms, (needs[0], needs[1]))
        else:
            on_legs, outers = triads.react(freedoms, needs)
            for joint, leg, force in zip(group.inners, group.legs, on_legs, strict=True):
                found[joint.name] = force if joint.child == leg.name else -force
        for leg, outer in zip(group.legs, outers, strict=True):
            pass_on(leg, outer)
    crank = motion.links[chain.crank.name]
    at_pivot = required[chain.crank.name].about(crank.point(chain.pivot.point(chain.crank.name)))
    found[chain.pivot.name] = at_pivot.force
    return {joint.name: found[joint.name] for joint in chain.joints}, at_pivot.moment


def inertial(motion: LinkageKinematics, link) -> Wrench:
    """Inertial wrench of a link less its weight."""
    moving, G = motion.links[link.name], centre(motion, link)
    return Wrench(G, link.mass * (moving.acceleration(G) - motion.chain.gravity), link.inertia * moving.alpha)


def _reaction(joint: LinkJoint, child: Pose, on_child: Wrench) -> Complex:
    """Reaction of a joint as R_x + i R_y at a pin, R_n + i R_m at a slide, from its wrench on the child."""
    if joint.kind == "revolute":
        return on_child.force
    at = on_child.about(child.point(joint.point(joint.child)))
    normal = left(joint.direction(joint.child) * child.e)
    return pair(dot(normal, at.force), at.moment)
