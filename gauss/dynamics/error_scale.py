"""What errors of accelerations are compared with: weight, and what rounding of positions does by way of springs."""

from contextlib import suppress
from copy import copy

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism
from gauss.errors import GaussError
from gauss.scene import Spring
from gauss.system import State, System, rate_units, retract

ACCELERATION_TOLERANCE = (
    1e-9  # error of compiled accelerations, relative to the largest of them, with which they are still used
)
ROUNDING = 5e-18  # in units of the scene; where s is left of a closing row, v² / s³ times as much of it are in accelerations
FLOOR = 1e-3  # of gravity: accelerations that small are compared with it
QUIET = 1e-12  # in units of the scene: the same without gravity
STATES, AROUND = 3, 0.2  # so many states around the start, by so much in units of the scene, stand for all of them
CANCELLED = 8.0  # roundings of terms of ω² in an acceleration
ROUNDOFF_TERMS = 4.0  # an error is the sum of some roundings, and the largest of many
SHAKES, AMPLITUDE = 8, 1e-6  # positions are moved so often, by such a share of their size, to see what it does to springs


def floor(system: System) -> float:
    """Size of accelerations below which errors are no longer relative to them, in coordinates of the scene [1/s²].

    A thousandth of gravity, or where stiff springs make more, what :data:`ACCELERATION_TOLERANCE` is a share of when rounding of positions is
    all that is wrong. Springs that hold a system at rest leave no accelerations, but their rounding stays: no method does
    better, for the certified recursion takes the forces of springs as given.
    """

    def made() -> float:
        scale, gravity = system.scale, float(np.linalg.norm(system.scene.gravity))
        return max(
            FLOOR * gravity / scale.length + QUIET / scale.time**2,
            ROUNDOFF_TERMS * rounding(system) / ACCELERATION_TOLERANCE,
        )

    return made() if system.dynamics is None else system.dynamics.on_demand((floor,), made)


def spin(system: System, v) -> Scalar:
    """Size of accelerations of which :data:`ACCELERATION_TOLERANCE` is what rounding makes of centrifugal ones, for rates v (n_v,) [rad/s²].

    A body that turns freely has no acceleration, but terms of ω² cancel to make none.
    """
    made = lambda: np.array([unit == "rad/s" for unit in rate_units(system).values()], dtype=bool)  # noqa: E731
    turns = made() if system.dynamics is None else system.dynamics.on_demand((spin,), made)
    fastest = 0.0
    for rate in np.asarray(v)[turns]:
        fastest = math.maximum(fastest, np.abs(rate))
    return CANCELLED * np.finfo(float).eps / ACCELERATION_TOLERANCE * fastest * fastest


def relative_error(system: System, found: np.ndarray, exact: np.ndarray, v) -> float:
    """Largest error of accelerations found (n_v,), relative to the largest exact one or to rounding."""
    off, size = (np.abs(part / system.scale.coordinates).max(initial=0.0) for part in (exact - found, exact))
    return off / max(size, floor(system) + spin(system, v))


def rounding(system: System) -> float:
    """Change of accelerations that rounding of positions makes by way of springs between points.

    Roundings are independent of each other, so it is the root mean square over random ones; the least of some states, lest
    one that is all but singular excuses errors in the others.
    """
    springs = [] if obstacles(system) else [bound for bound in system.loads if isinstance(bound.load, Spring)]
    found = []
    for state in consistent_states(system) if springs else ():
        with suppress(GaussError):  # as where the ends of a spring meet
            found.append(np.finfo(float).eps * _sensitivity(system, springs, state))
    return min((size for size in found if np.isfinite(size)), default=0.0)


def consistent_states(system: System):
    """States that meet the constraints: the start of the scene, and some around it."""
    rng, start = np.random.default_rng(0), system.start()
    for size in (0.0, *np.full(STATES, AROUND)):
        q = retract(system, start.q, size * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v))
        with suppress(GaussError):
            yield system.initial_state(q, start.v)


def _sensitivity(system: System, springs, state: State) -> float:
    """Largest change of accelerations over the relative change of positions that makes it."""
    motion, mechanism = kinematics(system, state), Mechanism(system, state.q, state.v, state.t)
    ends = [motion.position(*end) for b in springs for end in ((b.load.body, b.load.at), (b.load.other, b.load.other_at))]
    reach, rng = np.abs([*ends, *motion.x]).max(), np.random.default_rng(0)
    before, changes = _accelerations(mechanism, motion, springs), []
    for _ in range(SHAKES):
        shaken = copy(motion)
        shaken.x = [x + AMPLITUDE * reach * rng.choice([-1.0, 1.0], 3) for x in motion.x[:-1]] + motion.x[-1:]
        changes.append((_accelerations(mechanism, shaken, springs) - before) / system.scale.coordinates)
    return np.sqrt(np.mean(np.square(changes), axis=0)).max(initial=0.0) / AMPLITUDE


def _accelerations(mechanism: Mechanism, motion: Kinematics, springs) -> np.ndarray:
    applied = Applied(motion, springs)
    return mechanism.motion(applied.P, applied.on_bodies(motion))[0].astype(float)  # relations leave an array of objects
