"""Inputs of a system: as parameters of traced functions, as generalised forces, and as loads with laws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gauss.codegen import Graph
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.load_forces import generalised_forces
from gauss.dynamics.loads import Applied
from gauss.scene import Drive, Force, Input, Scene
from gauss.scene.values import as_function
from gauss.system import BoundLoad, State, System


def input_loads(system: System) -> tuple[BoundLoad, ...]:
    """Inputs of a system as loads whose laws are parameters of traced functions, of the names of the inputs."""
    graph = Graph(shared=True)
    symbols = {name: graph.symbol(name) for name in system.scene.inputs}
    return tuple(BoundLoad(given, (lambda *_, u=symbols[name]: u,)) for name, given in system.scene.inputs.items())


class InputForces:
    """Inputs of a system as generalised forces, Q = S clip(u) where each acts along one rate.

    Attributes: ``columns`` (n_u,): rate along which each input acts, where all are torques or forces of one joint. ``low``,
    ``high`` (n_u,): least and largest effort [N m, N].
    """

    def __init__(self, system: System):
        inputs = system.scene.inputs.values()
        self.system, self.is_plain = system, all(given.is_plain for given in inputs)
        columns = [system.column(given.joint) for given in inputs if isinstance(given.joint, str)] if self.is_plain else []
        self.columns = np.array(columns, dtype=int)
        self.low, self.high = np.array([given.bounds for given in inputs]).reshape(-1, 2).T

    def efforts(self, u: np.ndarray) -> np.ndarray:
        """Efforts (n_u,) of input values (n_u,), cut off at the limits [N m, N]."""
        return np.clip(u, self.low, self.high)

    def inside(self, u: np.ndarray) -> np.ndarray:
        """Input values (n_u,) with those at a limit one unit in the last place within: derivatives there are one-sided."""
        return np.where(u == self.low, np.nextafter(u, np.inf), np.where(u == self.high, np.nextafter(u, -np.inf), u))

    def forces(self, u: np.ndarray, state: State) -> np.ndarray:
        """Generalised forces (n_v,) of input values (n_u,) in a state [N m, N]."""
        if not self.is_plain:
            given = self.system.scene.inputs.values()
            loads = [BoundLoad(one, (lambda *_, u=value: u,)) for one, value in zip(given, u, strict=True)]
            motion = kinematics(self.system, state)
            return generalised_forces(motion, Applied(motion, loads))
        found = np.zeros(self.system.n_v)
        np.add.at(found, self.columns, self.efforts(u))
        return found


@dataclass(frozen=True)
class HeldLaw:
    """Law of a drive that stands for an input."""

    law: Callable[[float], float]  # time [s] → value of the input [N m, N]
    low: float  # low, high: least and largest effort [N m, N]
    high: float
    along: tuple[float, ...] = (1.0,)  # share of the effort along each rate of the joint

    def __call__(self, t) -> np.ndarray:
        """Efforts along the rates of the joint at a time [s]."""
        return np.clip(self.law(t), self.low, self.high) * np.array(self.along)


def driven_scene(scene: Scene, laws: Mapping[str, Callable]) -> Scene:
    """Scene with drives, and forces on bodies, for its inputs.

    ``laws``: input → law t ↦ value [N m, N], cut off at the limits of the input.
    """
    loads: dict[str, Drive | Force] = {}
    for name, given in scene.inputs.items():
        for number, (on, factor) in enumerate(given.acts_on.items()):
            joint, along = _rate_of(scene, on, factor)
            called = name if not number else f"{name} on {on}"
            loads[called] = Drive(called, joint, _law_of(given, laws[name], along))
        for number, force in enumerate(given.forces):
            called = name if not given.acts_on and not number else f"{name} on {force.body}, {number + 1}"
            push, turn = (_PartOfForce(given, laws[name], part) for part in (force.force, force.moment))
            loads[called] = replace(force, name=called, force=push, moment=turn)
    return replace(scene, loads={**scene.loads, **loads}, inputs={})


def _law_of(given: Input, law: Callable, along: tuple[float, ...]) -> Callable:
    """Law of the efforts along the rates of a joint."""
    if given.effort is None:
        return HeldLaw(law, *given.bounds, along)
    return lambda t, motion: np.array(along) * _effort(given, law, t, motion)


def _effort(given: Input, law: Callable, t, motion):
    value = np.clip(law(t), *given.bounds)
    return value if given.effort is None else given.effort(value, t, motion)


class _PartOfForce:
    """Law of the force or moment of an input on a body."""

    def __init__(self, given: Input, law: Callable, part):
        self.given, self.law, self.part = given, law, as_function(part)

    def __call__(self, t, motion) -> np.ndarray:
        return _effort(self.given, self.law, t, motion) * np.asarray(self.part(t, motion))


def _rate_of(scene: Scene, joint: str, factor: float) -> tuple[str, tuple[float, ...]]:
    """Joint of a rate, and the factor for this rate among those of the joint, else 0."""
    if joint in scene.joints:
        return joint, (factor,)
    owner, _, rate = joint.rpartition(".")
    return owner, tuple(factor * float(one == rate) for one in scene.joints[owner].pair.rates)
