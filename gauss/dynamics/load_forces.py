"""Loads of a system as generalised forces: Q = P + Σ Jᵀ (F, M), without the equations of motion.

Forces and moments on bodies are carried inward along the spanning tree
(:func:`gauss.dynamics.inverse_dynamics_residual.along_rates`). Traced loads become machine code. Opaque laws are called by
Python. What follows from the values of drives and of forces on bodies is machine code, too; the poses of bodies are so
where a law asks for them.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np

from gauss.codegen import Function, Kernel, write
from gauss.codegen.kernels import address
from gauss.dynamics.inverse_dynamics_residual import along_rates
from gauss.dynamics.kinematics import ORIGIN, WORLD_AXES, Kinematics, KinematicsOnAccess, kinematics
from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.loads import Applied, values_of_laws
from gauss.dynamics.store import cached_on_disk
from gauss.scene import GROUND, Drive, Force
from gauss.scene.values import ConstantLaw, law_of_time_alone, put
from gauss.system import BoundLoad, State, System

ENDS = "body", "other"  # fields of loads on bodies that name these
ASKED = Drive, Force  # kinds of loads that are known by the values of their laws


def generalised_forces(motion: Kinematics, applied: Applied) -> np.ndarray:
    """Applied loads along the rates (n_v,), with those on bodies carried inward along the spanning tree.

    ``motion``: kinematics, with its joints if there are loads on bodies; floats or expressions.
    """
    wrenches = {body: (applied.M[body], applied.F[body]) for body in applied.loaded_bodies}
    return applied.P + along_rates(motion, wrenches) if wrenches else applied.P


def traced_forces(system: System, loads: Sequence[BoundLoad]) -> Function:
    """Function (t, q, v) → (generalised forces, power) of loads."""

    def forces(t, q, v):
        motion = Kinematics(system, State(t[0], q, v))
        applied = Applied(motion, loads)
        return generalised_forces(motion, applied), applied.power

    return write(forces, 1, system.n_q, system.n_v, name="forces")


class LoadForces:
    """Generalised forces and power of loads, (t, q, v) → (Q (n_v,), power (3,) of drives, forces, dampers).

    ``called``: loads that Python evaluates. ``laws``: those whose traced loads are evaluated, too, by machine code; when not
    given, none are.
    """

    def __init__(self, system: System, called: Sequence[BoundLoad] = (), laws: Laws | None = None):
        self.system, self.called = system, list(called)
        self._traced = None if laws is None or not laws.traced else self._compiled(laws)
        self._asked = [bound for bound in self.called if isinstance(bound.load, ASKED)]
        self._applied = [bound for bound in self.called if not isinstance(bound.load, ASKED)]
        self._values, self._loaded = _values(system, self._asked), _loaded(system, self._applied)
        alone = not self._applied and self._traced is None
        self._timed = _of_time(self._values) if alone else []
        self.is_of_time = bool(self._timed)
        self._rooms: list[tuple[np.ndarray, int]] = []  # that no call uses now
        self._posed = bool(self._loaded) or any(needs_poses(bound.load) for bound in self.called)
        self.n_q, self.n_in = 1 + system.n_q, 1 + system.n_q + system.n_v
        self._size = self.n_in + sum(size for *_, size in self._values)

    def _compiled(self, laws: Laws) -> Kernel:
        """Machine code of the traced loads: (t, q, v) → (generalised forces, power)."""
        make = lambda: Kernel(traced_forces(self.system, laws.traced), batch=False)  # noqa: E731
        return cached_on_disk(self.system, (LoadForces, laws.key), make)

    def __call__(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Generalised forces, and power [W]."""
        n_v = self.system.n_v
        found = np.empty(n_v + 3)
        if self.is_of_time:
            self.write_of_time(state, address(found))
        else:
            numbers = self.room()
            self._fill(numbers, state)
            self.write(state, numbers, address(numbers), address(found))
        return found[:n_v], found[n_v:]

    def _fill(self, numbers: np.ndarray, state: State):
        """Write a state to a room."""
        numbers[0], numbers[1 : self.n_q], numbers[self.n_q : self.n_in] = state.t, state.q, state.v

    def room(self) -> np.ndarray:
        """Array for the numbers of a state, which are followed by the values of laws."""
        return np.empty(self._size)

    def write(self, state: State, numbers: np.ndarray, place: int, found: int):
        """Write generalised forces and power (n_v + 3,) of a state to an address.

        ``numbers``: a :meth:`room` with its time, coordinates and rates, that nobody else writes to. ``place``, ``found``:
        addresses of ``numbers``, and of the results.
        """
        motion = None
        if self.called:
            motion = self._placed(state, numbers, place) if self._posed else Kinematics(self.system, state)
            given, end = (state.t, motion), self.n_in
            for law, what, size in self._values:
                put(law, given, what, size, numbers, end)
                end += size
        if self._asked and not self._applied and self._traced is None:  # the usual case, quickly
            self._of_values.at(place, found)
            return
        parts = [_at(self._of_values, place)] if self._asked else []
        if self._applied and motion is not None:
            parts.append(self._of_others(motion, numbers[: self.n_in]))
        if self._traced is not None:
            parts.append(_at(self._traced, place))
        total = parts[0] if len(parts) == 1 else sum(parts, np.zeros(self.system.n_v + 3))
        ctypes.memmove(found, address(total), total.nbytes)

    def write_of_time(self, given: int | State, found: int):
        """The same of laws of the time alone, for a state or one at an address: they need no objects of it."""
        try:
            numbers, place = self._rooms.pop()
        except IndexError:  # not asked for before: another thread may take the last one in between
            numbers = self.room()
            place = address(numbers)
        if type(given) is int:
            ctypes.memmove(place, given, 8 * self.n_in)
        else:
            self._fill(numbers, given)  # type: ignore[arg-type]  # it is a state
        t, end = (numbers.item(0),), self.n_in
        for law, what, size in self._timed:
            put(law, t, what, size, numbers, end)
            end += size
        self._of_values.at(place, found)
        self._rooms.append((numbers, place))

    def _of_others(self, motion: Kinematics, inputs: np.ndarray) -> np.ndarray:
        """The same of loads that are neither drives nor forces."""
        applied = Applied(motion, self._applied)
        Q = applied.P
        if self._loaded:
            given = np.concatenate([inputs, *(part[body] for body in self._loaded for part in (applied.F, applied.M))])
            Q = Q + _at(self._transposed, address(given))
        return np.concatenate([Q, applied.power])

    def _placed(self, state: State, numbers: np.ndarray, place: int) -> Kinematics:
        """Kinematics with poses by machine code, at the first access: many laws need coordinates and rates only."""
        return KinematicsOnAccess(self.system, state, partial(_at, self._poses, place, numbers))

    @cached_property
    def _poses(self) -> Kernel:
        system = self.system

        def poses(t, q, v):
            motion, places = kinematics(system, State(t[0], q, v)), range(system.structure.n_bodies)
            parts = (motion.R, WORLD_AXES), (motion.x, ORIGIN), (motion.W, ORIGIN), (motion.u, ORIGIN)
            return tuple(np.concatenate([*(np.ravel(part[body]) for body in places), end.ravel()]) for part, end in parts)

        make = lambda: Kernel(write(poses, 1, system.n_q, system.n_v, name="poses"), batch=False)  # noqa: E731
        return cached_on_disk(system, (LoadForces, "poses"), make)

    @cached_property
    def _of_values(self) -> Kernel:
        """Machine code of drives and forces by the values of their laws: generalised forces, and power."""
        system, ends = self.system, np.cumsum([size for *_, size in self._values])

        def of_values(t, q, v, values):
            motion, parts = Kinematics(system, State(t[0], q, v)), iter(np.split(values, ends[:-1]))
            laws = [[ConstantLaw(next(parts)) if _varies(law) else law for law in one.laws] for one in self._asked]
            bound = [BoundLoad(one.load, tuple(own)) for one, own in zip(self._asked, laws, strict=True)]
            applied = Applied(motion, bound)
            return generalised_forces(motion, applied), applied.power

        sizes = 1, system.n_q, system.n_v, int(ends[-1])
        names = tuple((one.load.name, tuple(map(_varies, one.laws))) for one in self._asked)
        make = lambda: Kernel(write(of_values, *sizes, name="loads"), batch=False)  # noqa: E731
        return cached_on_disk(system, (LoadForces, "values", names), make)

    @cached_property
    def _transposed(self) -> Kernel:
        system, loaded = self.system, self._loaded

        def transposed(t, q, v, wrenches):
            motion = kinematics(system, State(t[0], q, v))
            applied = Applied(motion, ())
            for body, (F, M) in zip(loaded, wrenches.reshape(-1, 2, 3), strict=True):
                applied.F[body], applied.M[body] = F, M
            return (generalised_forces(motion, applied),)

        sizes = 1, system.n_q, system.n_v, 6 * len(loaded)
        make = lambda: Kernel(write(transposed, *sizes, name="transposed"), batch=False)  # noqa: E731
        return cached_on_disk(system, (LoadForces, "transposed", tuple(loaded)), make)


def _varies(law: Callable) -> bool:
    return not isinstance(law, ConstantLaw)


def _values(system: System, asked: Sequence[BoundLoad]) -> list[tuple[Callable, str, int]]:
    """Laws of loads, with their names in messages and numbers of values."""
    return [(law, *values_of_laws(system, one.load)) for one in asked for law in one.laws if _varies(law)]


def _of_time(values: list[tuple[Callable, str, int]]) -> list[tuple[Callable, str, int]]:
    """The same laws as functions of the time; none if one takes the motion."""
    found = [(law_of_time_alone(law), what, size) for law, what, size in values]
    return [(law, what, size) for law, what, size in found if law is not None] if all(law for law, *_ in found) else []


def _loaded(system: System, applied: Sequence[BoundLoad]) -> list[int]:
    """Bodies that loads may act on."""
    return sorted({body for one in applied if not one.on_coordinates for body in _bodies(system, one)})


def _at(kernel: Kernel, place: int, _owner: np.ndarray | None = None) -> np.ndarray:
    """Outputs of a kernel for the inputs at an address, without the checks of its arguments; their owner is kept for it."""
    found = np.empty(kernel.n_out)
    kernel.at(place, address(found))
    return found


def _bodies(system: System, bound: BoundLoad) -> list[int]:
    """Bodies that a load may act on."""
    names = [getattr(bound.load, field) for field in ENDS if hasattr(bound.load, field)]
    if not names:
        return list(range(system.structure.n_bodies))
    return [system.frame(name).body for name in names if name != GROUND]
