"""Torque laws of loads: constant, viscous, quadratic, dry, tabulated over the speed, periodic in the angle."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.rotors.law import ANY, LOAD, MOTOR, NOT_NEGATIVE, POSITIVE, Law, check_fields
from gauss.scene import values


@dataclass(frozen=True)
class Constant(Law):
    """Constant torque; its sign does not follow that of the speed (see :class:`Dry`).

    Parameters
    ----------
    value : float
        Torque [N m].

    Examples
    --------
    >>> from gauss import rotors
    >>> lift = rotors.Constant(-40.0)  # N m
    >>> lift.value
    -40.0
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, value=("N m", ANY))

    @property
    def role(self) -> str:
        """Positive torques drive."""
        return MOTOR if self.value > 0 else LOAD

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return self.value


@dataclass(frozen=True)
class Viscous(Law):
    """Viscous torque −value · ω.

    Parameters
    ----------
    value : float
        Torque over speed [N m s/rad].

    Examples
    --------
    >>> from gauss import rotors
    >>> rotors.Viscous(0.2)
    Viscous(value=0.2)
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, value=("N m s/rad", NOT_NEGATIVE))

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return -self.value * speed


@dataclass(frozen=True)
class Quadratic(Law):
    """Quadratic torque ``−value · ω |ω|``, of fans and beaters.

    Parameters
    ----------
    value : float
        Torque over the square of the speed [N m s²/rad²].

    Examples
    --------
    >>> from gauss import rotors
    >>> rotors.Quadratic(0.01)
    Quadratic(value=0.01)
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, value=("N m s²/rad²", NOT_NEGATIVE))

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return -self.value * speed * abs(speed)


@dataclass(frozen=True)
class Dry(Law):
    """Dry (Coulomb) friction, −value · sign ω; at rest any torque up to ``value``.

    Set-valued at rest, it is not callable: :mod:`gauss.rotors.mode_search` decides between sticking and slipping.

    Parameters
    ----------
    value : float
        Largest torque [N m].
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        check_fields(self, value=("N m", NOT_NEGATIVE))


@dataclass(frozen=True)
class TorqueTable(Law):
    """Tabulated torque over the speed: a monotone cubic interpolant, constant beyond the ends.

    Parameters
    ----------
    speed : tuple of float
        Speeds, rising [rad/s].
    torque : tuple of float
        Torque at each of them [N m].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.TorqueTable(speed=(0.0, 50.0, 100.0), torque=(0.0, -5.0, -20.0))
    >>> fan.torque
    (0.0, -5.0, -20.0)
    """

    speed: tuple
    torque: tuple

    def __post_init__(self):
        """Check every value."""
        speed, torque = points(self.speed, self.torque, "law 'table'", "speed", "rad/s", "torque", "N m")
        values.keep(self, speed=speed, torque=torque)

    @cached_property
    def _curve(self) -> Interpolant:
        return Interpolant(self.speed, self.torque)

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        return self._curve(speed)


@dataclass(frozen=True)
class Periodic(Law):
    """Torque periodic in the angle: the trigonometric polynomial that interpolates equally spaced values.

    Parameters
    ----------
    torque : sequence of float
        Values [N m] at the angles 0, p/m, 2 p/m, … of one period p.
    period : float
        p [rad]; a full turn when not given.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> press = rotors.Periodic(torque=(0.0, -10.0, 0.0, 5.0))  # over a turn
    >>> fan.torque(wheel, press).name
    'torque on wheel'
    """

    torque: tuple
    period: float = 2 * np.pi

    def __post_init__(self):
        """Check every value."""
        check_fields(self, period=("rad", POSITIVE))
        if not isinstance(self.torque, (tuple, list, np.ndarray)) or not len(self.torque):
            raise SceneError(f"law 'periodic': torque: expected a list of numbers in [N m], got {self.torque!r}.")
        values.keep(self, torque=values.vector(self.torque, "law 'periodic': torque", "N m", len(self.torque)))

    @cached_property
    def _harmonics(self) -> list[tuple]:
        """Order and coefficients of cosine and sine of each harmonic above rounding."""
        c = np.fft.rfft(self.torque) / len(self.torque)
        weight = [2.0 if 0 < 2 * k < len(self.torque) else 1.0 for k in range(len(c))]
        rounding = 1e-15 * max(map(abs, self.torque))
        return [(k, w * x.real, -w * x.imag) for k, (w, x) in enumerate(zip(weight, c, strict=True)) if abs(x) > rounding]

    def __call__(self, t: Scalar, angle: Scalar, speed: Scalar) -> Scalar:
        """Torque [N m]."""
        turn = 2 * np.pi / self.period
        return sum((a * np.cos(k * turn * angle) + b * np.sin(k * turn * angle) for k, a, b in self._harmonics), 0.0)
