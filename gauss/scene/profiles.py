"""Laws of time as data, which a file can hold: each is called with a time, a number or a traced expression.

All are smooth enough to be differentiated four times, as a crane's path must be.
"""

from dataclasses import dataclass, fields

import numpy as np

from gauss import math
from gauss.errors import SceneError, did_you_mean
from gauss.scene import values

UNIT_OF_LAW = "units of the law"


@dataclass(frozen=True)
class Profile:
    """Law of time. Every field is a number, or a list of numbers."""

    def __post_init__(self):
        what = f"profile {self.kind!r}"
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type is tuple:
                size, label = np.size(value), f"{what}: {field.name}"
                checked: float | tuple = values.vector(value, label, UNIT_OF_LAW, size) if size else ()
            else:
                checked = values.number(value, f"{what}: {field.name}", UNIT_OF_LAW, positive=field.name in POSITIVE)
            values.keep(self, **{field.name: checked})

    @property
    def kind(self) -> str:
        """Name of the profile in a file."""
        return type(self).__name__.lower()


POSITIVE = ("duration", "frequency")


@dataclass(frozen=True)
class Ramp(Profile):
    """From a value on at a constant speed: start + speed · t.

    Parameters
    ----------
    start, speed : float
        Value at t = 0, and its rate.
    """

    start: float = 0.0
    speed: float = 0.0

    def __call__(self, t):
        """Value at a time [s]."""
        return self.start + self.speed * t


@dataclass(frozen=True)
class Sine(Profile):
    """Harmonic: mean + amplitude · sin(2π · frequency · t + phase).

    Parameters
    ----------
    amplitude, mean : float
        Amplitude and mean value.
    frequency : float
        Frequency [Hz].
    phase : float
        Phase at t = 0 [rad].
    """

    amplitude: float
    frequency: float
    mean: float = 0.0
    phase: float = 0.0

    def __call__(self, t):
        """Value at a time [s]."""
        return self.mean + self.amplitude * math.sin(2.0 * math.pi * self.frequency * t + self.phase)


@dataclass(frozen=True)
class Move(Profile):
    """From rest at one value to rest at another; the first four derivatives are zero at both ends.

    x = start + (end − start) s⁵ (126 − 420 s + 540 s² − 315 s³ + 70 s⁴), s = (t − begin)/duration between 0 and 1:
    the only polynomial of degree nine that does this.

    Parameters
    ----------
    start, end : float
        Values before and after.
    duration : float
        How long it takes [s].
    begin : float
        When it begins [s].
    """

    start: float
    end: float
    duration: float
    begin: float = 0.0

    def __call__(self, t):
        """Value at a time [s]."""
        s = math.clip((t - self.begin) / self.duration, 0.0, 1.0)
        return self.start + (self.end - self.start) * s**5 * (126.0 + s * (-420.0 + s * (540.0 + s * (-315.0 + 70.0 * s))))


@dataclass(frozen=True)
class Polynomial(Profile):
    """Power series c₀ + c₁ t + c₂ t² + ….

    Parameters
    ----------
    coefficients : sequence of float
        c₀, c₁, c₂, ….
    """

    coefficients: tuple

    def __call__(self, t):
        """Value at a time [s]."""
        total = 0.0 * t
        for coefficient in self.coefficients[::-1]:
            total = total * t + coefficient
        return total


@dataclass(frozen=True)
class Several:
    """Several laws of time, as one law that returns an array."""

    entries: tuple

    def __call__(self, t):
        """Values (k,) at a time [s]."""
        return np.array([values.evaluate(entry, t) for entry in self.entries])


PROFILES = {kind.__name__.lower(): kind for kind in (Ramp, Sine, Move, Polynomial)}


def from_table(table: dict) -> Profile:
    """Profile of a table of a file: its kind under the key "profile", and its fields.

    SceneError if there is no such profile, or a field is missing or unknown.
    """
    given = dict(table)
    kind = given.pop("profile", None)
    if kind not in PROFILES:
        raise SceneError(f"no profile {kind!r}. {did_you_mean(kind, PROFILES)}")
    allowed = [field.name for field in fields(PROFILES[kind])]
    unknown = [key for key in given if key not in allowed]
    if unknown:
        raise SceneError(f"profile {kind!r}: unknown key {unknown[0]!r}. {did_you_mean(unknown[0], allowed)}")
    try:
        return PROFILES[kind](**given)
    except TypeError as error:
        raise SceneError(f"profile {kind!r}: {error}; it has the keys {', '.join(allowed)}.") from None


def to_table(profile: Profile) -> dict:
    """Table from which :func:`from_table` makes an equal profile."""
    given = {field.name: getattr(profile, field.name) for field in fields(profile)}
    defaults = {field.name: field.default for field in fields(profile)}
    return {"profile": profile.kind} | {key: value for key, value in given.items() if value != defaults[key]}
