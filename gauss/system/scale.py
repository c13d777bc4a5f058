"""Scale of a scene: its own units of length, time and mass, to which tolerances are relative.

No tolerance is a number of metres or seconds: it is relative to the scale of the scene, which follows from the data of the
scene. If all lengths, times and masses of a scene are multiplied by factors, so are these units, and results are the same.

The unit of time is half a swing of a pendulum of the unit of length: 1 m on Earth gives 1.003 s, so that scenes of some
metres are compared with numbers near one.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import reduce
from numbers import Real

import numpy as np

from gauss import math
from gauss.scene import values
from gauss.scene.stateful_laws import preserved

LENGTH_FIELDS = ("at", "child_at", "other_at", "length", "radius", "crown", "on_radius", "size", "points")
LEAST_CHANGE = 1e-9  # of a law, relative to its value at the start: less is round-off
SAMPLED_TIMES = 10.0 ** np.arange(-15, 16)  # s, of a law of unknown time scale


@dataclass(frozen=True, eq=False)
class Scale:
    """Units of a scene.

    Parameters
    ----------
    length : float
        Longest way from a centre of mass to a joint or frame; where there is none, size of shapes, of bodies, of starts [m].
    time : float
        Half a swing of a pendulum of that length; without gravity, from rates, stiffnesses or forces of the scene [s].
    mass : float
        Mass of all bodies [kg].
    coordinates : ndarray, shape (n_v,)
        1 rad where a rate turns, the length where it slides.
    """

    length: float
    time: float
    mass: float
    coordinates: np.ndarray

    @property
    def speed(self) -> float:
        """Unit of speed [m/s]."""
        return self.length / self.time

    @property
    def force(self) -> float:
        """Unit of force [N]."""
        return self.energy / self.length

    @property
    def energy(self) -> float:
        """Unit of energy, and of moments [J, N m]."""
        return self.mass * self.speed * self.speed

    @property
    def rates(self) -> np.ndarray:
        """Unit of each rate (n_v,) [rad/s, m/s]."""
        return self.coordinates / self.time

    @property
    def efforts(self) -> np.ndarray:
        """Unit of each generalised force (n_v,) [N m, N]."""
        return self.energy / self.coordinates

    def fastest(self, v):
        """Largest of rates (n_v,), numbers or expressions, in coordinates of the scene, and one in its time more [1/s]."""
        shares = np.abs(v * (1.0 / self.coordinates))
        largest = reduce(math.maximum, shares, 0.0) if shares.dtype == object else float(shares.max(initial=0.0))
        return 1.0 / self.time + largest

    def __str__(self):
        return f"{self.length:.3g} m, {self.time:.3g} s, {self.mass:.3g} kg"


def scale_of(system) -> Scale:
    """Scale of a system."""
    turns = turning(system)
    length = _length(system, turns)
    coordinates = np.where(turns, 1.0, length)
    coordinates.flags.writeable = False  # kept with the system, and shown to the user
    mass = _mass(system, length)
    return Scale(length, _time(system, length, mass, coordinates), mass, coordinates)


def turning(system) -> np.ndarray:
    """Whether each rate (n_v,) turns what it moves; a screw turns."""
    found = np.ones(system.n_v, dtype=bool)
    for joint in system.joints:
        E_omega, _ = joint.pair.subspace(np.array(joint.pair.reference))
        found[joint.v] = np.abs(E_omega).sum(axis=0) > 0
    return found


def _length(system, turns: np.ndarray) -> float:
    """First kind of length that is not zero [m]."""
    return _first(kind(system, turns) for kind in (_arms, _shapes, _gyration, _places, _falls))


def _arms(system, turns) -> float:
    """Longest way from a centre of mass to a joint or frame."""
    points = [point for joint in system.joints for point in (joint.p_parent, joint.p_child)]
    return max(float(np.linalg.norm(point)) for point in [*points, *(frame.p for frame in system.frames.values())])


def _shapes(system, turns) -> float:
    """Largest length among shapes, springs, contacts and constraints."""
    scene = system.scene
    parts = [*scene.shapes.values(), *scene.relations.values(), *scene.contacts.values(), *scene.loads.values()]
    names = {kind: _lengths(kind) for kind in {type(part) for part in parts}}
    given = (getattr(part, name) for part in parts for name in names[type(part)])
    return max((_size(value) for value in given), default=0.0)


def _lengths(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.name in LENGTH_FIELDS)


def _gyration(system, turns) -> float:
    """Largest radius of gyration."""
    J, mass = system.Phi.reshape(-1, 6)[:, :3].max(axis=1, initial=0.0), system.Phi[3::6]
    return float(np.sqrt(np.max(J[mass > 0.0] / mass[mass > 0.0], initial=0.0)))


def _places(system, turns) -> float:
    """Farthest start, limit, stop or rest position of a sliding joint."""
    scene = system.scene
    given = [(name, getattr(start, "position", None)) for name, start in scene.starts.items()]
    given += [(joint.name, joint.limits) for joint in scene.joints.values()]
    given += [(part.joint, getattr(part, key, None)) for part, key in _along_joints(scene)]
    return max((_size(value) for name, value in given if value is not None and _slides(system, turns, name)), default=0.0)


def _along_joints(scene) -> Iterator[tuple]:
    parts = [*scene.contacts.values(), *scene.loads.values()]
    return ((part, key) for part in parts if hasattr(part, "joint") for key in ("lowest", "highest", "rest"))


def _falls(system, turns) -> float:
    """Height from which a body falls to the speeds of the start, or by which gravity strains a spring."""
    gravity = float(np.linalg.norm(system.scene.gravity))
    if not gravity:
        return 0.0
    speeds = [start.rate for name, start in system.scene.starts.items() if _slides(system, turns, name)]
    fastest = max(map(_size, speeds), default=0.0)
    stiffest = max((getattr(load, "stiffness", 0.0) for load in system.scene.loads.values()), default=0.0)
    return fastest**2 / gravity or (system.Phi[3::6].sum() * gravity / stiffest if stiffest else 0.0)


def _mass(system, length: float) -> float:
    """Mass of all bodies; of bodies without, that which has their moments of inertia at the unit of length [kg]."""
    moments = system.Phi.reshape(-1, 6)[:, :3].max(initial=0.0)
    return _first((float(system.Phi[3::6].sum()), float(moments) / length**2))


def _time(system, length: float, mass: float, coordinates: np.ndarray) -> float:
    """First kind of time that is not zero [s]."""
    kinds = (_pendulum, _turns, _oscillates, _pushed)
    return _first(kind(system, length, mass, coordinates) for kind in kinds)


def _pendulum(system, length, mass, coordinates) -> float:
    gravity = float(np.linalg.norm(system.scene.gravity))
    return float(np.pi * np.sqrt(length / gravity)) if gravity else 0.0


def _turns(system, length, mass, coordinates) -> float:
    """Time in which the quickest start, or prescribed motion, goes by one unit."""
    scene, found = system.scene, []
    for name, start in scene.starts.items():
        if name in scene.states:  # values of any unit, no rates
            continue
        joint = system.joint(name)
        found.append(_inverse(np.abs(np.asarray(start.rate) / coordinates[joint.v]).max(initial=0.0)))
    for part in [*scene.relations.values(), *scene.set_valued.values()]:
        unit = _unit(system, part, length, coordinates)
        if getattr(part, "speed", None) is not None:
            found.append(_reaches(part.speed, unit, 1))
        followed = getattr(part, "position", None) if hasattr(part, "joint") else getattr(part, "path", None)
        if callable(followed):
            found.append(_inverse(_quickest(followed, unit) / unit))
    return min(filter(None, found), default=0.0)


def _oscillates(system, length, mass, coordinates) -> float:
    """Half a period of the whole mass on the stiffest spring."""
    stiffest = 0.0
    for load in system.scene.loads.values():
        share = _unit(system, load, length, coordinates) / length
        stiffest = max(stiffest, getattr(load, "stiffness", 0.0) * share**2)
    return float(np.pi * np.sqrt(_inverse(stiffest) * mass))


def _pushed(system, length, mass, coordinates) -> float:
    """Time in which the largest force, or without any a damper, moves the whole mass by one unit, or stops it."""
    found, damping = [], 0.0
    for part in [*system.scene.loads.values(), *system.scene.set_valued.values()]:
        unit = _unit(system, part, length, coordinates)
        given = {field.name: getattr(part, field.name) for field in fields(part)}
        for key in ("effort", "force", "limit", "torque"):
            found.append(_reaches(given.get(key), mass * length * length / unit, 2))
        found.append(_reaches(given.get("moment"), mass * length * length, 2))
        damping = max(damping, given.get("damping", 0.0) * (unit / length) ** 2)
    return min(filter(None, found), default=0.0) or mass * _inverse(damping)


def _unit(system, part, length: float, coordinates: np.ndarray) -> float:
    """Unit of the coordinate along which a part acts; of length between points."""
    name = getattr(part, "joint", None) or getattr(part, "driven", None)
    return length if name is None else float(coordinates[system.column(name)])


def _slides(system, turns: np.ndarray, name: str) -> bool:
    """Whether a joint, or one rate of a joint, slides."""
    joint, k = system.coordinate(name)
    return joint.pair.n_v > 0 and not turns[joint.v if k is None else joint.v.start + k].any()


def _reaches(law, unit: float, order: int) -> float:
    """Time in which a constant, or law of time, times tᵒʳᵈᵉʳ is one unit; 0 if it never is."""
    if law is None or not callable(law):
        return _inverse(_size(law) / unit) ** (1.0 / order)
    peak = 0.0
    for t in SAMPLED_TIMES:
        peak = max(peak, _size(_value(law, t)))
        if peak * t**order >= unit:
            return float((unit / peak) ** (1.0 / order))
    return 0.0


def _quickest(law, unit: float) -> float:
    """Largest mean rate of a law of time from its start on, until it has gone by one unit."""
    begin, peak = _value(law, 0.0), 0.0
    for t in SAMPLED_TIMES:
        moved = _size(_value(law, t) - begin)
        if moved > LEAST_CHANGE * _size(begin):
            peak = max(peak, moved / t)
        if moved >= unit:
            break
    return peak


def _value(law, t: float) -> np.ndarray:
    """Value of a law of time; nothing where it has none, or asks for more than the time."""
    # A law of the user's may fail outside of the times that it is made for, and may keep something from a call.
    with suppress(Exception), preserved(law), np.errstate(all="ignore"):
        if values.arguments(law) == 1:
            return np.nan_to_num(np.atleast_1d(np.asarray(values.evaluate(law, t), dtype=float)), posinf=0.0, neginf=0.0)
    return np.zeros(1)


def _size(value) -> float:
    """Largest number in a number, a list, or lists; 0 of anything else."""
    if isinstance(value, Real | np.ndarray | list | tuple):
        return float(np.abs(np.asarray(value, dtype=float)).max(initial=0.0))
    return 0.0


def _inverse(value: float) -> float:
    return float(1.0 / value) if value else 0.0


def _first(found: Iterable[float]) -> float:
    """First number that is not zero; 1 if there is none: then any unit is as good."""
    return float(next((value for value in found if value), 1.0))
