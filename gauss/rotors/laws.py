"""Torque laws of shafts: motors and loads, each a function of time [s], angle [rad] and speed [rad/s].

Written over scalars that may be numbers or symbols, so that a network with these laws is traced and compiled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss import math
from gauss.codegen import Expression, branches
from gauss.errors import GaussError, SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.scene import values

MOTOR, LOAD, LOSS = ROLES = ("motor", "load", "loss")


class Law:
    """Base of all laws: what the rest of the package asks of them, answered for the plainest case."""

    role = LOAD  # whose work it is, unless the user says otherwise
    no_load = None  # speed [rad/s] at which a motor without load turns
    kinks: tuple = ()  # speeds [rad/s] at which the slope of the law jumps


def _check(law, **rules):
    """Keep every field as a finite float; rules name the unit and the sign of each."""
    for key, (unit, sign) in rules.items():
        checked = values.number(getattr(law, key), f"law {type(law).__name__.lower()!r}: {key}", unit, **sign)
        object.__setattr__(law, key, checked)


_ANY, _POSITIVE, _NOT_NEGATIVE = {}, {"positive": True}, {"non_negative": True}


@dataclass(frozen=True)
class Constant(Law):
    """The same torque always, ``value`` [N m]; it keeps its sign when the shaft turns back (see :class:`Dry`).

    Parameters
    ----------
    value : float
        Torque [N m].
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        _check(self, value=("N m", _ANY))

    @property
    def role(self) -> str:
        """A positive one drives."""
        return MOTOR if self.value > 0 else LOAD

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return self.value


@dataclass(frozen=True)
class Viscous(Law):
    """−value · ω, ``value`` [N m s/rad].

    Parameters
    ----------
    value : float
        Torque over speed [N m s/rad].
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        _check(self, value=("N m s/rad", _NOT_NEGATIVE))

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return -self.value * speed


@dataclass(frozen=True)
class Quadratic(Law):
    """−value · ω |ω|, ``value`` [N m s²/rad²]: fans and beaters.

    Parameters
    ----------
    value : float
        Torque over the square of the speed [N m s²/rad²].
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        _check(self, value=("N m s²/rad²", _NOT_NEGATIVE))

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return -self.value * speed * abs(speed)


@dataclass(frozen=True)
class Dry(Law):
    """Dry friction: resists motion by ``value`` [N m]; at rest holds any torque up to it.

    At rest it is no function, so it is no law to be called: :mod:`gauss.rotors.modes` finds out whether it holds.

    Parameters
    ----------
    value : float
        Largest torque [N m].
    """

    value: float

    def __post_init__(self):
        """Check every value."""
        _check(self, value=("N m", _NOT_NEGATIVE))


@dataclass(frozen=True)
class Linear(Law):
    """Motor stiffness · (omega_0 − ω), ``stiffness`` [N m s/rad].

    Parameters
    ----------
    stiffness : float
        Torque over speed [N m s/rad].
    omega_0 : float
        Speed without torque [rad/s].
    """

    stiffness: float
    omega_0: float
    role = MOTOR

    def __post_init__(self):
        """Check every value."""
        _check(self, stiffness=("N m s/rad", _POSITIVE), omega_0=("rad/s", _ANY))

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.omega_0

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return self.stiffness * (self.omega_0 - speed)


@dataclass(frozen=True)
class Kloss(Law):
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
    role = MOTOR

    def __post_init__(self):
        """Check every value."""
        _check(self, M_k=("N m", _POSITIVE), s_k=("1", _POSITIVE), omega_0=("rad/s", _ANY))
        if self.omega_0 == 0:
            raise SceneError("law 'kloss': omega_0: expected a speed [rad/s] other than 0; its sign gives the direction.")

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.omega_0

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        s = 1.0 - speed / self.omega_0
        torque = 2.0 * self.M_k * self.s_k * s / (s * s + self.s_k**2)
        return torque if self.omega_0 > 0 else -torque


@dataclass(frozen=True)
class DC(Law):
    """Direct-current motor, fixed or permanent-magnet field, winding without inductance: k (U − k ω)/R.

    Parameters
    ----------
    voltage : float
        U [V].
    resistance : float
        R [ohm].
    constant : float
        k, torque over current [N m/A], which is voltage over speed [V s/rad].
    """

    voltage: float
    resistance: float
    constant: float
    role = MOTOR

    def __post_init__(self):
        """Check every value."""
        _check(self, voltage=("V", _ANY), resistance=("ohm", _POSITIVE), constant=("N m/A", _POSITIVE))

    @property
    def no_load(self) -> float:
        """Speed without load [rad/s]."""
        return self.voltage / self.constant

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return self.constant * (self.voltage - self.constant * speed) / self.resistance


@dataclass(frozen=True)
class Diesel(Law):
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
    """

    speed: tuple
    torque: tuple
    governed: float
    idle: float
    drag: float = 0.0
    role = MOTOR

    def __post_init__(self):
        """Check every value."""
        checked = points(self.speed, self.torque, "law 'diesel'", "speed", "rad/s", "torque", "N m")
        for key, column in zip(("speed", "torque"), checked, strict=True):
            object.__setattr__(self, key, column)
        _check(self, governed=("rad/s", _POSITIVE), idle=("rad/s", _POSITIVE), drag=("N m", _NOT_NEGATIVE))
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
    def kinks(self) -> tuple:
        """Where the governor sets in, and where the engine brakes with all its drag."""
        return (self.governed, self.idle + self.drag / self._slope)

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        droop = self._slope * (self.idle - speed)
        full = math.where(speed < self.governed, self._full(speed), droop)
        return math.maximum(full, -self.drag)


@dataclass(frozen=True)
class Table(Law):
    """Torque [N m] over speed [rad/s], a smooth curve through the points, constant beyond the ends.

    Parameters
    ----------
    speed : tuple of float
        Speeds, rising [rad/s].
    torque : tuple of float
        Torque at each of them [N m].
    """

    speed: tuple
    torque: tuple

    def __post_init__(self):
        """Check every value."""
        checked = points(self.speed, self.torque, "law 'table'", "speed", "rad/s", "torque", "N m")
        for key, column in zip(("speed", "torque"), checked, strict=True):
            object.__setattr__(self, key, column)

    @cached_property
    def _curve(self) -> Interpolant:
        return Interpolant(self.speed, self.torque)

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return self._curve(speed)


@dataclass(frozen=True)
class Periodic(Law):
    """Torque that depends on the angle: a trigonometric polynomial through equally spaced values.

    Parameters
    ----------
    torque : sequence of float
        Values [N m] at the angles 0, p/m, 2 p/m, … of one period p.
    period : float
        p [rad]; a full turn when not given.
    """

    torque: tuple
    period: float = 2 * np.pi

    def __post_init__(self):
        """Check every value."""
        _check(self, period=("rad", _POSITIVE))
        if not isinstance(self.torque, (tuple, list, np.ndarray)) or not len(self.torque):
            raise SceneError(f"law 'periodic': torque: expected a list of numbers in [N m], got {self.torque!r}.")
        object.__setattr__(self, "torque", values.vector(self.torque, "law 'periodic': torque", "N m", len(self.torque)))

    @cached_property
    def _harmonics(self) -> list[tuple]:
        """Order and coefficients of cosine and sine of each harmonic that is there."""
        c = np.fft.rfft(self.torque) / len(self.torque)
        weight = [2.0 if 0 < 2 * k < len(self.torque) else 1.0 for k in range(len(c))]
        dirt = 1e-15 * max(map(abs, self.torque))
        return [(k, w * x.real, -w * x.imag) for k, (w, x) in enumerate(zip(weight, c, strict=True)) if abs(x) > dirt]

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        turn = 2 * np.pi / self.period
        return sum((a * np.cos(k * turn * angle) + b * np.sin(k * turn * angle) for k, a, b in self._harmonics), 0.0)


@dataclass(frozen=True)
class Function(Law):
    """Any Python function of (t, angle, speed) that returns a torque [N m].

    Written with the functions of :mod:`gauss.math`, and with `if`, it is compiled with the network, and gauss finds where it
    switches; else it is called, and times at which it switches are told by ``breaks=`` of the torque.

    Parameters
    ----------
    function : callable
        f(t, angle, speed) → torque, of [s], [rad], [rad/s] and [N m].
    """

    function: Callable

    def __call__(self, t, angle, speed):
        """Torque [N m]."""
        return called(self.function, t, angle, speed)


def called(function: Callable, *arguments):
    """Value of a user's function; of expressions along all its branches.

    Raises
    ------
    TypeError
        If it is given expressions and cannot be traced.
    """
    if not any(isinstance(argument, Expression) for argument in arguments):
        return function(*arguments)
    try:
        return branches(lambda: function(*arguments))
    except GaussError:
        raise
    except Exception as error:  # a law may fail in any way when it is given symbols
        raise TypeError(f"{type(error).__name__}: {error}") from error


LAWS = {
    "constant": Constant,
    "viscous": Viscous,
    "quadratic": Quadratic,
    "dry": Dry,
    "linear": Linear,
    "kloss": Kloss,
    "dc": DC,
    "diesel": Diesel,
    "table": Table,
    "periodic": Periodic,
}
