"""Accelerations where gaps are closed, in machine code: the compulsion with rows G x ≤ h, solved by forces that push.

With q̈ = q̈_free + M⁻¹ Jᵀ f a closed gap opens with u = J q̈ + J̇ q̇, and f ≥ 0, u ≥ 0, f u = 0: the law of a gap without
friction, see :mod:`gauss.dynamics.contact.contact_step`. What is found is checked as a whole: by inverse dynamics under
all forces, and by the law.
"""

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Interface, Kernel, fastcall, write
from gauss.dynamics.consistent_states import ACCEPTED
from gauss.dynamics.contact.impact import LEAVING
from gauss.dynamics.contact.moreau_step import MISSED_CLOSING_RATE, moreau_stepper
from gauss.dynamics.contact_terms import ContactTerms
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.gap_functions import TOUCHING
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import CONTACTS
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_system import Program, largest
from gauss.integrators import Point, Rates
from gauss.system import State, System

PATIENCE = 100  # quadratic programmes that take as long as making machine code of a few gaps
LARGEST = float(np.finfo(float).max)
LIMITS = ACCELERATION_TOLERANCE, ACCELERATION_TOLERANCE, ACCEPTED, LARGEST  # of what speaks for an answer


class UnilateralAccelerations(NamedTuple):
    """Accelerations under closed gaps.

    Attributes
    ----------
    acceleration : ndarray, shape (n_v,)
        Of the coordinates.
    opening : ndarray, shape (m,)
        Accelerations with which the gaps open, in units of the scene.
    scale : float
        Size of the accelerations at hand, in the same.
    doubts : list
        Error of the accelerations, of the law of gaps, gap of other constraints, sum of all that is found.
    """

    acceleration: np.ndarray
    opening: np.ndarray
    scale: float
    doubts: list


def pressed(system: System, laws: Laws, certified: Callable, doc: str) -> Callable:
    """Compiled function (q, v, load, out=None, t=0.0) → q̈ under gaps that are closed; what it cannot confirm is certified.

    Parameters
    ----------
    system : System
        One of which only frictionless contacts are not smooth.
    laws : Laws
        Loads of the same without gaps.
    certified : callable
        Called like this one.
    doc : str
        Its documentation.
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
        return found.acceleration, found.doubts

    return fastcall(write(flat, *sizes.values(), 1, name=name), Interface(sizes, "t", limits=LIMITS), certified, name, doc)


class ActiveSetKernel:
    """Which of some gaps stay closed, by machine code, once quadratic programmes have taken as long as making it.

    Parameters
    ----------
    system : System
        With gaps.
    """

    def __init__(self, system: System):
        self.system, self.gaps, self.left = system, len(system.contacts.placed), PATIENCE

    def __call__(self, state: State, touching: np.ndarray) -> np.ndarray | None:
        """Those of the gaps ``touching`` that stay closed; None if it is not known so."""
        self.left -= 1
        if self.left >= 0 or self.kernel is None:
            return None
        closed = np.zeros(self.gaps)
        closed[touching] = 1.0
        found = self.kernel(np.concatenate([[state.t], state.q, state.v, closed]))
        if not (found[self.gaps :] <= LIMITS).all():
            return None
        return touching[found[touching] <= 0.0]

    @cached_property
    def kernel(self) -> Kernel | None:
        """Machine code; None if something cannot be traced."""
        system, n_v = self.system, self.system.n_v
        if CONTACTS.plan(Question(system, Laws(system))).dynamics != "unilateral":
            return None
        laws = Laws(moreau_stepper(system).smooth)

        def flat(t, q, v, closed):
            state = State(t[0], q, v)
            stepper = moreau_stepper(system)
            touch = stepper.relative(stepper.kernel.written(state))
            found = _found(system, laws, state, touch, closed, np.zeros(n_v))
            return found.opening - LEAVING * found.scale, found.doubts

        return Kernel(write(flat, 1, system.n_q, n_v, self.gaps, name="staying"), batch=False)


def _found(system: System, laws: Laws, state: State, touch: ContactTerms, closed, load) -> UnilateralAccelerations:
    """Traced accelerations where some gaps are closed, 1 each, and others are not, 0 each; judged in units of the scene."""
    stepper, T = moreau_stepper(system), system.scale.time
    program = Program(stepper.smooth, laws)
    mechanism, free = program.instant(state, load)
    H = stepper.compliance(mechanism)
    without = (touch.J @ free.acceleration + touch.bias) * T
    scale = 1.0 + largest([*without, *(free.acceleration * (T * T / system.scale.coordinates))])
    opening = [math.where(shut > 0.0, rate, 2.0 * MISSED_CLOSING_RATE) for shut, rate in zip(closed, without, strict=True)]
    J = touch.J * np.array(closed, dtype=object)[:, None]  # an open gap takes no force
    force, error, doubtful = stepper.forces(
        opening, 1.0, J, H, np.zeros(touch.rate.size), np.zeros(0), MISSED_CLOSING_RATE * scale, 1.0
    )
    push = J.T @ (force * (1.0 / T))
    total = free.acceleration + H @ push
    point = Point(state, np.zeros(3), Rates(total, np.zeros(3)), np.zeros(0))
    wrong = program.check(program.layout.pack(point), load + push).sum()
    law = math.where(doubtful > 0.0, np.inf, error / scale)
    everything = sum(np.abs([*total, *force]))
    return UnilateralAccelerations(
        total, (touch.J @ total + touch.bias) * T, scale, [wrong, law, program.gap(state), everything]
    )
