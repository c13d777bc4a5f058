"""Builder methods of a scene for collision shapes, unilateral constraints and set-valued elements."""

from gauss import scene as elements
from gauss.scene.builder import SceneBuilder, name_of


class ContactBuilder(SceneBuilder):
    """Builder methods for shapes, contacts, stops, ropes, friction, clutches; each adds one element and returns it."""

    def sphere(self, name: str, body, radius: float, at=(0, 0, 0)) -> "elements.Sphere":
        """Give a body a ball of a radius [m] around a point of its frame."""
        return self.add(elements.Sphere(name, name_of(body), at, radius))

    def capsule(self, name: str, body, radius: float, length: float, at=(0, 0, 0), axis=(0, 0, 1)) -> "elements.Capsule":
        """Give a body a cylinder with round ends; see :class:`gauss.scene.Capsule`."""
        return self.add(elements.Capsule(name, name_of(body), at, radius, length, axis))

    def box(self, name: str, body, size, at=(0, 0, 0), rotation=(0, 0, 0)) -> "elements.Box":
        """Give a body a box of three edges [m]; see :class:`gauss.scene.Box`."""
        return self.add(elements.Box(name, name_of(body), at, size, rotation))

    def points(self, name: str, body, points, radius: float = 0.0, at=(0, 0, 0)) -> "elements.Points":
        """Give a body feet: points, or balls around them; see :class:`gauss.scene.Points`."""
        return self.add(elements.Points(name, name_of(body), at, points, radius))

    def half_space(self, name: str, body="ground", at=(0, 0, 0), normal=(0, 0, 1)) -> "elements.HalfSpace":
        """Make everything behind a plane solid: a floor, a wall; see :class:`gauss.scene.HalfSpace`."""
        return self.add(elements.HalfSpace(name, name_of(body), at, normal))

    def contact(self, name: str, shape, other, restitution: float = 0.0, friction: float = 0.0) -> "elements.Contact":
        """Add a contact of two shapes; see :class:`gauss.scene.Contact`."""
        return self.add(elements.Contact(name, name_of(shape), name_of(other), restitution, friction))

    def stop(self, joint, lowest=None, highest=None, restitution: float = 0.0, name: str | None = None) -> "elements.Stop":
        """Let a joint run against stops; those of its ``limits`` when none is given. See :class:`gauss.scene.Stop`."""
        joint = name_of(joint)
        limits = self.joints[joint].limits if joint in self.joints else None
        if lowest is None and highest is None and limits is not None:
            lowest, highest = limits
        return self.add(elements.Stop(name or self._fresh(f"stop of {joint}"), joint, lowest, highest, restitution))

    def rope(
        self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), length=None, restitution: float = 0.0
    ) -> "elements.Rope":
        """Join points of two bodies by a rope; see :class:`gauss.scene.Rope`."""
        return self.add(elements.Rope(name, name_of(body), name_of(other), at, other_at, length, restitution))

    def joint_friction(self, joint, limit, name: str | None = None) -> "elements.JointFriction":
        """Let a joint stick and slip with a torque or force [N m, N]; see :class:`gauss.scene.JointFriction`."""
        joint = name_of(joint)
        return self.add(elements.JointFriction(name or self._fresh(f"friction of {joint}"), joint, limit))

    def clutch(self, name: str, driven, driver, torque, ratio: float = 1.0, hold=None) -> "elements.Clutch":
        """Join two joints by a friction clutch or torque limiter; see :class:`gauss.scene.Clutch`."""
        return self.add(elements.Clutch(name, name_of(driven), name_of(driver), torque, ratio, hold))

    def freewheel(self, name: str, driven, driver, ratio: float = 1.0) -> "elements.Freewheel":
        """Let a joint take another along, and be overrun by it; see :class:`gauss.scene.Freewheel`."""
        return self.add(elements.Freewheel(name, name_of(driven), name_of(driver), ratio))

    def one_sided(self, name: str, gap, restitution: float = 0.0) -> "elements.OneSidedConstraint":
        """Add a one-sided constraint of your own: a gap function g_N ≥ 0 of a view of the mechanism.

        See :class:`gauss.scene.OneSidedConstraint`. A bead above a parabolic wire::

            scene.one_sided("wire", lambda at: at.position("bead")[2] - at.position("bead")[0] ** 2)
        """
        return self.add(elements.OneSidedConstraint(name, gap, restitution))
