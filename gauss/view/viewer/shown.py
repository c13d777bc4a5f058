"""Content of a view: the computed motion, its pictures at equally spaced times, and what is drawn with them."""

from dataclasses import dataclass, replace

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import StateError, did_you_mean, require
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.simulation.motion_records import Stats

FRAMES = 30  # per second
MOST_PICTURES = 1800  # pictures of a file; a longer motion has fewer per second
NOT_SIMULATED = Stats(0, 0, 0, 0, 0.0, 0.0, "not simulated")


@dataclass(frozen=True)
class Shown:
    """Content of a view."""

    # motion, pictures: the motion, and the same at equally spaced times; of one sample for a scene that does not move
    motion: Trajectory
    pictures: Trajectory
    visuals: tuple = ()  # given meshes
    joints: tuple[str, ...] = ()  # joints whose reactions are drawn as arrows
    traces: tuple[str, ...] = ()  # bodies, whose centres of mass leave a trace, and frames, whose origins do


def shown(thing: Scene | Trajectory, frames: int, visuals=(), joints=(), traces=None) -> Shown:
    """View of a scene at its start, or of a motion; traces of the bodies that carry no others if none are named.

    StateError if the name of a trace is that of no body or frame.
    """
    require(thing, (Scene, Trajectory), "show")
    if isinstance(thing, Scene):
        system = compile_scene(thing)
        start = system.initial_state()
        motion = pictures = Trajectory(
            system, np.array([start.t]), start.q[None], start.v[None], np.zeros((1, 3)), NOT_SIMULATED
        )
    else:
        span = float(thing.t[-1] - thing.t[0])
        motion, pictures = thing, resampled(thing, max(1, min(MOST_PICTURES, 1 + round(span * frames))))
    system = motion.system
    places = [*system.structure.bodies, *system.scene.frames]
    for name in traces or ():
        if name not in places:
            raise StateError(f"no body or frame {name!r} leaves a trace. {did_you_mean(name, places)}")
    return Shown(motion, pictures, tuple(visuals), tuple(joints), _tips(system) if traces is None else tuple(traces))


def _tips(system) -> tuple[str, ...]:
    """Bodies that carry no others; all if there are none."""
    bodies, carrying = system.structure.bodies, {joint.parent for joint in system.joints}
    return tuple(name for i, name in enumerate(bodies) if i not in carrying) or tuple(bodies)


def resampled(trajectory: Trajectory, count: int) -> Trajectory:
    """Motion at ``count`` equally spaced times, by cubic interpolation; for display only.

    Where two samples share a time, at an impact, the later one counts.
    """
    t, last = _distinct(trajectory.t)
    q, v, work = trajectory.q[last], trajectory.v[last], trajectory.work[last]
    times = np.linspace(t[0], t[-1], count)
    if len(t) == 1:
        kept = np.zeros(count, dtype=int)
        return replace(trajectory, t=times, q=q[kept], v=v[kept], work=work[kept])
    from scipy.interpolate import CubicHermiteSpline  # takes long to import

    system = trajectory.system
    between = CubicHermiteSpline(t, q, _slopes(system, q, v))(times)
    for places in system.quaternions.values():
        between[:, places] /= np.linalg.norm(between[:, places], axis=1, keepdims=True)
    linear = (np.stack([np.interp(times, t, column) for column in part.T], axis=1) for part in (v, work))
    v, work = (part.reshape(count, width) for part, width in zip(linear, (v.shape[1], work.shape[1]), strict=True))
    return replace(trajectory, t=times, q=between, v=v, work=work)


def _slopes(system, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Time derivatives of the coordinates of all samples at once, see :func:`gauss.system.coordinate_rates`."""
    found = []
    for joint in system.joints:
        k, place, rates = joint.pair.quaternion, q[:, joint.q], v[:, joint.v]
        if k is not None:  # ½ Q ∘ (0, ω)
            w, axis, omega = place[:, k : k + 1], place[:, k + 1 :], rates[:, k:]
            turning = w * omega + np.cross(axis, omega)
            rates = np.concatenate([rates[:, :k], -0.5 * (axis * omega).sum(axis=1, keepdims=True), 0.5 * turning], axis=1)
        found.append(rates)
    return np.concatenate(found, axis=1)


def _distinct(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times, each once, and the last sample at each."""
    distinct, first = np.unique(t[::-1], return_index=True)
    return distinct, len(t) - 1 - first
