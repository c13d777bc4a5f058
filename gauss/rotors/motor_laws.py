"""Torque–speed characteristics of motors: straight line, Kloss (Archiv für Elektrotechnik 5 (1916) 59), d.c., diesel."""

from dataclasses import dataclass
from functools import cached_property

from gauss import math
from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.rotors.law import ANY, NOT_NEGATIVE, POSITIVE, MotorLaw, check_fields
from gauss.scene import values


@dataclass(frozen=True)
class Linear(MotorLaw):
    """Motor with a straight characteristic, stiffness · (omega_0 − ω).

    Parameters
    ----------
    stiffness : float
        Torque over speed [N m s/rad].
    omega_0 : float
        Speed without torque [rad/s].

    Examples
    --------
    >>> from gauss import rotors
    >>> law = rotors.Linear(stiffness=2.0, omega_0=150.0)
    >>> law.stiffness, law.omega_0
    (2.0, 150.0)
    """

    stiffness: float
    omega_0: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, stiffness=("N m s/rad", POSITIVE), omega_0=("rad/s", ANY))

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.omega_0

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return self.stiffness * (self.omega_0 - speed)


@dataclass(frozen=True)
class Kloss(MotorLaw):
    """Induction motor by Kloss's formula: 2 M_k s s_k/(s² + s_k²), s = 1 − ω/omega_0.

    Parameters
    ----------
    M_k : float
        Pull-out torque [N m].
    s_k : float
        Slip at which it is reached.
    omega_0 : float
        Synchronous speed [rad/s].
    """

    M_k: float
    s_k: float
    omega_0: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, M_k=("N m", POSITIVE), s_k=("1", POSITIVE), omega_0=("rad/s", ANY))
        if self.omega_0 == 0:
            raise SceneError("law 'kloss': omega_0: expected a speed [rad/s] other than 0; its sign gives the direction.")

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.omega_0

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        s = 1.0 - speed / self.omega_0
        torque = 2.0 * self.M_k * self.s_k * s / (s * s + self.s_k**2)
        return torque if self.omega_0 > 0 else -torque


@dataclass(frozen=True)
class DC(MotorLaw):
    """Direct-current motor, fixed or permanent-magnet field, winding without inductance: k (U − k ω)/R.

    Parameters
    ----------
    voltage : float
        U [V].
    resistance : float
        R [ohm].
    constant : float
        k, torque over current [N m/A], which is voltage over speed [V s/rad].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> torque = fan.torque(motor, rotors.DC(voltage=24.0, resistance=0.5, constant=0.1))
    >>> rotors.snapshot(fan).accelerations.round(3)  # k U / R / J
    array([48.])
    """

    voltage: float
    resistance: float
    constant: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, voltage=("V", ANY), resistance=("ohm", POSITIVE), constant=("N m/A", POSITIVE))

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.voltage / self.constant

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return self.constant * (self.voltage - self.constant * speed) / self.resistance


@dataclass(frozen=True)
class Diesel(MotorLaw):
    """Diesel engine with a governor: the smaller of full-load curve and droop line, never below the drag.

    The droop line runs from the full-load torque at ``governed`` to zero at ``no_load``.

    Parameters
    ----------
    speed, torque : sequence of float
        Full-load curve [rad/s], [N m]; constant beyond its ends.
    governed : float
        Speed at which the governor sets in [rad/s].
    idle : float
        Speed without load, above ``governed`` [rad/s].
    drag : float
        Torque with which the engine brakes when it is driven faster [N m].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> engine = rotors.Diesel(speed=(0, 80, 150, 220), torque=(0, 300, 340, 260), governed=220.0, idle=240.0)
    >>> fan.torque(motor, engine).name
    'torque on motor'
    """

    speed: tuple
    torque: tuple
    governed: float
    idle: float
    drag: float = 0.0

    def __post_init__(self):
        """Check every value."""
        speed, torque = points(self.speed, self.torque, "law 'diesel'", "speed", "rad/s", "torque", "N m")
        values.keep(self, speed=speed, torque=torque)
        check_fields(self, governed=("rad/s", POSITIVE), idle=("rad/s", POSITIVE), drag=("N m", NOT_NEGATIVE))
        if self.idle <= self.governed:
            raise SceneError(f"law 'diesel': idle {self.idle} must be above governed {self.governed} [rad/s].")
        if self._slope <= 0:
            raise SceneError("law 'diesel': the full-load torque at the governed speed must be positive.")

    @cached_property
    def _full(self) -> Interpolant:
        return Interpolant(self.speed, self.torque)

    @cached_property
    def _slope(self) -> float:
        return float(self._full(self.governed)) / (self.idle - self.governed)

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.idle

    @property
    def kinks(self) -> tuple[float, ...]:
        """Speeds at which the governor sets in and at which the full drag brakes [rad/s]."""
        return (self.governed, self.idle + self.drag / self._slope)

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        droop = self._slope * (self.idle - speed)
        full = math.where(speed < self.governed, self._full(speed), droop)
        return math.maximum(full, -self.drag)
