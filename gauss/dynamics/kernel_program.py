"""Functions of a large system for compiled loops: forces and power of the loads, energies; dynamics and check of a tree.

Straight-line code of a system grows with the number of its links; kernels hold the code of each kind of link once. Traced
loads are straight-line code.
"""

from functools import cache, cached_property

import numpy as np

from gauss.codegen import Function, PythonCallback, write
from gauss.codegen.kernels import ENERGY_SAMPLE, Correction, RowCode, RowFunction
from gauss.dynamics.energies import energy_sample, least_magnitude, stored_energies
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.load_forces import generalised_forces, traced_forces
from gauss.dynamics.loads import Applied
from gauss.dynamics.programs import called_loads
from gauss.dynamics.traced_system import Program, off_unit
from gauss.dynamics.tree_recursion import energy_recursion, forward_tree_recursion, inverse_tree_recursion
from gauss.system import State, System


class KernelProgram(Program):
    """Functions of a large system whose dynamics are kernels of its links."""

    checks_bodies = False  # the check is by inverse dynamics in link frames

    @cached_property
    def rates(self) -> RowFunction:
        """Function (t, q, v) → (q̈, power of the loads)."""
        return RowFunction("rates", 1 + self.system.n_q + self.system.n_v, self.system.n_v + 3, self._emit_rates)

    @cached_property
    def point_check(self) -> RowFunction:
        """Function of a point → (error of its accelerations, 0, energy sample)."""
        return RowFunction("check", self.layout.size, 2 + ENERGY_SAMPLE, self._emit_check)

    def _emit_rates(self, code: RowCode):
        raise NotImplementedError

    def _emit_check(self, code: RowCode):
        raise NotImplementedError

    @cached_property
    def _ground(self) -> np.ndarray:
        return ground_acceleration(self.system)

    @cached_property
    def _load_forces(self) -> Function | None:
        """Function (t, q, v) → (generalised forces, power) of the loads; None without loads."""
        return traced_forces(self.system, self.loads) if self.loads else None

    @cached_property
    def _called_loads(self) -> PythonCallback | None:
        """The same of the loads with opaque laws, which Python evaluates; None without them."""
        return called_loads(self.system) if self.laws.called else None

    @cached_property
    def _stored_energy(self) -> Function:
        """Function (t, q, v) → (energy in springs, sum of its absolute terms)."""

        def stored(t, q, v):
            energies = stored_energies(Kinematics(self.system, State(t[0], q, v)))
            return [sum(energies, 0.0), sum(map(abs, energies), 0.0)]

        return write(stored, 1, self.system.n_q, self.system.n_v, name="stored")

    @cached_property
    def _energy_sample(self) -> Function:
        """Function (energies of links: kinetic, potential, size of the latter; those of springs; work) → energy sample."""
        least = least_magnitude(self.system)

        def sample(kinetic, potential, size, stored, work):
            potential = potential[0] + stored[0]
            return [*energy_sample(kinetic[0], potential, size[0] + stored[1] + least, work)]

        return write(sample, 1, 1, 1, 2, 3, name="energy_sample")

    def put_energies(self, code: RowCode, target):
        """Write the energy sample of a point, see :func:`gauss.dynamics.energies.look_at_energies`."""
        n_q, n_v, x, links = self.system.n_q, self.system.n_v, code.given, energy_recursion(self.system)
        inputs, parts, stored = code.room(n_q + n_v + 6), code.room(links.result), code.room(2)
        code.copy(inputs, code.at(x, 1), n_q + n_v)
        self.put_ground(code, code.at(inputs, n_q + n_v))
        code.call(links, inputs, parts)
        code.call(self._stored_energy, x, stored)

        def total(first: int, term: Function):
            place = lambda k: code.shifted(code.b.add(k, k), first)  # noqa: E731
            following = lambda k, value: code.inline(term, value, code.number(parts, place(k)))[0]  # noqa: E731
            return code.reduced(links.result // 2, code.motions.constant(0.0), following)

        sums = [total(0, _sum()), total(1, _sum()), total(1, _sum_of_sizes())]
        given = [code.number(stored, k) for k in range(2)] + [code.number(x, self.layout.row - 3 + k) for k in range(3)]
        for k, value in enumerate(code.inline(self._energy_sample, *sums, *given)):
            code.put(target, k, value)

    def put_load_forces(self, code: RowCode, state, target):
        """Write generalised forces and power of the loads at a state (t, q, v)."""
        size, parts = self.system.n_v + 3, [part for part in (self._load_forces, self._called_loads) if part is not None]
        if not parts:
            for k in code.each(size):
                code.put(target, k, code.motions.constant(0.0))
            return
        code.call(parts[0], state, target)
        for part in parts[1:]:
            more = code.room(size)
            code.call(part, state, more)
            for k in code.each(size):
                code.put(target, k, code.b.fadd(code.number(target, k), code.number(more, k)))

    def put_ground(self, code: RowCode, target):
        """Write the acceleration of the ground."""
        for k, value in enumerate(self._ground):
            code.put(target, k, code.motions.constant(float(value)))


@cache
def _sum() -> Function:
    return write(lambda total, term: total + term, 1, 1, name="sum")


@cache
def _sum_of_sizes() -> Function:
    return write(lambda total, term: total + np.abs(term), 1, 1, name="sum_of_sizes")


def ground_acceleration(system: System) -> np.ndarray:
    """Acceleration (6,) of the ground that acts as gravity does."""
    return np.concatenate([np.zeros(3), -np.array(system.scene.gravity)])


def added_forces(system: System, loads) -> Function:
    """(q, v, t) → (generalised forces of loads, residual of the quaternions)."""

    def added(q, v, t):
        motion = Kinematics(system, State(t[0], q, v))
        return generalised_forces(motion, Applied(motion, loads)), [off_unit(system, q)]

    return write(added, system.n_q, system.n_v, 1, name="loads")


def tree_correction(system: System) -> Correction:
    """Correction of accelerations by inverse dynamics, and with it the recursions of forward and inverse dynamics."""
    floor = acceleration_scale(system) * float(system.scale.coordinates.min())
    return Correction(forward_tree_recursion(system), inverse_tree_recursion(system), ground_acceleration(system), floor)


class TreeProgram(KernelProgram):
    """Functions of a large tree; states are not projected, for a tree has no loop constraints."""

    @cached_property
    def _correction(self) -> Correction:
        return tree_correction(self.system)

    def _emit_rates(self, code: RowCode):
        n_q, n_v = self.system.n_q, self.system.n_v
        inputs, loads = code.room(n_q + 2 * n_v + 6), code.room(n_v + 3)
        self.put_load_forces(code, code.given, loads)
        code.copy(inputs, code.at(code.given, 1), n_q + n_v)
        code.copy(code.at(inputs, n_q + n_v), loads, n_v)
        self.put_ground(code, code.at(inputs, n_q + 2 * n_v))
        code.call(self._correction.forward, inputs, code.found)
        code.copy(code.at(code.found, n_v), code.at(loads, n_v), 3)

    def _emit_check(self, code: RowCode):
        n_q, n_v, x, n_in = self.system.n_q, self.system.n_v, code.given, self._correction.arity[0]
        inputs, loads, found = code.room(n_in), code.room(n_v + 3), code.room(n_v + 1)
        self.put_load_forces(code, x, loads)
        code.copy(inputs, code.at(x, 1), n_q + n_v)
        code.copy(code.at(inputs, n_q + n_v), code.at(x, self.layout.row), n_v)
        code.copy(code.at(inputs, n_q + 2 * n_v), loads, n_v)
        code.call(self._correction, inputs, found)
        code.put(code.found, 0, code.number(found, n_v))
        code.put(code.found, 1, code.motions.constant(0.0))
        self.put_energies(code, code.at(code.found, 2))
