"""Gaps, sliding and grips as rates of the coordinates, in machine code: what a step of time stepping asks for."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.codegen import Kernel, forward, jacobian, write
from gauss.dynamics.kinematics import kinematics
from gauss.system import State, System, coordinate_rates, guards, sides
from gauss.system.build import slips
from gauss.system.relations import OPTIMISED_OPERATIONS, place_residuals


class Touching(NamedTuple):
    """Gaps, then sliding at those with friction, then grips, of one instant.

    Attributes
    ----------
    width : ndarray, shape (m,)
        Widths of the gaps [m, rad].
    apart : ndarray, shape (k,)
        Distances of the shapes of guarded contacts as a whole [m].
    rate : ndarray, shape (n,)
        Rates: m of gaps, two of each sliding, and those with which grips slide.
    J : ndarray, shape (n, n_v)
        Slopes of the rates over q̇.
    bias : ndarray, shape (n,)
        Rate of the rates where q̈ = 0.
    """

    width: np.ndarray
    apart: np.ndarray
    rate: np.ndarray
    J: np.ndarray
    bias: np.ndarray


class TouchingKernel:
    """What touches, as machine code, or written out where it is traced.

    Parameters
    ----------
    system : System
        With one-sided constraints or grips.
    """

    def __init__(self, system: System):
        scene = system.scene
        gaps, whole = sides(scene), guards(scene)
        watched = place_residuals(system, [*gaps, *slips(scene), *scene.grips.values()])
        guarded = place_residuals(system, whole)
        m, self.n_v = len(gaps), system.n_v

        def flat(t, q, v):
            motion = kinematics(system, State(t[0], q, v))
            found = watched.values(motion)
            width, rate = found[:m], found[m:]
            apart = guarded.values(motion)[: len(whole)] if whole else []
            bias = forward(rate, [*t, *q], [1.0, *coordinate_rates(system, q, v)])
            return [[*width, *apart, *rate, *jacobian(rate, v).ravel(), *bias]]

        self.function = write(flat, 1, system.n_q, self.n_v, name="touching")
        n = len(watched.function.outputs) - m
        self.parts = np.cumsum([m, len(whole), n, n * self.n_v])

    @property
    def operations(self) -> int:
        """Number of operations."""
        return sum(self.function.operations().values())

    @cached_property
    def kernel(self) -> Kernel:
        """Machine code."""
        return Kernel(self.function, batch=False, optimise=int(self.operations < OPTIMISED_OPERATIONS))

    def __call__(self, state: State) -> Touching:
        """What touches in a state."""
        return self._split(self.kernel(np.concatenate([[state.t], state.q, state.v])))

    def written(self, state: State) -> Touching:
        """What touches in a traced state, written out."""
        return self._split(self.function.inlined([state.t], state.q, state.v))

    def _split(self, found: np.ndarray) -> Touching:
        width, apart, rate, J, bias = np.split(found, self.parts)
        return Touching(width, apart, rate, J.reshape(rate.size, self.n_v), bias)
