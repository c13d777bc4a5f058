"""Builder methods of a scene for bilateral constraints beyond the joints; :class:`SceneBuilder` is what they share."""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from gauss import scene as elements
from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.joint import Coupling
from gauss.scene.names import SceneNames
from gauss.scene.relation import Constraint

Element = TypeVar("Element")


class SceneBuilder(SceneNames):
    """Builder methods of a scene stand on its names and on one operation."""

    def add(self, element: Element) -> Element:
        """Add an element and return it."""
        raise NotImplementedError


class ConstraintBuilder(SceneBuilder):
    """Builder methods for bilateral constraints; each adds one element and returns it."""

    def coincident(self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0)) -> "elements.Coincident":
        """Let points of two bodies coincide."""
        return self.add(elements.Coincident(name, name_of(body), name_of(other), at, other_at))

    def distance(self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), length=None) -> "elements.Distance":
        """Keep points of two bodies at a distance [m], or at a law of time; see :class:`gauss.scene.Distance`."""
        return self.add(elements.Distance(name, name_of(body), name_of(other), at, other_at, length))

    def on_plane(self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), normal=(0, 0, 1)) -> "elements.OnPlane":
        """Keep a point of a body on a plane of another."""
        return self.add(elements.OnPlane(name, name_of(body), name_of(other), at, other_at, normal))

    def on_line(self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), axis=(1, 0, 0)) -> "elements.OnLine":
        """Keep a point of a body on a line of another."""
        return self.add(elements.OnLine(name, name_of(body), name_of(other), at, other_at, axis))

    def on_curve(self, name: str, body, other, curve, at=(0, 0, 0), other_at=(0, 0, 0)) -> "elements.OnCurve":
        """Keep a point of a body on a curve or surface of another, given by equations; see :class:`gauss.scene.OnCurve`."""
        return self.add(elements.OnCurve(name, name_of(body), name_of(other), at, other_at, curve))

    def angle(self, name: str, body, other, axis=(0, 0, 1), other_axis=(0, 0, 1), angle=None) -> "elements.Angle":
        """Keep axes of two bodies at an angle [rad], or at a law of time; see :class:`gauss.scene.Angle`."""
        return self.add(elements.Angle(name, name_of(body), name_of(other), axis=axis, other_axis=other_axis, angle=angle))

    def gear(self, name: str, body, other, teeth, at=(0, 0, 0), other_at=(0, 0, 0), **options) -> "elements.Gear":
        """Let two wheels mesh: external, internal or bevel; see :class:`gauss.scene.Gear`."""
        return self.add(elements.Gear(name, name_of(body), name_of(other), at, other_at, teeth, **options))

    def rack(
        self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), axis=(0, 0, 1), along=(1, 0, 0)
    ) -> "elements.Rack":
        """Let a wheel roll along a rack; see :class:`gauss.scene.Rack`."""
        return self.add(elements.Rack(name, name_of(body), name_of(other), at, other_at, axis, along))

    def belt(self, name: str, driven, driver, radii, crossed: bool = False) -> Coupling:
        """Couple two pulleys on one carrier by a belt that does not slip.

        Parameters
        ----------
        name : str
            Name of the coupling.
        driven, driver : str or Joint
            Joints of the pulleys.
        radii : tuple of float
            Radii of the driven pulley and of the driver [m].
        crossed : bool
            Whether the belt crosses itself, so that the pulleys turn against each other.
        """
        one, two = values.vector(radii, f"belt {name!r}: radii", "m", 2)
        if min(one, two) <= 0:
            raise SceneError(f"belt {name!r}: radii must be positive, got {(one, two)}.")
        return self.add(Coupling(name, name_of(driven), name_of(driver), (-1.0 if crossed else 1.0) * two / one))

    def lossy_gear(
        self, name: str, driven, driver, ratio: float, efficiency: float = 1.0, **options
    ) -> "elements.LossyGear":
        """Gear two joints with losses, by an efficiency or a constant slip; see :class:`gauss.scene.LossyGear`."""
        return self.add(elements.LossyGear(name, name_of(driven), name_of(driver), ratio, efficiency, **options))

    def cam(self, name: str, cam, follower, profile) -> "elements.Cam":
        """Let a follower's coordinate be a function of the cam's; see :class:`gauss.scene.Cam`."""
        return self.add(elements.Cam(name, name_of(cam), name_of(follower), profile))

    def linear_coupling(self, name: str, terms: Mapping[str, float], constant: float = 0.0) -> "elements.LinearCoupling":
        """Keep a sum of joint coordinates, coefficients by joint, at a constant; see :class:`gauss.scene.LinearCoupling`."""
        if not isinstance(terms, Mapping):
            raise SceneError(f"linear coupling {name!r}: terms: expected coefficients by joint, got {terms!r:.80}.")
        return self.add(elements.LinearCoupling(name, tuple(map(name_of, terms)), tuple(terms.values()), constant))

    def transmission(self, name: str, driven, driver, ratio) -> "elements.Transmission":
        """Gear two joints by a ratio that varies; see :class:`gauss.scene.Transmission`."""
        return self.add(elements.Transmission(name, name_of(driven), name_of(driver), ratio))

    def rolling(
        self, name: str, body, other, radius: float, at=(0, 0, 0), other_at=(0, 0, 0), **options
    ) -> "elements.Rolling":
        """Let a ball, wheel or disk roll without slipping; see :class:`gauss.scene.Rolling`."""
        return self.add(elements.Rolling(name, name_of(body), name_of(other), at, other_at, radius, **options))

    def knife_edge(
        self, name: str, body, other="ground", at=(0, 0, 0), edge=(1, 0, 0), normal=(0, 0, 1)
    ) -> "elements.KnifeEdge":
        """Let a blade slide along its edge only."""
        return self.add(elements.KnifeEdge(name, name_of(body), name_of(other), at, edge=edge, normal=normal))

    def guide(self, name: str, body, path, at=(0, 0, 0), **options) -> "elements.Guided":
        """Lead a point of a body along a path in time; see :class:`gauss.scene.Guided`."""
        return self.add(elements.Guided(name, name_of(body), at, path, **options))

    def constrain(self, name: str, position=None, velocity=None) -> Constraint:
        """Add a constraint of your own: functions of a view of the mechanism that return residuals.

        See :class:`gauss.Constraint`. A pendulum bob on a rod of 2 m, and a skate::

            scene.constrain("rod", lambda at: at.position("bob") @ at.position("bob") - 4.0)
            scene.constrain("blade", velocity=lambda at: at.rotation("skate")[:, 1] @ at.velocity("skate"))
        """
        return self.add(Constraint(name, position, velocity))


def name_of(thing) -> str:
    """Name of an element, or the name itself; SceneError of lists and arrays, which are neither."""
    if isinstance(thing, str):
        return thing
    if isinstance(thing, list | np.ndarray):
        raise SceneError(f"expected an element of the scene or its name, got {thing!r:.80}.")
    return getattr(thing, "name", thing)
