"""Nonholonomic constraints: rolling without slip, and the knife edge."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.rotations import cross
from gauss.scene import values
from gauss.scene.geometry import Between


@dataclass(frozen=True)
class Rolling(Between):
    """Ball, wheel or thin disk that rolls without slipping on a plane, or a ball on a ball or in a bowl.

    Three rows: the contact keeps its distance [m], and the material points that touch have no velocity against each other
    along the two directions of the tangent plane [m/s].

    Parameters
    ----------
    body : str
        What rolls.
    other : str
        What it rolls on.
    at : array_like, shape (3,)
        Centre of the ball or wheel [m].
    other_at : array_like, shape (3,)
        A point of the plane, or the centre of the ball or bowl [m].
    radius : float
        Largest radius of the wheel, or radius of the ball [m].
    crown : float, optional
        Radius of the rim across its edge [m]: ``radius`` for a ball (when not given), 0 for a thin disk.
    axis : array_like, shape (3,)
        Axis of the wheel, in its frame; a ball has none.
    normal : array_like, shape (3,)
        Normal of the plane, in the frame of the other, towards what rolls.
    on_radius : float, optional
        Radius of the ball on which a ball rolls [m]; negative for a bowl in which it rolls.
    """

    radius: float = 1.0
    crown: float | None = None
    axis: tuple = (0.0, 0.0, 1.0)
    normal: tuple = (0.0, 0.0, 1.0)
    on_radius: float | None = None

    kind: ClassVar[str] = "rolling contact"

    def __post_init__(self):
        super().__post_init__()
        values.keep(
            self,
            radius=values.number(self.radius, f"{self.what}: radius", "m", positive=True),
            axis=values.direction(self.axis, f"{self.what}: axis"),
            normal=values.direction(self.normal, f"{self.what}: normal"),
        )
        if self.crown is not None:
            values.keep(self, crown=values.number(self.crown, f"{self.what}: crown", "m", non_negative=True))
            if self.crown > self.radius:
                raise SceneError(f"{self.what}: crown {self.crown} m is larger than the radius {self.radius} m.")
        if self.on_radius is not None:
            values.keep(self, on_radius=values.number(self.on_radius, f"{self.what}: on_radius", "m"))
            if not self.is_ball or -self.radius <= self.on_radius <= 0:
                raise SceneError(
                    f"{self.what}: only a ball rolls on a ball (on_radius > 0), or in a bowl that is larger than itself "
                    f"(on_radius < −{self.radius}); got on_radius {self.on_radius}, crown {self.crown}."
                )

    @property
    def is_ball(self) -> bool:
        """Whether what rolls is round in every direction."""
        return self.crown is None or self.crown == self.radius

    def positions(self, at) -> list:
        """Height of the lowest point."""
        return [self._contact(at)[1]]

    def velocities(self, at) -> list:
        """Slip along the tangent plane."""
        place, _, normal, across = self._contact(at)
        slip = at.velocity_at(self.body, place) - at.velocity_at(self.other, place)
        return [direction @ slip for direction in (across, cross(normal, across))]

    def _contact(self, at):
        """Place that touches (3,), its height, the normal, and a direction of the tangent plane."""
        gap, centre = self.gap(at), at.position(self.body, self.at)
        if self.on_radius is not None:
            distance = np.sqrt(gap @ gap)
            side = 1.0 if self.on_radius > 0 else -1.0
            normal = side * gap / distance
            height = side * (distance - abs(self.on_radius)) - self.radius
            return centre - self.radius * normal, height, normal, _across(normal, self._away(at, normal))
        basis = rotations.along(values.unit(self.normal))
        normal, across = (at.rotation(self.other) @ basis[:, k] for k in (2, 0))
        if self.is_ball:
            return centre - self.radius * normal, normal @ gap - self.radius, normal, across
        assert self.crown is not None  # else it is a ball
        axis = at.rotation(self.body) @ values.unit(self.axis)
        lean = axis @ normal
        steep = np.sqrt(1.0 - lean * lean)
        down = (lean * axis - normal) / steep  # in the plane of the wheel, towards the ground
        place = centre + (self.radius - self.crown) * down - self.crown * normal
        return place, normal @ gap - (self.radius - self.crown) * steep - self.crown, normal, cross(axis, normal) / steep

    def _away(self, at, normal) -> np.ndarray:
        """An axis of the other body that is far from the normal at the reference configuration."""
        (_, p), (R_other, p_other) = at.reference(self.body), at.reference(self.other)
        gap = p - p_other - R_other @ np.array(self.other_at)
        return at.rotation(self.other) @ np.eye(3)[int(np.argmin(np.abs(R_other.T @ gap)))]


def _across(normal, away):
    direction = cross(normal, away)
    return direction / np.sqrt(direction @ direction)


@dataclass(frozen=True)
class KnifeEdge(Between):
    """Blade whose point moves along its edge only: a skate, a sleigh, a steered wheel without slip sideways. One row [m/s].

    Parameters
    ----------
    body : str
        What carries the blade.
    other : str
        What it stands on.
    at : array_like, shape (3,)
        Point of the blade [m].
    edge : array_like, shape (3,)
        Direction of the blade, in the frame of the body.
    normal : array_like, shape (3,)
        Normal of the ground, in the frame of the other.
    """

    edge: tuple = (1.0, 0.0, 0.0)
    normal: tuple = (0.0, 0.0, 1.0)

    kind: ClassVar[str] = "knife edge"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, edge=values.direction(self.edge, f"{self.what}: edge"))
        values.keep(self, normal=values.direction(self.normal, f"{self.what}: normal"))

    def velocities(self, at) -> list:
        """Velocity across the blade."""
        normal, edge = at.rotation(self.other) @ values.unit(self.normal), at.rotation(self.body) @ values.unit(self.edge)
        sideways = cross(normal, edge)
        place = at.position(self.body, self.at)
        slip = at.velocity_at(self.body, place) - at.velocity_at(self.other, place)
        return [sideways @ slip / np.sqrt(sideways @ sideways)]
