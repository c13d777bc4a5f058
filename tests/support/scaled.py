"""A scene in other units: every length, time and mass multiplied by a factor, and what is made of them with it."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace

import numpy as np

import gauss
from gauss.scene import Contact, Scene
from gauss.scene.values import arguments, evaluate
from gauss.system import State, System, rate_units

# Fields by what they are multiplied with: powers of (length, time, mass).
PLAIN = {"mass": (0, 0, 1), "inertia": (2, 0, 1), "force": (1, -2, 1), "moment": (2, -2, 1), "path": (1, 0, 0)}
PLAIN |= dict.fromkeys(("com", "at", "child_at", "other_at", "pitch", "length", "radius", "crown", "on_radius"), (1, 0, 0))
PLAIN |= dict.fromkeys(("size", "points"), (1, 0, 0))
# Fields along a coordinate: powers of (its unit, time, energy).
ALONG = dict.fromkeys(("lowest", "highest", "limits", "rest", "backlash", "offset"), (1, 0, 0))
ALONG |= {"effort": (-1, 0, 1), "limit": (-1, 0, 1), "torque": (-1, 0, 1), "hold": (-1, 0, 1)}
ALONG |= {"stiffness": (-2, 0, 1), "damping": (-2, 1, 1), "speed": (1, -1, 0)}


@dataclass(frozen=True)
class Units:
    """Factors of lengths, times and masses."""

    length: float = 1.0
    time: float = 1.0
    mass: float = 1.0

    @property
    def energy(self) -> float:
        """Factor of energies and moments."""
        return self.mass * (self.length / self.time) ** 2

    def times(self, value, length: float, time: float, mass: float):
        """Value, several of them, or a law of time, with powers of the units."""
        return self.law(value, self.length**length * self.time**time * self.mass**mass)

    def law(self, value, factor: float):
        """Value, several of them, or a law of time, multiplied."""
        if value is None:
            return None
        if callable(value):
            assert arguments(value) == 1, "laws that ask where things are cannot be put into other units"
            return lambda t: factor * evaluate(value, t / self.time)
        if isinstance(value, tuple | list):
            return tuple(self.law(entry, factor) for entry in value)
        return value * factor


def scaled(scene: Scene, units: Units) -> Scene:
    """The same scene in other units."""
    system = gauss.compile_scene(scene)
    unit = _unit_of(system, units)
    made = Scene(scene.name, tuple(units.times(scene.gravity, 1, -2, 0)))
    parts = (scene.bodies, scene.frames, scene.joints, scene.couplings, scene.shapes, scene.relations)
    for part in (*parts, scene.contacts, scene.set_valued, scene.loads):
        for element in part.values():
            made.add(_in_units(element, units, unit))
    for name, start in scene.starts.items():
        made.add(_start(start, system.joint(name), units, unit))
    return made


def state_in(system: System, units: Units, q, v) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (…, n_q) and rates (…, n_v) of a system, put into other units."""
    rates = np.array([units.length if name == "m/s" else 1.0 for name in rate_units(system).values()])
    coordinates = []
    for joint in system.joints:
        k = joint.pair.quaternion
        own = rates[joint.v]
        coordinates.append(own if k is None else np.concatenate([own[:k], np.ones(4)]))
    return q * np.concatenate(coordinates), v * rates / units.time


def put(state: State, system: System, units: Units) -> State:
    """State in other units."""
    return State(state.t * units.time, *state_in(system, units, state.q, state.v))


def _unit_of(system: System, units: Units) -> Callable[[str], float]:
    kinds = list(rate_units(system).values())
    return lambda name: units.length if kinds[system.column(name)] == "m/s" else 1.0


def _in_units(element, units: Units, unit: Callable[[str], float]):
    """Element with every field that has a unit multiplied."""
    name = getattr(element, "joint", "") or getattr(element, "driven", "")
    along = hasattr(element, "joint") or hasattr(element, "driven")
    if type(element).__name__ == "Joint":
        name, along = element.name, False
    changes = {}
    for field in fields(element):
        key, value = field.name, getattr(element, field.name)
        if value is None or isinstance(value, str) or isinstance(element, Contact):
            continue
        if key == "position":
            factor = unit(name) if along else units.length
            changes[key] = units.law(value, factor)
        elif key == "ratio":
            own, other = unit(element.driven), unit(element.driver)
            changes[key] = value * (own / other if type(element).__name__ == "Coupling" else other / own)
        elif key in ALONG and (along or key == "limits"):
            power, time, energy = ALONG[key]
            changes[key] = units.law(value, unit(name) ** power * units.time**time * units.energy**energy)
        elif key in ALONG and key in ("stiffness", "damping"):  # between points
            changes[key] = units.times(value, 0, -2 if key == "stiffness" else -1, 1)
        elif key in PLAIN:
            changes[key] = units.times(value, *PLAIN[key])
        else:
            assert not callable(value) and (not is_dataclass(value)), f"{element}: no rule for {key}"
    return replace(element, **changes)


def _start(start, joint, units: Units, unit):
    own = np.ones(joint.pair.n_v)
    turning, _ = joint.pair.subspace(np.array(joint.pair.reference))
    own = np.where(np.abs(turning).sum(axis=0) > 0, 1.0, units.length)
    k = joint.pair.quaternion
    places = own if k is None else np.concatenate([own[:k], np.ones(4)])
    several = lambda value, factors: (np.asarray(value) * factors).tolist() if np.ndim(value) else float(value * factors[0])  # noqa: E731
    position = None if start.position is None else several(start.position, places)
    rate = several(start.rate, own / units.time) if np.ndim(start.rate) or start.rate else 0.0
    return replace(start, position=position, rate=rate)
