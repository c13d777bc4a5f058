"""Scale of errors of accelerations: max(‖q̈‖, gravity / 1000, round-off of positions in stiff springs, ε ω²)."""

from collections.abc import Iterator
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.conditions import is_large, obstacles
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.store import cached, cached_on_disk
from gauss.errors import GaussError
from gauss.scene import Spring
from gauss.system import State, System, rate_units, retract

ACCELERATION_TOLERANCE = 1e-9  # relative error of compiled accelerations above which the certified engine takes over
NEAR_SINGULAR_ROUNDOFF = 5e-18  # units of the scene: round-off of accelerations is this times v² / s³ for a pivot s² of S
LEAST_SHARE_OF_GRAVITY = 1e-3  # smaller accelerations have errors relative to this one
LEAST_ACCELERATION = 1e-12  # the same without gravity, in units of the scene
STATES, AROUND = 3, 0.2  # number of random states around the start, and their distance in units of the scene
CENTRIFUGAL_ROUNDOFFS = 8.0  # number of round-off errors of terms of ω² in an acceleration
ROUNDOFF_TERMS = 4.0  # factor for sums of several round-off errors, and the largest of many sums
SAMPLES, AMPLITUDE = 8, 1e-6  # random changes of positions, relative to their size, for the sensitivity of springs


def acceleration_scale(system: System) -> float:
    """Size of accelerations below which errors are no longer relative to them, in coordinates of the scene [1/s²].

    A thousandth of gravity, or, with stiff springs, the round-off of positions divided by :data:`ACCELERATION_TOLERANCE`.
    Springs that hold a system at rest leave no accelerations, but their round-off stays, for any method: the certified
    recursion takes the forces of springs as given.
    """

    def made() -> float:
        scale, gravity = system.scale, float(np.linalg.norm(system.scene.gravity))
        least = LEAST_SHARE_OF_GRAVITY * gravity / scale.length + LEAST_ACCELERATION / scale.time**2
        springs = any(isinstance(bound.load, Spring) for bound in system.loads)
        roundoff = cached_on_disk(system, (spring_roundoff,), lambda: spring_roundoff(system)) if springs else 0.0
        return max(least, ROUNDOFF_TERMS * roundoff / ACCELERATION_TOLERANCE)

    return cached(system, (acceleration_scale,), made)


def centrifugal_scale(system: System, v) -> Scalar:
    """Round-off of centrifugal accelerations over :data:`ACCELERATION_TOLERANCE`, for rates v (n_v,) [rad/s²].

    A body that turns freely has no acceleration, but it is a difference of terms of ω².
    """
    made = lambda: np.array([unit == "rad/s" for unit in rate_units(system).values()], dtype=bool)  # noqa: E731
    turns = cached(system, (centrifugal_scale,), made)
    fastest = 0.0
    for rate in np.asarray(v)[turns]:
        fastest = math.maximum(fastest, np.abs(rate))
    return CENTRIFUGAL_ROUNDOFFS * np.finfo(float).eps / ACCELERATION_TOLERANCE * fastest * fastest


def relative_error(system: System, found: np.ndarray, exact: np.ndarray, v) -> float:
    """Largest error of accelerations found (n_v,), relative to the largest exact one or to spring_roundoff."""
    off, size = (np.abs(part / system.scale.coordinates).max(initial=0.0) for part in (exact - found, exact))
    return off / max(size, acceleration_scale(system) + centrifugal_scale(system, v))


def spring_roundoff(system: System) -> float:
    """Change of accelerations by round-off of positions in springs between points, in coordinates of the scene [1/s²].

    The root mean square over independent random errors; the least of several states, because a near-singular one would
    excuse errors in the others.
    """
    springs = (
        [] if obstacles(system) or is_large(system) else [bound for bound in system.loads if isinstance(bound.load, Spring)]
    )
    found = []
    for state in consistent_states(system) if springs else ():
        with suppress(GaussError):  # as where the ends of a spring meet
            found.append(np.finfo(float).eps * _sensitivity(system, springs, state))
    return min((size for size in found if np.isfinite(size)), default=0.0)


def states_around(system: System) -> Iterator[State]:
    """The start of the scene, and random states around it; they need not meet the constraints."""
    rng, start = np.random.default_rng(0), system.start()
    for size in (0.0, *np.full(STATES, AROUND)):
        yield replace(
            start, q=retract(system, start.q, size * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v))
        )


def consistent_states(system: System, start: State | None = None) -> Iterator[State]:
    """States that meet the constraints: the start of the scene, or a given one that does, and random ones around it."""
    around = states_around(system)
    if start is not None:
        next(around)
        yield start
    for state in around:
        with suppress(GaussError):
            yield system.initial_state(state.q, state.v)


def _sensitivity(system: System, springs, state: State) -> float:
    """Largest change of accelerations over the relative change of positions."""
    motion, mechanism = kinematics(system, state), Mechanism(system, state.q, state.v, state.t)
    ends = [motion.position(*end) for b in springs for end in ((b.load.body, b.load.at), (b.load.other, b.load.other_at))]
    reach, rng = np.abs([*ends, *motion.x]).max(), np.random.default_rng(0)
    before, changes = _accelerations(mechanism, motion, springs), []
    for _ in range(SAMPLES):
        moved = copy(motion)
        moved.x = [x + AMPLITUDE * reach * rng.choice([-1.0, 1.0], 3) for x in motion.x[:-1]] + motion.x[-1:]
        changes.append((_accelerations(mechanism, moved, springs) - before) / system.scale.coordinates)
    return np.sqrt(np.mean(np.square(changes), axis=0)).max(initial=0.0) / AMPLITUDE


def _accelerations(mechanism: Mechanism, motion: Kinematics, springs) -> np.ndarray:
    applied = Applied(motion, springs)
    return mechanism.motion(applied.P, applied.on_bodies(motion))[0].astype(float)  # relations leave an array of objects
