"""Scales of constraint rows: change of a residual while the mechanism moves by one unit of its scale.

Residuals are relative to them: the length of the scene for a distance, 1 for an angle, and the size of the gradient for the
constraints of a user.
"""

from collections.abc import Callable
from functools import wraps

import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.store import cached
from gauss.errors import GaussError
from gauss.scene import OneSidedConstraint, Stop
from gauss.system import Relations, System, retract, sides
from gauss.system.relations import place_relations

GRADIENT_DISTANCE = 0.1  # units: distance from the start at which gradients are taken that vanish there


def _once(scales: Callable[[System], np.ndarray]) -> Callable[[System], np.ndarray]:
    """Function of a system that is evaluated once for each."""
    return wraps(scales)(lambda system: cached(system, (scales,), lambda: scales(system)))


@_once
def constraint_scales(system: System) -> np.ndarray:
    """Scales (r,) of all rows, in the order of :func:`gauss.dynamics.assemble.position_residual`."""
    length, coordinates = system.scale.length, system.scale.coordinates
    joint = np.array([1.0, 1.0, 1.0, length, length, length])
    driven = [coordinates[system.column(coupling.driven)] for coupling in system.scene.couplings.values()]
    return np.concatenate([*[joint] * len(system.joints), driven, relation_scales(system, system.relations)])


def contact_scales(system: System) -> np.ndarray:
    """Scales (n,) of the gap functions, of both tangential directions with friction, and of set-valued elements."""
    gaps, names = gap_scales(system), [placed.name for placed in system.contacts.placed]
    across = [gaps[names.index(placed.name)] for placed in system.slips.placed]
    return np.concatenate([gaps, np.repeat(across, 2), set_valued_scales(system)])


def set_valued_scales(system: System) -> np.ndarray:
    """Scales (g,) of the slip coordinates of set-valued elements."""
    units = system.scale.coordinates
    slides = [
        max((abs(factor) * units[system.column(joint)] for joint, factor in element.acts_on.items()), default=1.0)
        for element in system.scene.set_valued.values()
    ]
    return np.array(slides)


@_once
def gap_scales(system: System) -> np.ndarray:
    """Scales (m,) of the gap functions: unit of the coordinate of a stop, length of shapes, size of a gradient."""
    length, units, found = system.scale.length, system.scale.coordinates, []
    for side in sides(system.scene):
        if isinstance(side.whole, Stop):
            found.append(units[system.column(side.whole.joint)])
        elif isinstance(side.whole, OneSidedConstraint):
            found.append(relation_scales(system, place_relations(system, [side]))[0])
        else:
            found.append(length)
    return np.array(found)


def relation_scales(system: System, relations: Relations) -> np.ndarray:
    """Scales of the rows of relations at the start of the scene, or around it where their gradients vanish there."""
    if not relations.placed:
        return np.zeros(0)
    rng, start = np.random.default_rng(0), system.start()
    found = np.zeros(sum(placed.size for placed in relations.placed))
    for around in (0.0, GRADIENT_DISTANCE, GRADIENT_DISTANCE, GRADIENT_DISTANCE):
        away = around * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v)
        state = system.state(retract(system, start.q, away))
        seen = _slopes(system, relations, state)
        found = np.where(found > 0.0, found, seen)
        if (found > 0.0).all():
            return found
    return np.where(found > 0.0, found, system.scale.length)


@_once
def loop_distance_scales(system: System) -> np.ndarray:
    """Scales of the rows of :func:`gauss.dynamics.assemble.closure_distances`, in that order."""
    length, n = system.scale.length, len(system.joints)
    joints = sum(index < n for index in system.structure.closures)
    return np.concatenate([*[[1.0, length, length, length]] * joints, constraint_scales(system)[6 * n :]])


def _slopes(system: System, relations: Relations, state) -> np.ndarray:
    """Largest changes of the rows while a body or a coordinate moves by one unit; 0 for none."""
    length, units, found = system.scale.length, system.scale.coordinates, []
    try:
        rows = list(relations.rows(kinematics(system, state)))
    except GaussError:
        return np.zeros(sum(placed.size for placed in relations.placed))
    for placed, own in zip(relations.placed, rows, strict=True):
        bodies = [A * np.repeat([1.0, length], 3) for A in own.A]
        joints = [B * units[system.joints[index].v] for B, index in zip(own.B, placed.joints, strict=True)]
        found.append(np.abs(np.concatenate([np.zeros((placed.size, 1)), *bodies, *joints], axis=1)).max(axis=1))
    return np.concatenate(found)
