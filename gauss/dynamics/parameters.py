"""Numbers of a system that its equations take as they come: what differs between systems of one kind becomes parameters.

Masses and inertias, where joints and frames sit, gravity, the constants of loads. Everything else, the shape of the tree,
kinds of joints, rows that are left out, ratios, laws, is the kind of the system: what is written down depends on it.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from types import FunctionType

import numpy as np

from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.given_link_frames import known
from gauss.scene import Drive, Force, Pair
from gauss.scene.values import as_function
from gauss.system import BoundLoad, Dynamics, Stage, Subsystem, System

TAKEN = ("Phi", "gravity", "joints", "carried", "links", "sides")  # of a part
MOVED = ("Phi", "joints", "frames")  # of a system


def numbers(system: System) -> tuple[np.ndarray, tuple]:
    """Numbers (n,) of a system, and its kind: systems of one kind differ in their numbers only."""
    found, kind = [], []

    def take(array: np.ndarray) -> np.ndarray:
        found.append(array)
        kind.append(array.shape)
        return array

    def keep(array: np.ndarray) -> np.ndarray:
        kind.append(array.tobytes())
        return array

    parts = [known(part) for part in system.parts]
    take(np.array(system.scene.gravity))
    _mapped([getattr(system, name) for name in MOVED], take, kind.append)
    _mapped([bound.load for bound in system.loads], take, kind.append)
    for part in parts:
        _mapped([getattr(part, name) for name in TAKEN], take, kind.append)
        kind += [repr(getattr(part, f.name)) for f in fields(Subsystem) if f.name not in TAKEN]
    for relations in (system.relations, system.contacts, system.slips, system.grips):
        kind.append(relations.function.text() if relations.placed else "")
    _mapped([system.scene.contacts, system.scene.grips], keep, kind.append)
    return np.concatenate([np.ravel(array) for array in found]), tuple(kind)


def with_numbers(system: System, values, dynamics: Dynamics) -> System:
    """System of the same kind with other numbers, which may be expressions of a shared graph.

    Parameters
    ----------
    system : System
        One of the kind.
    values : sequence of float or Expression
        Numbers in the order of :func:`numbers`.
    dynamics : Dynamics
        What its accelerations come from.
    """
    values, place = np.asarray(values, dtype=object), 0
    constraint_scales(system)  # of numbers: those of expressions could not be told

    def give(array: np.ndarray) -> np.ndarray:
        nonlocal place
        place += array.size
        given = values[place - array.size : place].reshape(array.shape)
        return given if any(not isinstance(entry, float) for entry in given.flat) else given.astype(float)

    parts, ignore = [known(part) for part in system.parts], lambda word: None
    scene = _changed(system.scene, {"gravity": tuple(give(np.array(system.scene.gravity)))})
    moved = _mapped([getattr(system, name) for name in MOVED], give, ignore)
    loads = _mapped([bound.load for bound in system.loads], give, ignore)
    loads = tuple(BoundLoad(load, _laws(load)) for load in loads)
    parts = tuple(
        _changed(part, zip(TAKEN, _mapped([getattr(part, name) for name in TAKEN], give, ignore), strict=True))
        for part in parts
    )
    stages = (Stage("parameters stand for numbers", (), parts),)
    others = {"scene": scene, "loads": loads, "dynamics": dynamics, "reduction": stages, "scale": system.scale}
    return _changed(system, dict(zip(MOVED, moved, strict=True)) | others)


def _laws(load) -> tuple[Callable, ...]:
    if isinstance(load, Drive):
        return (as_function(load.effort),)
    return (as_function(load.force), as_function(load.moment)) if isinstance(load, Force) else ()


def _mapped(thing, take: Callable, say: Callable):
    """The same thing with every array of numbers in it replaced; whatever else there is, is said."""
    if isinstance(thing, float):
        return take(np.array([thing])).ravel()[0]
    if isinstance(thing, np.ndarray):
        return take(thing)
    if isinstance(thing, Pair):
        say((thing.kind, np.concatenate(thing.subspace(np.array(thing.reference))).tobytes()))
        return thing
    if isinstance(thing, dict):
        say(tuple(thing))
        return {key: _mapped(entry, take, say) for key, entry in thing.items()}
    if isinstance(thing, list | tuple):
        say((type(thing).__name__, len(thing)))
        made = [_mapped(entry, take, say) for entry in thing]
        return type(thing)(*made) if hasattr(thing, "_fields") else type(thing)(made)
    if is_dataclass(thing):
        names = [f.name for f in fields(thing)]
        return _changed(thing, {name: _mapped(getattr(thing, name), take, say) for name in names})
    say(_word(thing))
    return thing


def _word(thing):
    """What is compared of a thing: of a function its code and what it was made with."""
    if isinstance(thing, FunctionType):
        made_with = [cell.cell_contents for cell in thing.__closure__ or ()]
        return thing.__code__, thing.__module__, tuple(_word(entry) for entry in (*made_with, *(thing.__defaults__ or ())))
    if isinstance(thing, np.ndarray):
        return thing.shape, thing.dtype.str, thing.tobytes()
    try:
        hash(thing)
    except TypeError:
        return repr(thing)
    return thing


def _changed(thing, changes):
    """A copy of a frozen record with other fields, not checked again: they may be no numbers."""
    made = copy(thing)
    for name, value in dict(changes).items():
        made.__dict__[name] = value
    return made
