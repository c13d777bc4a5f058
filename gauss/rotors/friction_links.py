"""Friction links between shafts: they stick at zero slip within bounds of Q_em, and slip with a torque law beyond them."""

from dataclasses import dataclass

from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.rotors.links import LinkKinematics, ShaftLink
from gauss.rotors.traction import Curve, as_curve, symmetric_slip
from gauss.scene import values
from gauss.scene.losses import keep_efficiencies


@dataclass(frozen=True)
class FrictionDrive(ShaftLink):
    """Friction drive: its slip follows the traction characteristic.

    Parameters
    ----------
    curve : Hyperbola, Measured, Characteristic, (A, B, C), dict or callable
        Torque on the driven shaft [N m] over the slip; see :mod:`gauss.rotors.traction`.
    efficiency, back_efficiency : float
        η and η̄ as of a :class:`GearPair`; the loss by slip comes on top.
    largest_slip : float, optional
        End of the fitted range of the curve; an event reports when it is left.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> belt = fan.friction_drive("belt", wheel, motor, ratio=2.0, curve=(300.0, 6.0, 0.02))
    >>> belt.ratio, type(belt.curve).__name__
    (2.0, 'Hyperbola')
    """

    kind = "friction drive"
    curve: Curve = None  # type: ignore[assignment]  # checked in __post_init__
    efficiency: float = 1.0
    back_efficiency: float = None  # type: ignore[assignment]  # a float after __post_init__
    largest_slip: float | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        super().__post_init__()
        values.keep(self, curve=as_curve(self.curve, self.what))
        keep_efficiencies(self)
        if self.largest_slip is not None:
            limit = values.number(self.largest_slip, f"{self.what}: largest_slip", "1", positive=True)
            values.keep(self, largest_slip=limit)

    @property
    def dry(self) -> bool:
        """Whether it can stick: its torque at vanishing slip is not zero."""
        return self.curve.threshold > 0

    def effort(self, ends: LinkKinematics, state: Scalar) -> Scalar:
        """Q_em of the characteristic."""
        sense = 1.0 if self.ratio > 0 else -1.0
        torque = sense * self.curve(symmetric_slip(ends.v_d, ends.v, ends.v_0), sense * state)
        return torque * state * state if self.dry else torque

    def bounds(self, t: float) -> tuple[float, float]:
        """Sticking torques up to the threshold [N m]."""
        return -self.curve.threshold, self.curve.threshold


@dataclass(frozen=True)
class FrictionClutch(ShaftLink):
    """Friction clutch: sticks up to static · torque, slips with ``torque``.

    Parameters
    ----------
    torque : float, dict or Interpolant
        Torque while it slips [N m]; a table {time [s], torque [N m]} of straight lines describes its engagement.
    static : float
        Static over sliding friction, at least 1.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> clutch = fan.clutch("clutch", wheel, motor, torque=30.0, static=1.2)
    >>> push = fan.torque(motor, rotors.Constant(20.0))
    >>> rotors.snapshot(fan).accelerations.round(3)  # it sticks: 20 / (0.1 + 0.5)
    array([33.333, 33.333])
    """

    kind = "clutch"
    torque: float | Interpolant = None  # type: ignore[assignment]  # checked in __post_init__
    static: float = 1.0

    dry = True

    def __post_init__(self) -> None:
        """Check every value."""
        super().__post_init__()
        if isinstance(self.torque, dict):
            if set(self.torque) != {"time", "torque"}:
                raise SceneError(f"{self.what}: torque: a table has time [s] and torque [N m], got {sorted(self.torque)}.")
            time, torque = points(self.torque["time"], self.torque["torque"], self.what, "time", "s", "torque", "N m")
            if min(torque) < 0:
                raise SceneError(f"{self.what}: torque: no entry may be negative.")
            values.keep(self, torque=Interpolant(time, torque, smooth=False))
        elif not isinstance(self.torque, Interpolant):
            checked = values.number(self.torque, f"{self.what}: torque", "N m", non_negative=True)
            values.keep(self, torque=checked)
        static = values.number(self.static, f"{self.what}: static", "1", positive=True)
        if static < 1:
            raise SceneError(f"{self.what}: static: expected at least 1, got {static:g}; sliding friction is not larger.")
        values.keep(self, static=static)

    @property
    def corners(self) -> tuple[float, ...]:
        """Times of the corners of its table [s]."""
        return self.torque.x if isinstance(self.torque, Interpolant) else ()

    def _slipping(self, t: Scalar) -> Scalar:
        return self.torque(t) if isinstance(self.torque, Interpolant) else self.torque

    def effort(self, ends: LinkKinematics, state: Scalar) -> Scalar:
        """Q_em while it slips [N m]."""
        return state * self._slipping(ends.t)

    def bounds(self, t: float) -> tuple[float, float]:
        """Sticking torques up to the static one [N m]."""
        limit = self.static * float(self._slipping(t))  # type: ignore[arg-type]  # a number at a number
        return -limit, limit


@dataclass(frozen=True)
class TorqueLimiter(FrictionClutch):
    """Slip hub: a clutch that is always engaged.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Shafts.
    ratio : float
        i = ω_driver/ω_driven.
    torque : float, dict or Interpolant
        Torque while it slips [N m].
    static : float
        Static over sliding friction, at least 1.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> limiter = fan.torque_limiter("limiter", wheel, motor, torque=15.0)
    >>> push = fan.torque(motor, rotors.Constant(6.0))
    >>> rotors.snapshot(fan).accelerations.round(3)  # below its limit it is rigid
    array([10., 10.])
    """

    kind = "torque limiter"


@dataclass(frozen=True)
class OneWayClutch(ShaftLink):
    """Freewheel: the driver drives the driven shaft, which overruns it freely.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Shafts.
    ratio : float
        i = ω_driver/ω_driven.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> freewheel = fan.one_way("freewheel", wheel, motor)
    >>> push = fan.torque(motor, rotors.Constant(12.0))
    >>> rotors.snapshot(fan).accelerations.round(3)  # it drives: 12 / (0.1 + 0.5)
    array([20., 20.])
    """

    kind = "one-way clutch"
    dry = True

    def bounds(self, t: float) -> tuple[float, float]:
        """Driving torques without limit, none in the other direction [N m]."""
        return 0.0, float("inf")
