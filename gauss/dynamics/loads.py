"""Applied loads of one state: forces and moments on bodies, generalised forces, power."""

from functools import singledispatch

import numpy as np

from gauss import math
from gauss.codegen import as_number
from gauss.dynamics.kinematics import Kinematics
from gauss.errors import SceneError
from gauss.rotations import cross
from gauss.scene import GROUND, Drive, ElasticLink, Force, Input, JointSpring, Slipping, Spring
from gauss.scene.values import as_function, evaluated
from gauss.system import System

NO_FORCE = np.zeros(3)
NO_FORCE.flags.writeable = False  # one array for all bodies without loads


class Applied:
    """Sum of applied loads, without gravity.

    ``motion``: kinematics; loads on coordinates need the state only. ``loads``: loads; all of the system when not given.

    Attributes: ``F``, ``M``: main force (3,) [N] and main moment about the centre of mass (3,) [N m] of each body, world
    axes. ``P`` (p,): generalised forces along the joint rates. ``driven``, ``loaded``, ``dissipated``: power of drives, of
    forces on bodies, and dissipated in dampers [W].
    """

    def __init__(self, motion: Kinematics, loads=None):
        system = motion.system
        places = system.structure.n_bodies + 1  # with the ground
        self.F, self.M = [NO_FORCE] * places, [NO_FORCE] * places
        self.P = np.zeros(system.n_v, dtype=motion.state.v.dtype)
        self.driven = self.loaded = self.dissipated = 0.0
        for bound in system.loads if loads is None else loads:
            apply(bound.load, bound.laws, motion, self)

    @property
    def power(self) -> np.ndarray:
        """Power (3,) of drives, of forces on bodies, and dissipated in dampers [W]."""
        return np.array([self.driven, self.loaded, self.dissipated])

    def push(self, motion: Kinematics, body: int, point: np.ndarray, force: np.ndarray):
        """Add a force [N] at a point of a body, both in world axes."""
        self.F[body] = self.F[body] + force
        self.M[body] = self.M[body] + cross(point - motion.x[body], force)

    def on_bodies(self, motion: Kinematics) -> dict:
        """Force [N] and moment about the centre of mass [N m] on loaded bodies, in principal axes, {body: …}."""
        return {i: (motion.R[i].T @ self.F[i], motion.R[i].T @ self.M[i]) for i in self.loaded_bodies}

    @property
    def loaded_bodies(self) -> list[int]:
        """Bodies on which a force or a moment acts."""
        acts = lambda part: part.dtype == object or part.any()  # noqa: E731
        return [i for i in range(len(self.F) - 1) if acts(self.F[i]) or acts(self.M[i])]


@singledispatch
def apply(load, laws, motion: Kinematics, applied: Applied):
    """Add one load; dispatches on its type."""
    raise SceneError(f"no rule to apply a load of type {type(load).__name__}.")


def values_of_laws(system: System, load) -> tuple[str, int]:
    """Name of a drive or a force in messages, and number of values of each of its laws."""
    if isinstance(load, Drive):
        return f"drive {load.name!r}", system.joint(load.joint).pair.n_v
    return f"force {load.name!r}", 3


def _evaluate(law, motion: Kinematics, what: str, size: int):
    return evaluated(law, (motion.state.t, motion), what, size)


@apply.register
def _(load: Drive, laws, motion: Kinematics, applied: Applied):
    joint = motion.system.joint(load.joint)
    effort = _evaluate(laws[0], motion, *values_of_laws(motion.system, load))
    if load.limit is not None:
        effort = math.clip(effort, -load.limit, load.limit)
    if joint.pair.n_v == 1:  # the usual case, without arrays
        column = joint.v.start
        applied.P[column] += effort[0]
        applied.driven += effort[0] * motion.state.v[column]
        return
    applied.P[joint.v] += effort
    applied.driven += effort @ motion.state.v[joint.v]


@apply.register
def _(load: Input, laws, motion: Kinematics, applied: Applied):
    low, high = load.bounds
    value = laws[0](motion.state.t, motion)
    value = value if load.limits is None else math.clip(value, low, high)
    effort = value if load.effort is None else load.effort(value, motion.state.t, motion)
    for joint, factor in load.acts_on.items():
        column, along = motion.system.column(joint), effort if factor == 1.0 else factor * effort
        applied.P[column] += along
        applied.driven += along * motion.state.v[column]
    for force in load.forces:
        of_force = (as_function(force.force), as_function(force.moment))
        applied.driven += _push(force, of_force, motion, applied, effort)


@apply.register
def _(load: Force, laws, motion: Kinematics, applied: Applied):
    applied.loaded += _push(load, laws, motion, applied)


def _push(load: Force, laws, motion: Kinematics, applied: Applied, factor=None):
    """Add a force and a moment, times a factor if there is one; their power [W]."""
    force, moment = (_evaluate(law, motion, *values_of_laws(motion.system, load)) for law in laws)
    if factor is not None:
        force, moment = factor * force, factor * moment
    if load.axes == "body":
        R = motion.rotation(load.body)
        force, moment = R @ force, R @ moment
    body = motion.system.frame(load.body).body
    point = motion.x[body] if load.at is None else motion.position(load.body, load.at)
    applied.push(motion, body, point, force)
    applied.M[body] = applied.M[body] + moment
    velocity = motion.u[body] + cross(motion.W[body], point - motion.x[body])
    return force @ velocity + moment @ motion.W[body]


@apply.register
def _(load: JointSpring, laws, motion: Kinematics, applied: Applied):
    rate = motion.rate(load.joint)
    force = -load.stiffness * (motion.coordinate(load.joint) - load.rest) - load.damping * rate
    applied.P[motion.system.joint(load.joint).v] += force
    applied.dissipated += load.damping * rate**2


@apply.register
def _(load: Slipping, laws, motion: Kinematics, applied: Applied):
    element = load.element
    force = _evaluate(laws[0], motion, element.what, 1)[0]
    for joint, factor in load.joint_factors.items():
        applied.P[motion.system.column(joint)] += factor * force
    power = force * sum(factor * motion.rate(joint) for joint, factor in load.joint_factors.items())
    if element.lossy:
        applied.dissipated -= power
    else:
        applied.driven += power


@apply.register
def _(load: ElasticLink, laws, motion: Kinematics, applied: Applied):
    twist, lead = load.ends(motion)
    for side, acts in load.touching(twist, lead).items():
        force = acts * load.side_force(twist, lead, side)
        for joint, factor in load.acts_on.items():
            applied.P[motion.system.column(joint)] += factor * force
        applied.dissipated += acts * load.damping * lead**2


@apply.register
def _(load: Spring, laws, motion: Kinematics, applied: Applied):
    line, length, rate = stretch(load, motion)
    tension = load.stiffness * (length - load.length) + load.damping * rate
    force = tension * line
    for name, at, sign in ((load.body, load.at, 1.0), (load.other, load.other_at, -1.0)):
        if name != GROUND:
            applied.push(motion, motion.system.frame(name).body, motion.position(name, at), sign * force)
    applied.dissipated += load.damping * rate**2


def stretch(load: Spring, motion: Kinematics):
    """Unit vector from the end on ``body`` to the other end, length [m] and its rate [m/s]."""
    gap = motion.position(load.other, load.other_at) - motion.position(load.body, load.at)
    length = np.sqrt(gap @ gap)
    if as_number(length) == 0:
        raise SceneError(f"spring {load.name!r}: its ends meet at t = {motion.state.t:.6g} s; its direction is undefined.")
    line = gap / length
    rate = line @ (motion.velocity(load.other, load.other_at) - motion.velocity(load.body, load.at))
    return line, length, rate
