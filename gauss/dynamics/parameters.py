"""Numbers of a system that may become parameters of traced code: masses, inertias, frames, gravity, constants of loads.

Everything else, the topology of the tree, kinds of joints, redundant rows, ratios, laws, is the kind of the system, on which
traced code depends.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, is_dataclass

import numpy as np

from gauss.codegen import Graph, content_key
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.given_link_frames import with_given_frames
from gauss.scene import Drive, Force, Pair
from gauss.scene.values import as_function
from gauss.system import BoundLoad, Dynamics, Stage, Subsystem, System

SUBSYSTEM_FIELDS = ("Phi", "gravity", "joints", "carried", "links", "sides")  # with numbers
SYSTEM_FIELDS = ("Phi", "joints", "frames")  # with numbers


def numbers(system: System) -> tuple[np.ndarray, tuple]:
    """Numbers (n,) of a system, and its kind: systems of one kind differ in their numbers only."""
    found: list[np.ndarray] = []
    kind: list = []

    def take(array: np.ndarray) -> np.ndarray:
        found.append(array)
        kind.append(array.shape)
        return array

    def keep(array: np.ndarray) -> np.ndarray:
        kind.append(array.tobytes())
        return array

    subsystems = [with_given_frames(subsystem) for subsystem in system.subsystems]
    take(np.array(system.scene.gravity))
    _mapped([getattr(system, name) for name in SYSTEM_FIELDS], take, kind.append)
    _mapped([bound.load for bound in system.loads], take, kind.append)
    for subsystem in subsystems:
        _mapped([getattr(subsystem, name) for name in SUBSYSTEM_FIELDS], take, kind.append)
        kind += [repr(getattr(subsystem, f.name)) for f in fields(Subsystem) if f.name not in SUBSYSTEM_FIELDS]
    for relations in (system.relations, system.contacts, system.slips, system.set_valued):
        kind.append("" if relations.function is None else relations.function.text())
    _mapped([system.scene.contacts, system.scene.set_valued], keep, kind.append)
    return np.concatenate([np.ravel(array) for array in found]), tuple(kind)


def with_numbers(system: System, values, dynamics: Dynamics) -> System:
    """System of the same kind with other numbers, which may be expressions of a shared graph.

    ``values``: numbers in the order of :func:`numbers`.
    """
    values, place = np.asarray(values, dtype=object), 0
    constraint_scales(system)  # cached for the numbers: expressions have no scales

    def give(array: np.ndarray) -> np.ndarray:
        nonlocal place
        place += array.size
        given = values[place - array.size : place].reshape(array.shape)
        return given if any(not isinstance(entry, float) for entry in given.flat) else given.astype(float)

    ignore = lambda word: None  # noqa: E731
    scene = changed(system.scene, {"gravity": tuple(give(np.array(system.scene.gravity)))})
    moved = _mapped([getattr(system, name) for name in SYSTEM_FIELDS], give, ignore)
    loads = _mapped([bound.load for bound in system.loads], give, ignore)
    loads = tuple(BoundLoad(load, _laws(load)) for load in loads)
    subsystems = tuple(
        changed(
            written,
            zip(SUBSYSTEM_FIELDS, _mapped([getattr(written, name) for name in SUBSYSTEM_FIELDS], give, ignore), strict=True),
        )
        for written in map(with_given_frames, system.subsystems)
    )
    stages = (Stage("parameters stand for numbers", (), subsystems),)
    others = {"scene": scene, "loads": loads, "dynamics": dynamics, "reduction": stages, "scale": system.scale}
    return changed(system, dict(zip(SYSTEM_FIELDS, moved, strict=True)) | others)


def count(thing) -> int:
    """Number of numbers of a part of a system."""
    sizes = []

    def take(array: np.ndarray) -> np.ndarray:
        sizes.append(array.size)
        return array

    _mapped(thing, take, lambda word: None)
    return sum(sizes)


def _laws(load) -> tuple[Callable, ...]:
    if isinstance(load, Drive):
        return (as_function(load.effort),)
    return (as_function(load.force), as_function(load.moment)) if isinstance(load, Force) else ()


def _mapped(thing, take: Callable, say: Callable):
    """Copy with every array of numbers replaced by ``take``; everything else is reported to ``say``."""
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
        return changed(thing, {name: _mapped(getattr(thing, name), take, say) for name in names})
    say(content_key(thing))
    return thing


def changed(thing, changes):
    """Copy of a frozen dataclass with other fields, without its checks: they may be expressions."""
    made = copy(thing)
    for name, value in dict(changes).items():
        made.__dict__[name] = value
    return made


@dataclass(frozen=True)
class ParametrisedSystem:
    """Systems of one kind."""

    pattern: System  # one of them
    system: System  # system with parameters, expressions of a shared graph, for the numbers that differ
    varied: np.ndarray  # places of the parameters among the numbers of a system

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(f"p[{k}]" for k in range(len(self.varied)))


def parametrised(pattern: System, members: np.ndarray) -> ParametrisedSystem:
    """Parametrised system of systems of one kind.

    ``pattern``: one of them. ``members`` (batch, n): numbers of each, see :func:`gauss.dynamics.parameters.numbers`.
    """
    varied = np.flatnonzero((members != members[0]).any(axis=0))
    values, graph = members[0].astype(object), Graph(shared=True)
    values[varied] = [graph.symbol(f"p[{k}]") for k in range(len(varied))]
    return ParametrisedSystem(pattern, with_numbers(pattern, values, pattern.mechanics), varied)
