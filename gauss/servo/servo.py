"""Servo: a system, servo-constraints, and the actuators that hold them."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gauss.arguments import table
from gauss.dynamics import compile_scene
from gauss.dynamics.laws.traced_laws import present_laws
from gauss.dynamics.store import Store
from gauss.errors import ArgumentError, SceneError, did_you_mean, require
from gauss.scene import Scene, values
from gauss.servo.actuators import Cable, efforts, unit_of_effort
from gauss.servo.observed import MotionSymbols, tree_symbols
from gauss.servo.relation import ScalarRelation, ServoRelation, as_relations, scalars
from gauss.system import State, System

MOST_STORES = 8  # states of the laws for which what was made is kept


@dataclass(frozen=True)
class Servo:
    """System with servo-constraints (Béghin, Appell): relations kept by forces that are not ideal.

    Parameters
    ----------
    system : System or Scene
        The system; a scene is compiled.
    relations : sequence of ServoRelation or gauss.scene.Relation
        Servo-constraints, or constraints of :mod:`gauss.scene` (a guided point, a distance, an angle, …) that servos hold in
        place of contacts. Contacts keep relations marked ideal.
    actuators : sequence of Motor, Thruster, Cable or AuxiliarySupport
        Forces of the servos.
    weights : dict, optional
        Weight of each effort, by its name, where there are more efforts than relations: the sum of
        weight · (effort − preload)² is minimised. 1 when not given.
    preload : dict, optional
        Effort from which that sum is measured, by name [N, N m]; 0 when not given.

    Raises
    ------
    SceneError
        If a name is unknown or taken, or a relation cannot be traced.

    Examples
    --------
    >>> import gauss
    >>> from gauss.servo import Motor, Servo, ServoRelation
    >>> hold = ServoRelation("lean", lambda t, motion: motion.coordinate("pin") - 0.1)
    >>> Servo(gauss.load("cart_pole"), [hold], [Motor("motor", "rail")]).efforts
    ('motor',)
    """

    system: System
    relations: tuple[ServoRelation, ...]
    actuators: tuple
    weights: dict[str, float] = field(default_factory=dict)
    preload: dict[str, float] = field(default_factory=dict)

    if TYPE_CHECKING:  # what may be given; fields are what is made of it

        def __init__(
            self,
            system: System | Scene,
            relations: Sequence[Any],
            actuators: Sequence[Any],
            weights: Mapping[str, float] = ...,
            preload: Mapping[str, float] = ...,
        ): ...

    def __post_init__(self):
        """Compile a scene, check every name, and trace the relations."""
        if isinstance(self.system, Scene):
            object.__setattr__(self, "system", compile_scene(self.system))
        require(self.system, (System, Scene), "Servo")
        for key in ("relations", "actuators"):
            if not np.iterable(getattr(self, key)):
                raise ArgumentError(f"Servo: {key}: expected a sequence, got {getattr(self, key)!r:.80}.")
        object.__setattr__(self, "actuators", tuple(self.actuators))
        found = tuple(relation for given in self.relations for relation in as_relations(given, self.symbols.motion))
        object.__setattr__(self, "relations", found)
        if not self.relations:
            raise SceneError("a servo needs at least one relation to hold.")
        if len(set(self.efforts)) < len(self.efforts):
            raise SceneError(f"actuators need different names, got {', '.join(self.efforts)}.")
        names = [relation.name for relation in self.relations]
        if len(set(names)) < len(names):
            raise SceneError(f"relations need different names, got {', '.join(names)}.")
        object.__setattr__(self, "weights", self._of_efforts("weights", "1", positive=True))
        object.__setattr__(self, "preload", self._of_efforts("preload", "N or N m", positive=False))
        _ = self.scalars

    def _of_efforts(self, key: str, unit: str, positive: bool) -> dict[str, float]:
        """Checked numbers by the names of efforts."""
        given = table(getattr(self, key), f"Servo: {key}", "numbers by the names of efforts").items()
        found = {name: values.number(value, f"{key} of {name!r}", unit, positive=positive) for name, value in given}
        for name in found:
            if name not in self.efforts:
                raise SceneError(f"{key}: no effort {name!r}. {did_you_mean(name, self.efforts)}")
        return found

    @cached_property
    def efforts(self) -> tuple[str, ...]:
        """Names of the j efforts."""
        return tuple(name for actuator in self.actuators for name in efforts(actuator, self.system))

    @cached_property
    def each_effort(self) -> tuple:
        """Pairs (actuator, number of the effort in it), one for each of the j efforts."""
        return tuple((a, k) for a in self.actuators for k in range(len(efforts(a, self.system))))

    @property
    def effort_units(self) -> tuple[str, ...]:
        """Unit of each effort: "N", "N m", or "1" of a thruster, whose effort multiplies a force and a moment."""
        return tuple(unit_of_effort(actuator, number, self.system) for actuator, number in self.each_effort)

    @cached_property
    def _made(self) -> Store:
        return Store()

    @cached_property
    def _stores(self) -> dict[Hashable, Store]:
        return {}

    def follow_laws(self):
        """Use what was made for the laws of the loads as they are now, which may have changed since it was made."""
        key = present_laws(self.system).key
        if key not in self._stores and len(self._stores) >= MOST_STORES:
            del self._stores[next(iter(self._stores))]
        vars(self)["_made"] = self._stores.setdefault(key, Store())

    def made(self, key: tuple, make: Callable):
        """Result of ``make``, kept under a key: machine code, index reduction."""
        return self._made.on_demand(key, make)

    @cached_property
    def symbols(self) -> MotionSymbols:
        """Symbols of the motion in tree coordinates."""
        return tree_symbols(self.system)

    @cached_property
    def scalars(self) -> tuple[ScalarRelation, ...]:
        """Entries of all relations: those of contacts first, then those of servos."""
        ordered = [*(x for x in self.relations if x.ideal), *(x for x in self.relations if not x.ideal)]
        return tuple(scalars(ordered, self.symbols))

    @cached_property
    def n_contacts(self) -> int:
        """Number of scalar relations that contacts keep; they are the first."""
        return sum(scalar.ideal for scalar in self.scalars)

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the r scalar relations that the servos hold."""
        return tuple(scalar.name for scalar in self.scalars[self.n_contacts :])

    @cached_property
    def weight(self) -> np.ndarray:
        """Weights (j,) of the efforts."""
        return np.array([self.weights.get(name, 1.0) for name in self.efforts])

    @cached_property
    def reference(self) -> np.ndarray:
        """Preloads (j,) of the efforts [N, N m]."""
        return np.array([self.preload.get(name, 0.0) for name in self.efforts])

    @cached_property
    def least(self) -> np.ndarray:
        """Least values (j,) of the efforts: slack tensions of cables, −∞ for the others."""
        return np.array([a.slack if isinstance(a, Cable) else -np.inf for a, _ in self.each_effort])


def state_of(servo: Servo, state: State | None, function: str) -> State:
    """State, that of the start of the scene when not given; ArgumentError if the servo or the state is none."""
    require(servo, (Servo,), function)
    if state is None:
        return servo.system.initial_state()
    require(state, (State,), f"{function}: state")
    return state
