"""Inputs of a system: as parameters of traced functions, as generalised forces, and as drives with laws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gauss.codegen import Graph
from gauss.scene import Drive, Input, Scene
from gauss.system import BoundLoad, System


def input_loads(system: System) -> tuple[BoundLoad, ...]:
    """Inputs of a system as loads whose laws are parameters of traced functions, of the names of the inputs."""
    graph = Graph(shared=True)
    symbols = {name: graph.symbol(name) for name in system.scene.inputs}
    return tuple(BoundLoad(given, (lambda *_, u=symbols[name]: u,)) for name, given in system.scene.inputs.items())


class InputForces:
    """Inputs of a system as generalised forces Q = S clip(u).

    Parameters
    ----------
    system : System
        The system.

    Attributes
    ----------
    columns : ndarray of int, shape (n_u,)
        Rate along which each input acts.
    low, high : ndarray, shape (n_u,)
        Least and largest effort [N m, N].
    """

    def __init__(self, system: System):
        inputs = system.scene.inputs.values()
        self.system, self.columns = system, np.array([system.column(given.joint) for given in inputs], dtype=int)
        self.low, self.high = np.array([given.bounds for given in inputs]).reshape(-1, 2).T

    def efforts(self, u: np.ndarray) -> np.ndarray:
        """Efforts (n_u,) of input values (n_u,), cut off at the limits [N m, N]."""
        return np.clip(u, self.low, self.high)

    def forces(self, u: np.ndarray) -> np.ndarray:
        """Generalised forces (n_v,) of input values (n_u,) [N m, N]."""
        found = np.zeros(self.system.n_v)
        np.add.at(found, self.columns, self.efforts(u))
        return found


@dataclass(frozen=True)
class HeldLaw:
    """Law of a drive that stands for an input.

    Parameters
    ----------
    law : callable
        Time [s] → value of the input [N m, N].
    low, high : float
        Least and largest effort [N m, N].
    along : tuple of float
        Share of the effort along each rate of the joint.
    """

    law: Callable[[float], float]
    low: float
    high: float
    along: tuple[float, ...] = (1.0,)

    def __call__(self, t) -> np.ndarray:
        """Efforts along the rates of the joint at a time [s]."""
        return np.clip(self.law(t), self.low, self.high) * np.array(self.along)


def driven_scene(scene: Scene, laws: Mapping[str, Callable]) -> Scene:
    """Scene with drives for its inputs.

    Parameters
    ----------
    scene : Scene
        Scene with inputs.
    laws : mapping of str to callable
        Input → law t ↦ value [N m, N], cut off at the limits of the input.
    """
    drives = {}
    for name, given in scene.inputs.items():
        joint, along = _rate_of(scene, given)
        drives[name] = Drive(name, joint, HeldLaw(laws[name], *given.bounds, along))
    return replace(scene, loads={**scene.loads, **drives}, inputs={})


def _rate_of(scene: Scene, given: Input) -> tuple[str, tuple[float, ...]]:
    """Joint of an input, and 1 for its rate among those of the joint, else 0."""
    if given.joint in scene.joints:
        return given.joint, (1.0,)
    owner, _, rate = given.joint.rpartition(".")
    return owner, tuple(float(one == rate) for one in scene.joints[owner].pair.rates)
