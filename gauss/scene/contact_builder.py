"""Builder methods of a scene for collision shapes, unilateral constraints and set-valued elements."""

from itertools import combinations, product

from gauss import scene as elements
from gauss.errors import SceneError, did_you_mean
from gauss.scene.builder import SceneBuilder, name_of
from gauss.scene.contact_pairs import have_rule


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

    def ellipsoid(self, name: str, body, radii, at=(0, 0, 0), rotation=(0, 0, 0)) -> "elements.Ellipsoid":
        """Give a body an ellipsoid of three half axes [m]; see :class:`gauss.scene.Ellipsoid`."""
        return self.add(elements.Ellipsoid(name, name_of(body), at, radii, rotation))

    def cylinder(self, name: str, body, radius: float, length: float, at=(0, 0, 0), axis=(0, 0, 1)) -> "elements.Cylinder":
        """Give a body a cylinder with flat ends; see :class:`gauss.scene.Cylinder`."""
        return self.add(elements.Cylinder(name, name_of(body), at, radius, length, axis))

    def cone(self, name: str, body, radius: float, length: float, at=(0, 0, 0), axis=(0, 0, 1)) -> "elements.Cone":
        """Give a body a cone; see :class:`gauss.scene.Cone`."""
        return self.add(elements.Cone(name, name_of(body), at, radius, length, axis))

    def mesh(self, name: str, body, vertices, at=(0, 0, 0), rotation=(0, 0, 0), faces=()) -> "elements.ConvexMesh":
        """Give a body the convex hull of points [m]; see :class:`gauss.scene.ConvexMesh`."""
        return self.add(elements.ConvexMesh(name, name_of(body), at, vertices, rotation, faces))

    def points(self, name: str, body, points, radius: float = 0.0, at=(0, 0, 0)) -> "elements.Points":
        """Give a body feet: points, or balls around them; see :class:`gauss.scene.Points`."""
        return self.add(elements.Points(name, name_of(body), at, points, radius))

    def half_space(self, name: str, body="ground", at=(0, 0, 0), normal=(0, 0, 1)) -> "elements.HalfSpace":
        """Make everything behind a plane solid: a floor, a wall; see :class:`gauss.scene.HalfSpace`."""
        return self.add(elements.HalfSpace(name, name_of(body), at, normal))

    def height_field(
        self, name: str, body, heights, size, at=(0, 0, 0), rotation=(0, 0, 0), depth: float = 1.0
    ) -> "elements.HeightField":
        """Give a body or the ground terrain: heights [m] on a grid; see :class:`gauss.scene.HeightField`."""
        return self.add(elements.HeightField(name, name_of(body), at, heights, size, rotation, depth))

    def contact(self, name: str, shape, other, restitution: float = 0.0, friction: float = 0.0) -> "elements.Contact":
        """Add a contact of two shapes; see :class:`gauss.scene.Contact`."""
        return self.add(elements.Contact(name, name_of(shape), name_of(other), restitution, friction))

    def contacts_all(self, exclude=(), friction: float = 0.0, restitution: float = 0.0) -> "list[elements.Contact]":
        """Let all shapes touch each other that may, and return the contacts.

        Pairs on one body, on two bodies that a joint joins, and of which nothing moves are left out, and pairs that have a
        contact already. A body on a joint from the ground touches the ground. Contacts are named after their shapes, the one
        declared later first, as in "ball on floor": the names that :func:`gauss.contact_forces` takes.

        Parameters
        ----------
        exclude : sequence of (str, str)
            Further pairs that are left out, by names of shapes or of bodies.
        friction, restitution : float
            Of all these contacts; see :class:`gauss.scene.Contact`.

        Raises
        ------
        SceneError
            If a name of ``exclude`` is none of a shape or body.
        """
        try:
            excluded = {frozenset(map(name_of, pair)) for pair in exclude}
        except TypeError:
            expected = "pairs of names of shapes or bodies"
            raise SceneError(f"contacts_all: exclude: expected {expected}, got {exclude!r:.80}.") from None
        known = self.shapes.keys() | self.bodies.keys() | {elements.GROUND}
        for name in sorted(set().union(*excluded) - known, key=str):
            raise SceneError(f"contacts_all: exclude: no shape or body {name!r}. {did_you_mean(str(name), known)}")
        excluded |= {frozenset((contact.shape, contact.other)) for contact in self._contacts_of_shapes()}
        joints = [joint for joint in self.joints.values() if joint.parent != elements.GROUND]
        excluded |= {frozenset((joint.parent, joint.child)) for joint in joints}
        taken, found = self._taken(), []
        pattern = elements.Contact("all contacts", "one", "other", restitution, friction)
        for one, other in combinations(self.shapes.values(), 2):
            if self._may_touch(one, other, excluded):
                name = f"{other.name} on {one.name}"
                self._require_new(name, "contact", taken)
                found.append(pattern.between(name, other.name, one.name))
        self.contacts.update({contact.name: contact for contact in found})
        return found

    def _contacts_of_shapes(self) -> "list[elements.Contact]":
        return [contact for contact in self.contacts.values() if isinstance(contact, elements.Contact)]

    def _may_touch(self, one: "elements.Collider", other: "elements.Collider", excluded: set[frozenset[str]]) -> bool:
        """Whether two shapes move relative to each other, have a rule of contact, and are not excluded."""
        bodies = [self.frames[shape.body].body if shape.body in self.frames else shape.body for shape in (one, other)]
        if bodies[0] == bodies[1] or not have_rule(one, other):
            return False
        names = product((one.name, bodies[0]), (other.name, bodies[1]))
        return excluded.isdisjoint(map(frozenset, names))

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
