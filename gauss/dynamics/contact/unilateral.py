"""Unilateral dynamics: q̈ = q̈_free + M⁻¹ Jᵀ f with 0 ≤ f ⟂ u = J q̈ + J̇ q̇ ≥ 0 at the closed gaps, in machine code.

The linear complementarity problem of frictionless contacts, equivalent to the compulsion with rows G x ≤ h, by the solver of
:mod:`gauss.dynamics.contact.contact_step`. Results are checked by inverse dynamics under all forces, and by
complementarity.
"""

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Interface, Kernel, entry_code, fastcall, write
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.contact.impact import LEAVING
from gauss.dynamics.contact.moreau_step import MISSED_CLOSING_RATE, moreau_stepper
from gauss.dynamics.contact_terms import ContactTerms
from gauss.dynamics.engines.tiering import CONTACT_THRESHOLD, CompileThreshold
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.gap_functions import TOUCHING
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import CONTACTS
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_system import FINITE, Program, largest
from gauss.integrators import Point, Rates
from gauss.system import State, System

LIMITS = ACCELERATION_TOLERANCE, ACCELERATION_TOLERANCE, RESIDUAL_TOLERANCE, FINITE  # of the errors of a result


class UnilateralAccelerations(NamedTuple):
    """Accelerations with an active set of contacts, and their errors."""

    acceleration: np.ndarray  # (n_v,) joint accelerations
    opening: np.ndarray  # (m,) accelerations of the gap functions, in units of the scene
    scale: float  # largest acceleration, in the same
    errors: list  # error of the accelerations, of complementarity, residual of the bilateral constraints, sum of all results


def unilateral_dynamics(system: System, laws: Laws, certified: Callable, doc: str) -> Callable:
    """Compiled function (q, v, load, out=None, t=0.0) → q̈ with closed gaps; results that fail a check are certified.

    Parameters
    ----------
    system : System
        One with frictionless contacts as the only non-smooth elements.
    laws : Laws
        Loads of the system without contacts.
    certified : callable
        Certified function of the same arguments.
    doc : str
        Docstring of the result.
    """
    sizes, name = {"q": system.n_q, "v": system.n_v, "load": system.n_v}, "accelerations"

    def flat(q, v, load, t):
        state = State(t[0], q, v)
        stepper = moreau_stepper(system)
        touch = stepper.relative(stepper.kernel.written(state))
        rest, near = stepper.rest(v), TOUCHING * system.scale.time
        gaps = zip(touch.width, touch.rate, strict=True)
        closed = [math.where(width <= near, math.where(rate <= rest, 1.0, 0.0), 0.0) for width, rate in gaps]
        found = _found(system, laws, state, touch, closed, load)
        return found.acceleration, found.errors

    interface = Interface(sizes, "t", limits=LIMITS)
    make = lambda: entry_code(write(flat, *sizes.values(), 1, name=name), interface)  # noqa: E731
    entry = cached_on_disk(system, (entry_code, unilateral_dynamics, laws.key), make)
    return fastcall(entry, interface, certified, name, doc)


class ActiveSetKernel:
    """Active set of contacts at the level of accelerations, by machine code: at once, or above the compile threshold."""

    def __init__(self, system: System):
        self.system, self.gaps = system, len(system.contacts.placed)
        self.plan = CONTACTS.plan(Question(system, Laws(system)))
        self.threshold = CompileThreshold(0 if self.plan.dynamics == "compiled" else CONTACT_THRESHOLD)

    def __call__(self, state: State, touching: np.ndarray) -> np.ndarray | None:
        """Those of the gaps ``touching`` that stay closed; None below the threshold, and where a check fails."""
        if self.plan.dynamics == "certified" or not self.threshold.passed():
            return None
        closed = np.zeros(self.gaps)
        closed[touching] = 1.0
        found = self.kernel(np.concatenate([[state.t], state.q, state.v, closed]))
        if not (found[self.gaps :] <= LIMITS).all():
            return None
        return touching[found[touching] <= 0.0]

    @cached_property
    def kernel(self) -> Kernel:
        """Machine code."""
        system, n_v = self.system, self.system.n_v
        laws = Laws(moreau_stepper(system).smooth)

        def flat(t, q, v, closed):
            state = State(t[0], q, v)
            stepper = moreau_stepper(system)
            touch = stepper.relative(stepper.kernel.written(state))
            found = _found(system, laws, state, touch, closed, np.zeros(n_v))
            return found.opening - LEAVING * found.scale, found.errors

        make = lambda: Kernel(write(flat, 1, system.n_q, n_v, self.gaps, name="staying"), batch=False)  # noqa: E731
        return cached_on_disk(system, (Kernel, ActiveSetKernel, laws.key), make)


def _found(system: System, laws: Laws, state: State, touch: ContactTerms, closed, load) -> UnilateralAccelerations:
    """Traced accelerations with the active set ``closed`` (1 or 0 for each gap), with errors in units of the scene."""
    stepper, T = moreau_stepper(system), system.scale.time
    program = Program(stepper.smooth, laws)
    mechanism, free = program.instant(state, load)
    H = stepper.compliance(mechanism)
    without = (touch.J @ free.acceleration + touch.bias) * T
    scale = 1.0 + largest([*without, *(free.acceleration * (T * T / system.scale.coordinates))])
    opening = [math.where(shut > 0.0, rate, 2.0 * MISSED_CLOSING_RATE) for shut, rate in zip(closed, without, strict=True)]
    J = touch.J * np.array(closed, dtype=object)[:, None]  # open gaps bear no force
    force, error, undecided = stepper.forces(
        opening, 1.0, J, H, np.zeros(touch.rate.size), np.zeros(0), MISSED_CLOSING_RATE * scale, 1.0
    )
    tau = J.T @ (force * (1.0 / T))
    total = free.acceleration + H @ tau
    point = Point(state, np.zeros(3), Rates(total, np.zeros(3)), np.zeros(0))
    error_of_dynamics = program.check(program.layout.pack(point), load + tau).sum()
    law = math.where(undecided > 0.0, np.inf, error / scale)
    everything = sum(np.abs([*total, *force]))
    return UnilateralAccelerations(
        total, (touch.J @ total + touch.bias) * T, scale, [error_of_dynamics, law, program.residual(state), everything]
    )
