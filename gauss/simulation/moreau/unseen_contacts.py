"""Steps within which no shape passes through another one unseen: gaps are looked at once a step."""

import warnings
from collections.abc import Callable, Iterable

import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.store import cached
from gauss.errors import ContactLawWarning, user_level
from gauss.scene import Contact, HalfSpace, Scene
from gauss.scene.collision import Collider
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System

SHARE = 0.25  # of the thickness of two shapes together that they may move in a step
EXAMINED = 4  # samples of a motion with the largest rates that are examined, and as many others
MOTIONS = 16  # of a batch, those with the largest rates, that are examined
GROWTH = 2.0  # of the sum of squares of the rates between two looks at a motion that is stepped
STEPS_BETWEEN = 1000  # of two looks otherwise: a look takes as long as some ten steps
SLOW = 0.25  # share of the thickness of two shapes that each moves in a step at speeds that need no look: half of the limit
FIRST, NEVER = (-np.inf, 0.0), (np.inf, np.inf)  # when looks are due: before a motion, and after a warning


class StepLimit:
    """Largest steps of a system with contacts of shapes; none with half-spaces, which nothing passes through.

    Parameters
    ----------
    system : System
        The system.
    """

    def __init__(self, system: System):
        self.system, pairs = system, _pairs(system.scene)
        shapes = list({shape.name: shape for pair in pairs for shape in pair}.values())
        places = {shape.name: k for k, shape in enumerate(shapes)}
        self.pairs = np.array([[places[shape.name] for shape in pair] for pair in pairs], dtype=int).reshape(-1, 2)
        self.names = [shape.name for shape in shapes]
        self.thickness = np.array([thickness(shape) for shape in shapes])[self.pairs].sum(axis=1)  # of both shapes together
        self.bodies, self.middles, self.reach = _places(system, shapes)

    def step(self, state: State) -> float:
        """Largest step at the rates of a state [s]."""
        if not self.thickness.size:
            return np.inf
        centre, velocity, turning = self._motions(state)
        (one, other), speed = self.pairs.T, np.linalg.norm(velocity, axis=1) + turning
        apart = np.linalg.norm(centre[one] - centre[other], axis=1) - self.reach[one] - self.reach[other]
        with np.errstate(divide="ignore"):
            return float((np.maximum(SHARE * self.thickness, 0.5 * apart) / (speed[one] + speed[other])).min())

    def passing(self, state: State, h: float) -> tuple[str, str] | None:
        """Names of two shapes that move by more than they are thick within a step of length h; None if no shapes do."""
        if not state.v.any():
            return None
        _, velocity, turning = self._motions(state)
        one, other = self.pairs.T
        speed = np.linalg.norm(velocity[one] - velocity[other], axis=1) + turning[one] + turning[other]
        worst = int(np.argmax(speed / self.thickness))
        return (self.names[one[worst]], self.names[other[worst]]) if h * speed[worst] > self.thickness[worst] else None

    def _motions(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Middles of the shapes (k, 3) [m], their velocities (k, 3) and the largest speeds about them (k,) [m/s]."""
        motion = kinematics(self.system, state)
        x, u, W = (np.array([part[b] for b in self.bodies]) for part in (motion.x, motion.u, motion.W))
        out = np.array([motion.R[b] @ middle for b, middle in zip(self.bodies, self.middles, strict=True)])
        return x + out, u + np.cross(W, out), np.linalg.norm(W, axis=1) * self.reach


def step_limit(system: System) -> StepLimit:
    """Limit of a system, made once."""
    return cached(system, (StepLimit,), lambda: StepLimit(system))


def _places(system: System, shapes: list[Collider]) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Body of each shape, its middle in the axes of the body (3,) [m], and the radius of a ball around it (k,) [m]."""
    frames, middles = [system.frames[shape.body] for shape in shapes], [shape.corners.mean(axis=0) for shape in shapes]
    reach = [s.radius + _farthest(s.corners - middle) for s, middle in zip(shapes, middles, strict=True)]
    places = [frame.p + frame.R @ middle for frame, middle in zip(frames, middles, strict=True)]
    return np.array([frame.body for frame in frames], dtype=int), places, np.array(reach)


def warn_of_unseen_contacts(trajectory: Trajectory):
    """Warn of shapes that fixed steps may carry through one another unseen: no error estimate shows it.

    The samples with the largest rates are examined, and some more.

    Warns
    -----
    ContactLawWarning
        With the names of two shapes, and a time.
    """
    system, step = trajectory.system, trajectory.step
    if step is None or not trajectory.v.size or not step_limit(system).thickness.size:
        return
    fastest = np.argsort(-_largest_rates(system, trajectory.v))[:EXAMINED]
    spread = np.linspace(0, len(trajectory.t) - 1, EXAMINED).astype(int)
    for k in sorted({*fastest.tolist(), *spread.tolist()}):
        if warn_of_passing(system, trajectory.state(k), step):
            return


def warn_of_unseen_contacts_of_many(system: System, t: np.ndarray, samples: np.ndarray, step: float):
    """Warn as :func:`warn_of_unseen_contacts` of motions (batch, k, n_q + n_v) at times (k,) [s], by their numbers."""
    q, v = np.split(samples, [system.n_q], axis=2)
    if not v.size or not step_limit(system).thickness.size:
        return
    with np.errstate(invalid="ignore"):
        rates = np.nan_to_num(_largest_rates(system, v), nan=0.0, posinf=0.0)
    rows = rates.argmax(axis=1)
    for k in np.argsort(-rates.max(axis=1))[:MOTIONS].tolist():
        row = int(rows[k])
        if warn_of_passing(system, State(float(t[row]), q[k, row], v[k, row]), step, f"motion {k}, "):
            return


def warn_of_passing(system: System, state: State, step: float, which: str = "") -> bool:
    """Warn of two shapes that may pass through each other within a step [s] from a state; return whether there are any."""
    names = step_limit(system).passing(state, step)
    if names:
        text = f"in a step of {step:g} s {names[0]!r} and {names[1]!r} move by more than they are thick"
        warnings.warn(
            f"{system.scene.name!r}: {which}t = {state.t:.6g} s: {text}, and may pass through each other "
            "unseen; shorten the step, or simulate without it, for error control by rtol=.",
            ContactLawWarning,
            stacklevel=user_level(),
        )
    return names is not None


class PassingWatch:
    """Looks at the shapes of motions that are stepped: where their rates have grown, and every thousand steps.

    Parameters
    ----------
    system : System
        The system.
    step : float
        Step [s].

    Attributes
    ----------
    has_pairs : bool
        Whether the system has shapes that could pass through each other.
    due : tuple of float
        Square of the rates, and number of steps, at which the next look is due.
    """

    def __init__(self, system: System, step: float):
        limit = step_limit(system)
        self.system, self.step, self.has_pairs = system, step, bool(system.n_v and limit.thickness.size)
        self.slow = SLOW * limit.thickness.min(initial=np.inf) / step
        self.begin()

    def begin(self):
        """Begin a motion, whose first rates are looked at."""
        self.due: tuple[float, float] = FIRST

    def is_slow(self, fastest: float) -> bool:
        """Whether no two shapes can pass through each other at the largest speed of a point of a shape [m/s]."""
        return fastest <= self.slow

    def examine(self, square: float, steps: int, states: Callable[[], Iterable[tuple[str, State]]]):
        """Look at states of motions where that is due, and warn once.

        Parameters
        ----------
        square : float
            Largest sum of squares of the rates.
        steps : int
            Steps so far.
        states : callable
            () → states of the motions, each after words that say which it is.
        """
        grown, due = self.due
        if square <= grown and steps < due:
            return
        for which, state in states():
            if warn_of_passing(self.system, state, self.step, which):
                self.due = NEVER
                return
            grown = max(grown, GROWTH * float(state.v @ state.v))
            self.due = grown, steps + STEPS_BETWEEN


def _largest_rates(system: System, v: np.ndarray) -> np.ndarray:
    """Largest rate (...) of rates (..., n_v), relative to the scale of the scene."""
    return np.abs(v / system.scale.rates).max(axis=-1)


def _pairs(scene: Scene) -> list[tuple[Collider, Collider]]:
    """Shapes of contacts without half-spaces."""
    contacts = [contact for contact in scene.contacts.values() if isinstance(contact, Contact)]
    pairs = [(scene.shapes[contact.shape], scene.shapes[contact.other]) for contact in contacts]
    return [pair for pair in pairs if not isinstance(pair[0], HalfSpace) and not isinstance(pair[1], HalfSpace)]


def thickness(shape: Collider) -> float:
    """Least extent of a shape [m]."""
    corners = shape.corners - shape.corners.mean(axis=0)
    extents = np.ptp(corners @ np.linalg.svd(corners, full_matrices=len(corners) < 3)[2].T, axis=0)
    return 2.0 * shape.radius + float(extents.min())


def _farthest(points: np.ndarray) -> float:
    return float(np.linalg.norm(points, axis=1).max())
