"""Numbers of a scene by their names, as "rod.mass" or "gravity.y": their values, and the scene with other ones."""

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

from gauss.errors import SceneError, did_you_mean
from gauss.scene.loads import Start
from gauss.scene.scene import Scene

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


def scene_of(scene: Scene | Callable[..., Scene], values: Mapping[str, float]) -> Scene:
    """Scene with these values; a function that makes scenes is called with them by name.

    SceneError if the scene has no such number, or does not accept a value.
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

    SceneError if there is no such number; the message says what there is.
    """
    path, index = parsed(name)
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

    SceneError if there is no such number; the message says what there is.
    """
    changed(scene, name, 0.0 if name.rpartition(".")[2] not in POSITIVE else 1.0)  # its checks and messages
    path, index = parsed(name)
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


def parsed(name: str) -> tuple[str, int | None]:
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
    owner, _, key = parsed(name)[0].rpartition(".")
    return key in ("position", "rate") and owner in scene.joints


def unit_of(name: str, coordinates: Mapping[str, str], rates: Mapping[str, str]) -> str | None:
    """Unit of a parameter, where it is known, given the units of coordinates and rates by name."""
    owner, _, key = parsed(name)[0].rpartition(".")
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
