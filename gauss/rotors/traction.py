"""Traction characteristics: torque of a friction drive over its slip, odd in the symmetric slip.

Symmetric slip of the driver's speed v_d against the driven one's v = i ω, referred to the driver:
x = (v_d − v)/max(|v_d|, |v|, v_0). For 0 ≤ v ≤ v_d it is the slip ε = 1 − v/v_d.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from gauss import math
from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.rotors.laws import called
from gauss.scene import values

LARGEST_SLIP = 2.0  # |x| of wheels that turn against each other
COEFFICIENT_ROUNDING = 1e-12  # relative to A C: a smaller difference of B and A C is rounding of typed numbers


def symmetric_slip(v_d: Scalar, v: Scalar, v_0: float) -> Scalar:
    """Symmetric slip x, odd under exchange of the wheels; v_0 [rad/s] regularises 0/0 at rest."""
    return (v_d - v) / math.maximum(math.maximum(abs(v_d), abs(v)), v_0)


@dataclass(frozen=True)
class Hyperbola:
    """Q_em = A − B/(C + ε) for ε ≥ 0 (III.74), odd.

    Parameters
    ----------
    A : float
        Asymptotic torque [N m].
    B : float, optional
        [N m]; A C when not given: no torque at zero slip. Less than A C: the link sticks at zero slip up to the
        threshold A − B/C, like dry friction.
    C : float
        Slip at which half of A is reached when B = A C.

    Examples
    --------
    >>> from gauss import rotors
    >>> curve = rotors.Hyperbola(A=300.0, C=0.02, B=6.0)
    >>> curve.A
    300.0
    """

    A: float
    C: float
    B: float = None  # type: ignore[assignment]  # a float after __post_init__

    def __post_init__(self) -> None:
        """Check every value."""
        for key, unit in (("A", "N m"), ("C", "1")):
            values.keep(self, **{key: values.number(getattr(self, key), f"curve: {key}", unit, positive=True)})
        B = self.A * self.C if self.B is None else values.number(self.B, "curve: B", "N m", non_negative=True)
        if abs(B - self.A * self.C) <= COEFFICIENT_ROUNDING * self.A * self.C:
            B = self.A * self.C
        if B > self.A * self.C:
            raise SceneError(
                f"curve: B = {B:g} is above A C = {self.A * self.C:g}: the torque at small slip would act against the slip "
                "and make energy from nothing; give B ≤ A C."
            )
        values.keep(self, B=B)

    @property
    def threshold(self) -> float:
        """Largest sticking torque at zero slip [N m]."""
        return 0.0 if self.B == self.A * self.C else self.A - self.B / self.C

    @property
    def peak(self) -> float | None:
        """No peak: the curve is monotone."""
        return None

    def __call__(self, x: Scalar, sign: Scalar) -> Scalar:
        """Torque [N m] at symmetric slip x; ``sign`` is that of the slip, used only where the link can stick."""
        if not self.threshold:
            return self.A * x / (self.C + abs(x))
        # the branch is continued smoothly beyond x = 0: a step that crosses zero ends there
        return sign * (self.A - self.B / (self.C + math.maximum(sign * x, -0.5 * self.C)))


@dataclass(frozen=True)
class Measured:
    """Odd monotone cubic interpolant of measured points, constant beyond the last.

    Parameters
    ----------
    slip : sequence of float
        Increasing from 0.
    torque : sequence of float
        Torque there [N m], 0 at first.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> curve = rotors.Measured(slip=(0.0, 0.01, 0.05), torque=(0.0, 80.0, 120.0))
    >>> fan.friction_drive("belt", wheel, motor, ratio=2.0, curve=curve).name
    'belt'
    """

    slip: tuple
    torque: tuple

    def __post_init__(self) -> None:
        """Check every value."""
        slip, torque = points(self.slip, self.torque, "curve", "slip", "1", "torque", "N m")
        if slip[0] != 0 or torque[0] != 0 or min(torque) < 0:
            raise SceneError("curve: slip and torque start at 0, and no torque is negative (it would act against the slip).")
        values.keep(self, slip=slip, torque=torque)

    threshold = 0.0

    @property
    def peak(self) -> float | None:
        """Slip of the largest torque, None if that is the last point."""
        best = int(np.argmax(self.torque))
        return None if best == len(self.torque) - 1 else self.slip[best]

    @cached_property
    def _curve(self) -> Interpolant:
        mirrored = [-x for x in self.slip[:0:-1]], [-y for y in self.torque[:0:-1]]
        return Interpolant((*mirrored[0], *self.slip), (*mirrored[1], *self.torque))

    def __call__(self, x: Scalar, sign: Scalar) -> Scalar:
        """Torque [N m] at symmetric slip x."""
        return self._curve(x)


@dataclass(frozen=True)
class Characteristic:
    """Any smooth function of the symmetric slip x in [−2, 2] that returns a torque [N m] of the sign of x.

    Parameters
    ----------
    function : callable
        f(x).

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> curve = rotors.Characteristic(lambda slip: 400.0 * slip)
    >>> belt = fan.friction_drive("belt", driven=wheel, driver=motor, ratio=2.0, curve=curve)
    >>> belt.name
    'belt'
    """

    function: Callable

    def __post_init__(self) -> None:
        """Check signs."""
        if not callable(self.function):
            raise SceneError(f"curve: expected a function of the slip, got {self.function!r}.")
        for x in np.linspace(-LARGEST_SLIP, LARGEST_SLIP, 81):
            torque = float(self.function(float(x)))
            if not np.isfinite(torque) or torque * x < 0:
                raise SceneError(
                    f"curve: at slip {x:.3g} the function returns {torque}; expected a torque of the slip's sign."
                )

    threshold = 0.0

    @cached_property
    def peak(self) -> float | None:
        """Slip of the largest torque, None if the torque never falls."""
        x = np.linspace(0.0, LARGEST_SLIP, 2001)
        y = np.array([float(self.function(float(s))) for s in x])
        best = int(np.argmax(y))
        if best == len(x) - 1:
            return None
        found = minimize_scalar(
            lambda s: -float(self.function(s)), bounds=(x[max(best - 1, 0)], x[best + 1]), method="bounded"
        )
        return float(found.x)

    def __call__(self, x: Scalar, sign: Scalar) -> Scalar:
        """Torque [N m] at symmetric slip x."""
        return called(self.function, x)


Curve = Hyperbola | Measured | Characteristic


def as_curve(given: Any, what: str) -> Curve:
    """Characteristic from a characteristic, (A, B, C), a table {slip, torque} or a function.

    SceneError if it has none of these forms.
    """
    if isinstance(given, Curve):
        return given
    try:
        if isinstance(given, dict):
            return Measured(**given) if "slip" in given else Hyperbola(**given)
        if callable(given):
            return Characteristic(given)
        A, B, C = given
        return Hyperbola(A, C, B)
    except SceneError as error:
        raise SceneError(f"{what}: {error}") from error
    except (TypeError, ValueError) as error:
        raise SceneError(
            f"{what}: curve: expected [A, B, C], {{A, C}}, {{A, B, C}}, {{slip, torque}} or a function, got {given!r}."
        ) from error
