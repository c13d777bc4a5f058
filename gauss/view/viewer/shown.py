"""What is shown: a motion as it was computed, its pictures, and what is drawn with it."""

from dataclasses import dataclass

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import StateError, did_you_mean, require
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.simulation.trajectory import Stats
from gauss.view.viewer.frames import resampled

FRAMES = 30  # per second
MOST = 1800  # pictures of a file; a longer motion has fewer per second
NOT_SIMULATED = Stats(0, 0, 0, 0, 0.0, 0.0, "not simulated")


@dataclass(frozen=True)
class Shown:
    """What is shown.

    Parameters
    ----------
    motion, pictures : Trajectory
        The motion, and the same at equally spaced times; of one sample for a scene that does not move.
    visuals : tuple
        Given meshes.
    joints : tuple of str
        Joints whose reactions are drawn as arrows.
    traces : tuple of str
        Bodies, whose centres of mass leave a trace, and frames, whose origins do.
    """

    motion: Trajectory
    pictures: Trajectory
    visuals: tuple = ()
    joints: tuple[str, ...] = ()
    traces: tuple[str, ...] = ()


def shown(thing: Scene | Trajectory, frames: int, visuals=(), joints=(), traces=None) -> Shown:
    """What is shown of a scene in its start, or of a motion; traces of the bodies that carry no others if none are named.

    Raises
    ------
    StateError
        If a trace is named after nothing.
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
        motion, pictures = thing, resampled(thing, max(1, min(MOST, 1 + round(span * frames))))
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
