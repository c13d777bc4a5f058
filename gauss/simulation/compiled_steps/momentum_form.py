"""Momenta, forces and constraints of a system, as traced functions for symplectic and other mechanical integrators.

In the chart q₀ ⊕ θ the kinetic energy T(θ, θ̇) gives the momentum ∂T/∂θ̇ and the force ∂T/∂θ + Q, by differentiation of the
traced graph (Hairer, Lubich, Wanner, Geometric Numerical Integration, VI.1).
"""

from functools import cached_property
from typing import cast

import numpy as np

from gauss.codegen import Expression, Function, Scalar, as_number, jacobian, reverse, write
from gauss.dynamics.energies import potential_energy
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mechanism import Mechanism, condensed, dependent_coordinates, kinetic_energy, loop_residual
from gauss.dynamics.traced_system import Program, applied_loads, largest
from gauss.errors import SimulationError
from gauss.integrators import Impulses, Reached
from gauss.system import (
    State,
    System,
    along_rates,
    chart_lead,
    chart_velocity,
    in_own_axes,
    in_parent_axes,
    retract,
    velocity_lead,
)


def _energy(system: System, q, v) -> Expression:
    """Kinetic energy of symbols."""
    return cast(Expression, kinetic_energy(system, q, v))


class MomentumForm:
    """Momentum form of the equations of motion of a traced system, see :class:`gauss.integrators.step.Mechanics`.

    Attributes
    ----------
    n_constraints : int
        Number m of loop, coupling and relation constraints.
    extent : float
        Size of the positions in units of the scene: 1 for each rate, 0 without constraints.
    redundant : bool
        Whether constraints are redundant.

    Raises
    ------
    SimulationError
        If a constraint binds velocities only.
    """

    def __init__(self, program: Program):
        self.program, self.system = program, program.system
        self.evaluate = program.evaluate
        rolling = [placed.name for placed in self.system.relations.placed if placed.velocities]
        if rolling:
            raise SimulationError(
                f"constraint {rolling[0]!r} binds velocities, and this integrator takes constraints on positions only; "
                "use 'dop853'."
            )
        self.n_constraints = len(self._violation.outputs)
        self.extent = float(self.system.n_v) if self.n_constraints else 0.0
        self.redundant = self.system.closes and not program.has_full_rank

    @cached_property
    def _violation(self) -> Function:
        return write(lambda t, q: loop_residual(self.system, q, t[0])[0], 1, self.system.n_q, name="violation")

    def violation(self, t, q) -> np.ndarray:
        """Constraint residual g(q) (m,)."""
        return self._violation([t], q)

    def largest_violation(self, state: State) -> Scalar:
        """Largest constraint residual, relative to the sizes of the constraints."""
        return largest([0.0, *(self.violation(state.t, state.q) * self.program.shares)]) if self.n_constraints else 0.0

    @cached_property
    def _momentum(self) -> Function:
        def momentum(q, v):
            return in_parent_axes(self.system, q, condensed(self.system, reverse(_energy(self.system, q, v), v)))

        return write(momentum, self.system.n_q, self.system.n_v, name="momentum")

    def momentum(self, state: State) -> np.ndarray:
        """Momentum M v (n_v,) along the free coordinates, in axes of parents."""
        return self._momentum(state.q, state.v)

    @cached_property
    def _in_own_axes(self) -> Function:
        return write(lambda q, vector: in_own_axes(self.system, q, vector), self.system.n_q, self.system.n_v, name="own")

    def in_own_axes(self, q, vector) -> np.ndarray:
        """Vector along the rates (n_v,) in the axes of the joints instead of those of their parents."""
        return vector if self.system.is_flat else self._in_own_axes(q, vector)

    @cached_property
    def _energies(self) -> Function:
        def energies(t, q, v):
            potential = potential_energy(kinematics(self.system, State(t[0], q, v)))
            return [kinetic_energy(self.system, q, v), potential]

        return write(energies, 1, self.system.n_q, self.system.n_v, name="energies")

    def energies(self, state: State) -> tuple[Scalar, Scalar]:
        """Kinetic energy, and potential energy of gravity and springs [J]."""
        return tuple(self._energies([state.t], state.q, state.v))

    @cached_property
    def acts(self) -> np.ndarray:
        """1 where a force may act in a chart; elsewhere it is folded to the constant 0."""
        n = self.system.n_v
        return np.array([0.0 if as_number(force) == 0.0 else 1.0 for force in self._impulses.outputs[n : 2 * n]])

    def mechanism(self, state: State) -> Mechanism:
        """Factored equations of motion in a state."""
        return Mechanism(self.system, state.q, state.v, state.t)

    @cached_property
    def _impulses(self) -> Function:
        system, n = self.system, self.system.n_v

        def impulses(t, q0, theta, rate):
            q, v = retract(system, q0, theta), chart_velocity(system, theta, rate)
            energy = _energy(system, q, v)
            momentum, force = (condensed(system, reverse(energy, symbols)) for symbols in (rate, theta))
            applied, power = self._applied(t[0], q, v)
            return momentum, force + self._chart(chart_velocity, theta, rate).T @ applied, power

        return write(impulses, 1, system.n_q, n, n, name="impulses")

    def impulses(self, t, q, theta, rate) -> Impulses:
        """Momentum and force in the chart around q."""
        n = self.system.n_v
        return Impulses(*np.split(self._impulses([t], q, theta, rate), [n, 2 * n]))

    def _applied(self, t, q, v):
        """Generalised forces (n_v,) of gravity and loads, and the power of the latter."""
        n = self.system.n_v
        effort, forces, power = self._loaded(t, q, v)
        still = Mechanism(self.system, q, np.zeros(n), t)
        return still.residual(np.zeros(n), np.zeros(self.n_constraints), effort, forces)[0], power

    @cached_property
    def _gradient(self) -> Function:
        """Function (q, v) → ∂T/∂q along the rates, and ∂T/∂v."""
        system = self.system

        def gradient(q, v):
            energy = _energy(system, q, v)
            return along_rates(system, q, reverse(energy, q)), reverse(energy, v)

        return write(gradient, system.n_q, system.n_v, name="gradient")

    @cached_property
    def _transported(self) -> Function:
        system, n = self.system, self.system.n_v

        def transported(t, q0, theta, rate):
            q, v = retract(system, q0, theta), chart_velocity(system, theta, rate)
            force, momentum = (condensed(system, half) for half in np.split(self._gradient.inlined(q, v), [n]))
            applied, power = self._applied(t[0], q, v)
            force, B = force + applied, self._chart(chart_velocity, theta, rate)
            turning = jacobian(v, theta).T @ momentum
            return B.T @ momentum, B.T @ force + turning, power, in_parent_axes(system, q, force)

        return write(transported, 1, system.n_q, n, n, name="transported")

    def transported(self, t, q, theta, rate) -> tuple[Impulses, np.ndarray]:
        """Momentum and force in the chart around q, and the force ∂T/∂q + Q at fixed rates v, in axes of parents."""
        n = self.system.n_v
        *parts, force = np.split(self._transported([t], q, theta, rate), [n, 2 * n, 2 * n + 3])
        return Impulses(*parts), force

    def _place(self, t, q0, theta) -> np.ndarray:
        """Coordinates at θ in the chart; those of joints that close loops follow, as their axes turn with them."""
        return dependent_coordinates(self.system, retract(self.system, q0, theta), t)

    def _loaded(self, t, q, v):
        """Loads of a state, see :func:`applied_loads`; they may depend on joints that close loops."""
        loads = self.program.loads
        return applied_loads(self.system, loads, self._following(t, q, v) if loads else State(t, q, v))

    def _following(self, t, q, v) -> State:
        """State whose coordinates of joints that close loops follow from the others."""
        if not self.system.closes:
            return State(t, q, v)
        q = dependent_coordinates(self.system, q, t)
        return State(t, q, Mechanism(self.system, q, v, t).dependent_rates())

    @cached_property
    def spread(self) -> np.ndarray:
        """Matrix S (n_v, n) of v = S u, u being the rates along the free coordinates; without joints that close loops."""
        columns = []
        for subsystem in self.system.subsystems:
            ratios = {}
            for train in subsystem.trains:
                first, *others = (subsystem.joints[joint].v.start for joint in train.joints)
                ratios[first] = dict(zip([first, *others], train.ratios, strict=True))
                ratios |= dict.fromkeys(others, {})
            loop_rates = {k for index in subsystem.loop_joints for k in range(subsystem.n_v)[subsystem.joints[index].v]}
            for k in range(subsystem.n_v):
                column = np.zeros(self.system.n_v)
                for place, ratio in ratios.get(k, {k: 1.0}).items():
                    column[subsystem.v[place]] = ratio
                if column.any() and k not in loop_rates:
                    columns.append(column)
        return np.array(columns).reshape(-1, self.system.n_v).T

    @cached_property
    def _residual(self) -> Function:
        system, n = self.system, self.system.n_v

        def residual(t, q0, theta, v, acceleration, multipliers):
            q = self._place(t[0], q0, theta)
            effort, forces, _ = self._loaded(t[0], q, v)
            motion, _ = Mechanism(system, q, v, t[0]).residual(acceleration, multipliers, effort, forces)
            return motion, loop_residual(system, q, t[0])[0]

        return write(residual, 1, system.n_q, n, n, n, self.n_constraints, name="residual")

    def residual(self, t, q, theta, v, acceleration, multipliers):
        """Residuals of the equations of motion (n_v,) and of the constraints (m,) at θ in the chart around q."""
        found = self._residual([t], q, theta, v, acceleration, multipliers)
        return found[: self.system.n_v], found[self.system.n_v :]

    @cached_property
    def _velocity_violation(self) -> Function:
        system, n = self.system, self.system.n_v

        def velocity_violation(t, q0, theta, v):
            return Mechanism(system, self._place(t[0], q0, theta), v, t[0]).velocity_residual()

        return write(velocity_violation, 1, system.n_q, n, n, name="velocity_violation")

    def velocity_violation(self, t, q, theta, v) -> np.ndarray:
        """Velocity residual K v − C (m,) of the constraints at θ in the chart around q."""
        return self._velocity_violation([t], q, theta, v)

    def tracked(self, t, q, theta, v) -> State:
        """State at θ in the chart around q; coordinates of joints that close loops follow from the others."""
        return self._following(t, retract(self.system, q, theta), v)

    def _chart(self, map_, theta, rate) -> np.ndarray:
        """Matrix (n_v, n_v) of a linear map of rates."""
        return np.eye(theta.size) if self.system.is_flat else jacobian(map_(self.system, theta, rate), rate)

    @cached_property
    def _reaction(self) -> Function:
        system, n = self.system, self.system.n_v

        def reaction(t, q0, theta, multipliers, rate):
            q = self._place(t[0], q0, theta)
            mechanism = Mechanism(system, q, np.zeros(n), t[0])
            force = mechanism.reaction(multipliers)
            in_chart = self._chart(chart_velocity, theta, rate).T @ force
            return in_chart, [mechanism.power(multipliers)], [] if system.is_flat else in_parent_axes(system, q, force)

        return write(reaction, 1, system.n_q, n, self.n_constraints, n, name="reaction")

    def reaction(self, t, q, theta, multipliers) -> tuple[np.ndarray, Scalar, np.ndarray]:
        """Force −Kᵀ λ (n_v,) in the chart around q, the power of rheonomic constraints, and −Kᵀ λ in axes of parents."""
        n = self.system.n_v
        found = self._reaction([t], q, theta, multipliers, np.zeros(n))
        return found[:n], found[n], found[:n] if self.system.is_flat else found[n + 1 :]

    @cached_property
    def _in_chart(self) -> Function:
        system, (n_q, n) = self.system, (self.system.n_q, self.system.n_v)

        def in_chart(q0, theta, momentum, push):
            momentum, push = in_own_axes(system, q0, momentum), in_own_axes(system, q0, push)
            return push + (velocity_lead(system, theta, push) + velocity_lead(system, theta, momentum))

        return write(in_chart, n_q, n, n, n, name="in_chart")

    def in_chart(self, q, theta, momentum, push) -> np.ndarray:
        """Change of momentum (n_v,) in the chart around q up to θ, of a momentum and a change in axes of parents.

        The momentum in the chart is B(θ) times that along the rates at q, B being the matrix of
        :func:`gauss.system.chart_velocity`.
        """
        return push if self.system.is_flat else self._in_chart(q, theta, momentum, push)

    @cached_property
    def _out_of_chart(self) -> Function:
        system, (n_q, n) = self.system, (self.system.n_q, self.system.n_v)

        def out_of_chart(q0, theta, momentum, push):
            own = push + (chart_lead(system, theta, push) + chart_lead(system, theta, in_own_axes(system, q0, momentum)))
            return in_parent_axes(system, q0, own)

        return write(out_of_chart, n_q, n, n, n, name="out_of_chart")

    def out_of_chart(self, q, theta, momentum, push) -> np.ndarray:
        """Change of momentum (n_v,) in axes of parents, of a momentum in these axes and a change in the chart."""
        return push if self.system.is_flat else self._out_of_chart(q, theta, momentum, push)

    @cached_property
    def _reached(self) -> Function:
        system, n = self.system, self.system.n_v

        def reached(t, q0, theta, begin, push):
            q = self._place(t[0], q0, theta)
            mechanism = Mechanism(system, q, np.zeros(n), t[0])
            v, multipliers = mechanism.response(in_own_axes(system, q, begin + push), None)
            push = push + in_parent_axes(system, q, mechanism.reaction(multipliers))
            momentum = begin + push
            return q, v, momentum, push - (momentum - begin), [mechanism.power(multipliers)]

        return write(reached, 1, system.n_q, n, n, n, name="reached")

    def reached(self, t, q, theta, momentum, push) -> Reached:
        """End of a step at θ in the chart around q, up to a reaction; momentum and push are in axes of parents."""
        n_q, n = self.system.n_q, self.system.n_v
        found = self._reached([t], q, theta, momentum, push)
        q, v, momentum, compensation, work = np.split(found, np.cumsum([n_q, n, n, n]))
        return Reached(State(t, q, v), momentum, compensation, work[0])
