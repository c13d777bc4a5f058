"""Contact terms of a time step, in machine code: gap functions, tangential and slip rates, u = J q̇, u̇ = J q̈ + J̇ q̇."""

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.codegen import Function, Kernel, forward, jacobian, write
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.store import cached_on_disk
from gauss.system import State, System, coordinate_rates, guards, sides
from gauss.system.contact_mode import slips
from gauss.system.relations import place_residuals


class ContactTerms(NamedTuple):
    """Contact terms of one state: of gaps, then of friction, then of set-valued elements."""

    width: np.ndarray  # (m,) gap functions [m, rad]
    apart: np.ndarray  # (k,) distances of the shapes of guarded contacts as a whole [m]
    # (n,) rates: m of gaps, two tangential ones of each contact with friction, slip rates of set-valued elements
    rate: np.ndarray
    J: np.ndarray  # (n, n_v) Jacobian of the rates with respect to q̇
    bias: np.ndarray  # (n,) derivative of the rates with q̈ = 0


class ContactTermsKernel:
    """Contact terms, as machine code, or inlined where they are traced.

    ``system``: with unilateral constraints or set-valued elements.
    """

    def __init__(self, system: System):
        scene = system.scene
        gaps, whole = sides(scene), guards(scene)
        watched = place_residuals(system, [*gaps, *slips(scene), *scene.set_valued.values()])
        guarded = place_residuals(system, whole)
        m, self.n_v = len(gaps), system.n_v

        def flat(t, q, v):
            motion = kinematics(system, State(t[0], q, v))
            found = watched.values(motion)
            width, rate = found[:m], found[m:]
            apart: Iterable = guarded.values(motion)[: len(whole)] if whole else ()
            bias = forward(rate, [*t, *q], [1.0, *coordinate_rates(system, q, v)])
            return [[*width, *apart, *rate, *jacobian(rate, v).ravel(), *bias]]

        self.system, self.trace = system, lambda: write(flat, 1, system.n_q, self.n_v, name="touching")
        n = len(watched.traced.outputs) - m
        self.parts = np.cumsum([m, len(whole), n, n * self.n_v])

    @cached_property
    def function(self) -> Function:
        """Traced function (t, q, v) → contact terms."""
        return self.trace()

    @property
    def operations(self) -> int:
        """Number of operations."""
        return sum(self.function.operations().values())

    @cached_property
    def kernel(self) -> Kernel:
        """Machine code."""
        make = lambda: Kernel(self.function, batch=False)  # noqa: E731
        return cached_on_disk(self.system, (ContactTermsKernel,), make)

    def __call__(self, state: State) -> ContactTerms:
        """Contact terms of a state."""
        return self._split(self.kernel(np.concatenate([[state.t], state.q, state.v])))

    def written(self, state: State) -> ContactTerms:
        """Contact terms of a traced state, inlined."""
        return self._split(self.function.inlined([state.t], state.q, state.v))

    def _split(self, found: np.ndarray) -> ContactTerms:
        width, apart, rate, J, bias = np.split(found, self.parts)
        return ContactTerms(width, apart, rate, J.reshape(rate.size, self.n_v), bias)
