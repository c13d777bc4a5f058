"""Parameters of a sweep: names of numbers in a scene, their values, and the scene with these values."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gauss.errors import SceneError, did_you_mean
from gauss.scene import Scene, Start

GROUPS = ("bodies", "frames", "joints", "couplings", "relations", "shapes", "contacts", "set_valued", "loads")
UNITS = {
    "mass": "kg",
    "inertia": "kg m²",
    "com": "m",
    "at": "m",
    "other_at": "m",
    "child_at": "m",
    "length": "m",
    "radius": "m",
    "position": "m",
    "gravity": "m/s²",
    "force": "N",
    "moment": "N m",
}
POSITIVE = ("mass", "length", "radius")  # of which no element may have 0
PARAMETER = re.compile(r"^(?P<name>.+?)(?:\[(?P<number>\d+)\]|\.(?P<axis>[xyz]))?$")


@dataclass(frozen=True)
class Members:
    """Members of a sweep: every combination of the parameter values, or the i-th value of each parameter.

    Parameters
    ----------
    names : tuple of str
        Names of the parameters.
    values : tuple of ndarray
        Values of each parameter.
    together : bool
        Whether the i-th values of all parameters, which are equally many, make one member.
    """

    names: tuple[str, ...]
    values: tuple[np.ndarray, ...]
    together: bool = False

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return ("member",) if self.together else self.names

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions."""
        return self.values[0].shape if self.together else tuple(len(values) for values in self.values)

    @property
    def size(self) -> int:
        """Number of members."""
        return int(np.prod(self.shape))

    def of(self, begin: int, end: int) -> list[dict[str, float]]:
        """Values of some members by name."""
        if self.together:
            columns = [values[begin:end] for values in self.values]
        else:
            places = np.unravel_index(np.arange(begin, end), self.shape)
            columns = [values[place] for values, place in zip(self.values, places, strict=True)]
        return [dict(zip(self.names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def members(vary: Mapping[str, Sequence[float] | np.ndarray], together: bool) -> Members:
    """Members of a sweep, checked.

    Raises
    ------
    SceneError
        If there are no parameters, or values are not finite numbers.
    """
    if not isinstance(vary, Mapping) or not vary:
        raise SceneError(f"vary: expected names with their values, e.g. {{'crank.mass': [1.0, 1.5, 2.0]}}, got {vary!r}.")
    found = []
    for name, given in vary.items():
        try:
            values = np.atleast_1d(np.asarray(given, dtype=float))
        except (TypeError, ValueError):
            values = np.zeros((0, 0))
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            raise SceneError(f"vary: {name!r}: expected finite numbers, e.g. np.linspace(0.5, 2.0, 50), got {given!r:.80}.")
        found.append(values)
    lengths = {name: len(values) for name, values in zip(vary, found, strict=True)}
    if together and len(set(lengths.values())) > 1:
        raise SceneError(f"vary: values that are varied together need the same number of each, got {lengths}.")
    return Members(tuple(vary), tuple(found), together)


def ranges(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Values of texts such as "crank.mass=0.5:2:50" (from, to, how many) or "A.rate=5,10,15".

    Parameters
    ----------
    texts : sequence of str
        One for each name.

    Returns
    -------
    dict
        Values (n,) by name.

    Raises
    ------
    SceneError
        If a text is neither.
    """
    found = {}
    for text in texts:
        name, _, values = text.rpartition("=")
        try:
            if not name or name in found:
                raise ValueError
            if ":" in values:
                first, last, count = values.split(":")
                found[name] = np.linspace(float(first), float(last), int(count))
            else:
                found[name] = np.array([float(value) for value in values.split(",")])
        except ValueError:
            why = "is given twice" if name in found else "expected NAME=FROM:TO:COUNT or NAME=VALUE,VALUE,…"
            raise SceneError(f"vary: {text!r}: {why}, e.g. crank.mass=0.5:2:50.") from None
    return found


def scene_of(scene: Scene | Callable[..., Scene], values: Mapping[str, float]) -> Scene:
    """Scene with these values; a function that makes scenes is called with them by name.

    Raises
    ------
    SceneError
        If the scene has no such number, or does not accept a value.
    """
    if isinstance(scene, Scene):
        for name, value in values.items():
            scene = changed(scene, name, value)
        return scene
    made = scene(**values)
    if not isinstance(made, Scene):
        raise SceneError(f"{getattr(scene, '__name__', 'the function')}({values}): expected a Scene, got {made!r:.80}.")
    return made


def changed(scene: Scene, name: str, value: float) -> Scene:
    """Scene with another value of one number: "BODY.mass", "BODY.com.x", "JOINT.at[0]", "JOINT.rate", "gravity.y".

    Raises
    ------
    SceneError
        If there is no such number; the message says what there is.
    """
    path, index = _parsed(name)
    if path == "gravity":
        return replace(scene, gravity=_entry(name, scene.gravity, index, value))
    owner, _, key = path.rpartition(".")
    found = _elements(scene, name, owner or path)
    if is_start(scene, name):
        start = scene.starts.get(owner, Start(owner))
        start = replace(start, **{key: _entry(name, getattr(start, key), index, value)})
        return replace(scene, starts=scene.starts | {owner: start})
    having = [(group, element) for group, element in found if hasattr(element, key)]
    if len(having) != 1:
        _refuse(name, owner, key, found, bool(having))
    group, element = having[0]
    element = replace(element, **{key: _entry(name, getattr(element, key), index, value)})
    return replace(scene, **{group: getattr(scene, group) | {owner: element}})


def value_of(scene: Scene, name: str) -> float:
    """Value of a number of a scene, by the names of :func:`changed`.

    Raises
    ------
    SceneError
        If there is no such number; the message says what there is.
    """
    changed(scene, name, 0.0 if name.rpartition(".")[2] not in POSITIVE else 1.0)  # its checks and messages
    path, index = _parsed(name)
    owner, _, key = path.rpartition(".")
    found: Any
    if path == "gravity":
        found = scene.gravity
    elif is_start(scene, name):
        found = getattr(scene.starts.get(owner, Start(owner)), key)
    else:
        found = next(getattr(element, key) for _, element in _elements(scene, name, owner) if hasattr(element, key))
    return float(found if index is None else found[index])


def _elements(scene: Scene, name: str, owner: str) -> list[tuple[str, Any]]:
    """Elements of a name, with their groups."""
    found = [(group, getattr(scene, group)[owner]) for group in GROUPS if owner in getattr(scene, group)]
    if not found:
        names = {element for group in GROUPS for element in getattr(scene, group)}
        raise SceneError(f"vary: {name!r}: no {owner!r} in scene {scene.name!r}. {did_you_mean(owner, names)}")
    return found


def _parsed(name: str) -> tuple[str, int | None]:
    """Path of a parameter, and the index of its entry in a vector."""
    place = PARAMETER.match(name)
    if place is None:
        return name, None
    number = place["number"]
    return place["name"], "xyz".index(place["axis"]) if place["axis"] else None if number is None else int(number)


def _refuse(name: str, owner: str, key: str, found: list, ambiguous: bool):
    """Raise a SceneError where none or several of the found elements have a field."""
    fields_of = {f.name for _, element in found for f in fields(element) if f.name not in ("name", "kind")}
    of_joints = {"position", "rate"} if any(group == "joints" for group, _ in found) else set()
    why = f"several elements are called {owner!r}" if ambiguous else f"{owner!r} has no {key!r}"
    raise SceneError(f"vary: {name!r}: {why}. {did_you_mean(key, fields_of | of_joints)}")


def is_start(scene: Scene, name: str) -> bool:
    """Whether a name is that of an initial position or rate of a joint."""
    owner, _, key = _parsed(name)[0].rpartition(".")
    return key in ("position", "rate") and owner in scene.joints


def unit_of(name: str, coordinates: Mapping[str, str], rates: Mapping[str, str]) -> str | None:
    """Unit of a parameter, where it is known, given the units of coordinates and rates by name."""
    owner, _, key = _parsed(name)[0].rpartition(".")
    starts = {"position": coordinates, "rate": rates}.get(key, {})
    return starts.get(owner, UNITS.get(key))


def _entry(name: str, given, index: int | None, value: float):
    """New value of a number, or of a vector with another value of one entry."""
    if not isinstance(given, tuple):
        if index is not None:
            raise SceneError(f"vary: {name!r} is one number, without an index.")
        if callable(given) or isinstance(given, str | bool):
            raise SceneError(f"vary: {name!r} is {given!r:.60}, which is no number; vary a function that makes the scene.")
        return value
    if index is None or index >= len(given) or not isinstance(given[index], float):
        where = f"{name.split('[')[0]}[0] to [{len(given) - 1}]"
        raise SceneError(f"vary: {name!r} has {len(given)} entries; name one of them: {where}, or .x, .y, .z.")
    return (*given[:index], value, *given[index + 1 :])
