"""Constraints between joint coordinates: cams q₂ = f(q₁), sums Σ cᵢ qᵢ = c, and gearing of variable ratio q̇₂ = i(q) q̇₁."""

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
        what = f"cam {values.text(self.name, 'name of a cam')!r}"
        if not callable(self.profile):
            raise SceneError(f"{what}: profile must be a function or a spline, got {self.profile!r}.")
        values.keep(self, profile=values.smooth_law(self.profile, f"{what}: profile", "m or rad"))

    def positions(self, at) -> list:
        """Follower − profile."""
        return [at.coordinate(self.follower) - values.evaluate(self.profile, at.coordinate(self.cam))]


@dataclass(frozen=True)
class LinearCoupling(Relation):
    """Sum of joint coordinates that is constant, Σ cᵢ qᵢ = c: a belt over several joints, a differential. One row.

    Parameters
    ----------
    name : str
        Name of the coupling.
    coupled : tuple of str
        Joints of one freedom, or single rates of joints, at least two.
    coefficients : tuple of float
        cᵢ, one for each, none of them 0.
    constant : float
        c [rad or m, of a coefficient of 1].
    """

    coupled: tuple[str, ...]
    coefficients: tuple[float, ...]
    constant: float = 0.0

    joints: ClassVar[tuple[str, ...]] = ("coupled",)

    def __post_init__(self):
        what = f"linear coupling {values.text(self.name, 'name of a linear coupling')!r}"
        if isinstance(self.coupled, str) or not all(isinstance(joint, str) for joint in self.coupled):
            raise SceneError(f"{what}: coupled must be names of joints, got {self.coupled!r}.")
        values.keep(self, coupled=tuple(self.coupled))
        if len(set(self.coupled)) != len(self.coupled) or len(self.coupled) < 2:
            raise SceneError(f"{what}: expected two or more different joints, got {', '.join(self.coupled) or 'none'}.")
        given = values.vector(self.coefficients, f"{what}: coefficients", "1", len(self.coupled))
        if not all(given):
            raise SceneError(f"{what}: coefficients must not be 0, got {given}; leave the joint out.")
        values.keep(self, coefficients=given, constant=values.number(self.constant, f"{what}: constant", "rad or m"))

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"linear coupling {self.name!r}"

    def positions(self, at) -> list:
        """Sum less the constant."""
        terms = zip(self.coefficients, self.coupled, strict=True)
        return [sum((c * at.coordinate(joint) for c, joint in terms), 0.0) - self.constant]


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
        what = f"transmission {values.text(self.name, 'name of a transmission')!r}"
        if not callable(self.ratio):
            raise SceneError(f"{what}: ratio must be a function of a view, got {self.ratio!r}; use couple for a constant.")
        if self.driven == self.driver:
            raise SceneError(f"{what}: joint {self.driven!r} cannot drive itself.")

    def velocities(self, at) -> list:
        """Velocity residual."""
        return [at.rate(self.driven) - self.ratio(at) * at.rate(self.driver)]
