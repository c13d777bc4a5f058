"""Set-valued links of two joint coordinates: clutches, torque limiters, freewheels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.set_valued import SetValued, limit_at


class _Geared:
    """Links with a ratio, which is a field of every kind, at the end of its own."""

    ratio: float


@dataclass(frozen=True)
class JointLink(_Geared, SetValued):
    """Set-valued link of two joint coordinates, u = q̇_driven − q̇_driver / ratio; its force acts on the driven one.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Joints of one freedom, or single rates of joints.
    ratio : float
        Rate of the driver over that of the driven while it sticks.
    """

    driven: str
    driver: str

    joints: ClassVar[tuple[str, ...]] = ("driven", "driver")

    def _check(self):
        values.text(self.name, f"name of a {self.kind}")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: driven and driver are both {self.driven!r}; a link joins two joints.")
        values.keep(self, ratio=values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected rate of the driver over that of the driven, other than 0.")

    @property
    def acts_on(self) -> dict[str, float]:
        """Driven and driver."""
        return {self.driven: 1.0, self.driver: -1.0 / self.ratio}


@dataclass(frozen=True)
class Clutch(JointLink):
    """Friction clutch or torque limiter: two joints stick together up to a torque, and slip with ``torque``.

    Parameters
    ----------
    torque : float or callable
        Torque on the driven joint while it slips [N m, N]: a number, law(t) or law(t, motion), never negative.
    ratio : float
        Rate of the driver over that of the driven while it sticks.
    hold : float or callable, optional
        Torque up to which it sticks [N m, N], a number or law(t), not below ``torque``; ``torque`` itself when not given.
    """

    torque: float | Callable
    ratio: float = 1.0
    hold: float | Callable | None = None

    kind: ClassVar[str] = "clutch"

    def __post_init__(self):
        self._check()
        for key in ("torque", "hold"):
            value = getattr(self, key)
            if value is not None and not callable(value):
                values.keep(self, **{key: values.number(value, f"{self.what}: {key}", "N m or N", non_negative=True)})
        if self.hold is None and callable(self.torque) and values.arguments(self.torque) > 1:
            raise SceneError(f"{self.what}: its torque depends on the motion; say what it holds at rest, hold= [N m, N].")
        if not (callable(self.torque) or callable(self.hold) or self.hold is None) and self.hold < self.torque:
            raise SceneError(
                f"{self.what}: hold {self.hold:g} is below torque {self.torque:g}; friction at rest is not smaller."
            )

    def bounds(self, t):
        """Limits of sticking, the same in both directions."""
        limit = limit_at(self.torque if self.hold is None else self.hold, t, self.what)
        return -limit, limit

    def effort(self, sign):
        """Torque while it slips."""
        if not callable(self.torque):
            return sign * self.torque
        law = values.as_function(self.torque)
        return lambda t, motion: sign * law(t, motion)


@dataclass(frozen=True)
class Freewheel(JointLink):
    """One-way clutch: the driver carries the driven joint along, and is overrun by it freely."""

    ratio: float = 1.0

    kind: ClassVar[str] = "freewheel"
    one_way: ClassVar[bool] = True

    def __post_init__(self):
        self._check()

    def bounds(self, t):
        """No force in one direction, any in the other."""
        return 0.0, float("inf")

    def effort(self, sign):
        """No torque while it is overrun."""
        return 0.0
