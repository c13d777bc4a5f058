"""Pickling: a system is pickled as its scene and built again; laws that pickle cannot take are refused by name."""

import pickle
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import FrameType

from gauss.codegen import content_key
from gauss.errors import UnpicklableError

FUNCTIONS_BY_VALUE = ("copy", "cloudpickle", "dill")  # modules that take functions without a module name


def rebuilding(system) -> tuple:
    """Reduction of a system for pickle: to its scene; machine code and computed properties are not pickled.

    UnpicklableError if its scene has been changed since, or holds a law that pickle cannot take.
    """
    build = import_module("gauss.system.build").build  # which makes systems
    check_laws(system.scene)
    dynamics = None if system.dynamics is None else system.dynamics.anew()
    if _made_of(build(system.scene)) != _made_of(system):
        raise UnpicklableError(
            f"scene {system.scene.name!r} has been changed since its system was compiled, and a pickled system is made "
            "again from its scene: compile it anew first."
        )
    return build, (system.scene, dynamics)


def _made_of(system):
    """Content of a system that results depend on, as a key."""
    loads = [bound.load for bound in system.loads]
    return content_key((system.structure, system.Phi, system.joints, system.frames, loads))


def check_laws(scene):
    """Refuse laws that pickle cannot take, by their names.

    UnpicklableError if there is one, and the caller takes functions by their names only.
    """
    if _takes_functions():
        return
    for name, law in _laws(scene):
        try:
            pickle.dumps(law)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise UnpicklableError(
                f"scene {scene.name!r} cannot be pickled: {name} is a function that no module has under its name ({error}). "
                "Define it by def at the top of a module, or give workers the means to make the scene."
            ) from None


def _laws(scene) -> Iterator[tuple[str, object]]:
    """Functions in the elements of a scene, with their names in messages."""
    collections = [value for value in vars(scene).values() if isinstance(value, dict)]
    for element in (element for collection in collections for element in collection.values() if is_dataclass(element)):
        for field in fields(element):
            law = getattr(element, field.name)
            if callable(law) and not isinstance(law, type):
                what = getattr(element, "what", None) or f"{type(element).__name__.lower()} {getattr(element, 'name', '')!r}"
                yield f"{field.name} of {what}", law


def _takes_functions() -> bool:
    """Whether one of the callers takes functions that have no name in a module."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        module = frame.f_globals.get("__name__", "")
        if any(part in FUNCTIONS_BY_VALUE for part in module.split(".")):
            return True
        frame = frame.f_back
    return False
