"""Constraints between joint coordinates: cams q₂ = f(q₁), and gearing of variable ratio q̇₂ = i(q) q̇₁."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class Cam(Relation):
    """Follower whose coordinate is a given function of that of the cam. One row.

    Parameters
    ----------
    name : str
        Name of the cam.
    cam, follower : str
        Joints of one freedom, or single rates of joints ("C.slide").
    profile : callable or spline
        Coordinate of the follower [m, rad] as a function of that of the cam; a periodic spline goes on for ever.
    """

    cam: str
    follower: str
    profile: Callable

    joints: ClassVar[tuple[str, ...]] = ("cam", "follower")

    def __post_init__(self):
        """Check the profile."""
        what = f"cam {values.text(self.name, 'name of a cam')!r}"
        if not callable(self.profile):
            raise SceneError(f"{what}: profile must be a function or a spline, got {self.profile!r}.")
        values.keep(self, profile=values.smooth_law(self.profile, f"{what}: profile", "m or rad"))

    def positions(self, at) -> list:
        """Follower − profile."""
        return [at.coordinate(self.follower) - values.evaluate(self.profile, at.coordinate(self.cam))]


@dataclass(frozen=True)
class Transmission(Relation):
    """Gearing without slip whose ratio varies: q̇_driven = ratio · q̇_driver. One row, nonholonomic in general.

    Parameters
    ----------
    name : str
        Name of the transmission.
    driven, driver : str
        Joints of one freedom, or single rates of joints.
    ratio : callable
        ``ratio(at)`` of a view of the mechanism, e.g. ``lambda at: 1.0 + at.coordinate("lever")``.
    """

    driven: str
    driver: str
    ratio: Callable

    joints: ClassVar[tuple[str, ...]] = ("driven", "driver")

    def __post_init__(self):
        """Check that there is a ratio."""
        what = f"transmission {values.text(self.name, 'name of a transmission')!r}"
        if not callable(self.ratio):
            raise SceneError(f"{what}: ratio must be a function of a view, got {self.ratio!r}; use couple for a constant.")
        if self.driven == self.driver:
            raise SceneError(f"{what}: joint {self.driven!r} cannot drive itself.")

    def velocities(self, at) -> list:
        """Velocity residual."""
        return [at.rate(self.driven) - self.ratio(at) * at.rate(self.driver)]
