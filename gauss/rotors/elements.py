"""Elements of a rotor network: shafts and the torques applied to them."""

import math
from dataclasses import dataclass, fields

from gauss.errors import SceneError, did_you_mean
from gauss.rotors.laws import LAWS, ROLES, Constant, Law, TorqueFunction
from gauss.scene import values


@dataclass(frozen=True)
class Shaft:
    """Rotor about a fixed axis.

    Parameters
    ----------
    name : str
        Name.
    inertia : float
        J > 0 [kg m²].
    speed : float, optional
        ω at the start [rad/s]; follows from the shafts geared to it when not given, else 0.
    angle : float
        α at the start [rad].

    Examples
    --------
    >>> from gauss import rotors
    >>> rotors.Shaft("motor", inertia=0.1, speed=50.0)
    Shaft(name='motor', inertia=0.1, speed=50.0, angle=0.0)
    """

    name: str
    inertia: float
    speed: float | None = None
    angle: float = 0.0

    def __post_init__(self):
        """Check every value."""
        what = f"shaft {values.text(self.name, 'name of a shaft')!r}"
        values.keep(self, inertia=values.number(self.inertia, f"{what}: inertia", "kg m²", positive=True))
        values.keep(self, angle=values.number(self.angle, f"{what}: angle", "rad"))
        if self.speed is not None:
            values.keep(self, speed=values.number(self.speed, f"{what}: speed", "rad/s"))


@dataclass(frozen=True)
class Torque:
    """One applied torque of a shaft; all torques of a shaft add up.

    Parameters
    ----------
    name, shaft : str
        Its name and its shaft.
    law : Law, float or callable
        A law of :mod:`gauss.rotors.laws`, a constant [N m], or a function of (t, angle, speed) that returns [N m].
    begin, until : float, optional
        It acts for begin ≤ t < until [s].
    role : str, optional
        Account of its work: "motor" (input), "load" (useful) or "loss" (heat of bearings); the law's own when not given.
    breaks : sequence of float
        Times at which the law switches [s], for a law that cannot be traced; conditions of traced laws are found.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> brake = fan.torque(wheel, rotors.Dry(30.0), name="brake", begin=6.0)
    >>> brake.name, brake.shaft, brake.begin
    ('brake', 'wheel', 6.0)
    """

    name: str
    shaft: str
    law: Law
    begin: float | None = None
    until: float | None = None
    role: str | None = None
    breaks: tuple = ()

    def __post_init__(self):
        """Check every value."""
        what = f"torque {values.text(self.name, 'name of a torque')!r}"
        law = as_law(self.law, what)
        values.keep(self, law=law)
        for key in ("begin", "until"):
            if getattr(self, key) is not None:
                values.keep(self, **{key: values.number(getattr(self, key), f"{what}: {key}", "s")})
        if self.timed and self.until is not None and self.begin is not None and self.until <= self.begin:
            raise SceneError(f"{what}: until {self.until} s must be after the begin at {self.begin} s.")
        values.keep(self, breaks=values.times(self.breaks, f"{what}: breaks"))
        role = law.role if self.role is None else self.role
        if role not in ROLES:
            raise SceneError(f"{what}: unknown role {role!r}. {did_you_mean(role, ROLES)}")
        values.keep(self, role=role)

    @property
    def timed(self) -> bool:
        """Whether it acts for a limited time only."""
        return self.begin is not None or self.until is not None

    def active(self, t: float) -> bool:
        """Whether it acts at a time [s], and just after it."""
        return (-math.inf if self.begin is None else self.begin) <= t < (math.inf if self.until is None else self.until)


def as_law(given, what: str) -> Law:
    """Torque law from a law, a constant [N m] or a function of (t, angle, speed); SceneError if it is none of these."""
    if isinstance(given, Law):
        return given
    if isinstance(given, type) and issubclass(given, Law):
        raise SceneError(f"{what}: law: got the class {given.__name__}; give it its values, e.g. Constant(5.0).")
    return TorqueFunction(given) if callable(given) else Constant(values.number(given, f"{what}: law", "N m"))


def law_of(name: str, arguments: dict, what: str) -> Law:
    """Law of its name in a file and its values.

    Parameters
    ----------
    name : str
        Name of the law.
    arguments : dict
        Its values by name.
    what : str
        Its element, for messages.

    Returns
    -------
    Law
        The law.

    Raises
    ------
    SceneError
        If there is no such law, or a value is unknown or missing.

    Examples
    --------
    >>> from gauss import rotors
    >>> rotors.law_of("constant", {"value": -40.0}, "torque of the file")
    Constant(value=-40.0)
    """
    if name not in LAWS:
        raise SceneError(f"{what}: unknown law {name!r}. {did_you_mean(name, LAWS)}")
    kind = LAWS[name]
    keys = [field.name for field in fields(kind)]  # type: ignore[arg-type]  # every law is a dataclass
    for key in arguments:
        if key not in keys:
            raise SceneError(f"{what}: law {name!r} has no value {key!r}. {did_you_mean(key, keys)}")
    try:
        return kind(**arguments)
    except TypeError:
        missing = [key for key in keys if key not in arguments and not hasattr(kind, key)]
        raise SceneError(f"{what}: law {name!r}: missing {', '.join(missing)}.") from None
    except SceneError as error:
        raise SceneError(f"{what}: {error}") from error
