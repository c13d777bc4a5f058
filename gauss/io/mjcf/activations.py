"""Activations of actuators of a MuJoCo model as states of a scene, and the curves of its muscles, over numbers or symbols.

    integrator:  ȧ = u            filter:  ȧ = (u − a)/τ
    muscle:      ȧ = (u − a)/τ(u − a, a),   F = −F₀ (f_L(l) f_V(l̇) a + f_P(l))

MuJoCo's documentation, "Computation: Actuation model" and "Modeling: Muscles"; Millard et al. 2013 for τ. What is
integrated stays in its range, as no rate leads out of it there. MuJoCo acts a step earlier with actearly;
here time is continuous.
"""

from dataclasses import dataclass
from math import inf
from typing import Any

import mujoco
import numpy as np

from gauss import math

Number = Any  # number or symbol
KINDS = ("INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE")
INTEGRATOR, FILTER, EXACT, MUSCLE = (int(getattr(mujoco.mjtDyn, f"mjDYN_{name}")) for name in KINDS)
KNOWN_TYPES = INTEGRATOR, FILTER, EXACT, MUSCLE
MUSCLE_GAIN, MUSCLE_BIAS = int(mujoco.mjtGain.mjGAIN_MUSCLE), int(mujoco.mjtBias.mjBIAS_MUSCLE)
LEAST = mujoco.mjMINVAL  # s, m, N: least divisor


@dataclass(frozen=True)
class Activation:
    """Law of an activation."""

    kind: int  # INTEGRATOR, FILTER, EXACT or MUSCLE
    # time constants [s]; of a muscle those of activation and deactivation, and the width between them [1]
    times: tuple[float, ...]
    low: float = -inf  # low, high: range of the activation
    high: float = inf

    def rate(self, u: Number, a: Number) -> Number:
        """Rate of the activation for a control [1/s]."""
        found = u if self.kind == INTEGRATOR else self._lag(u, a)
        if self.low == -inf and self.high == inf:
            return found
        upwards, downwards = math.maximum(found, 0.0), math.minimum(found, 0.0)
        return math.where(a >= self.high, downwards, math.where(a <= self.low, upwards, found))

    def bounded(self, a: Number) -> Number:
        """Activation that acts: within its range."""
        return math.clip(a, self.low, self.high) if self.low > -inf or self.high < inf else a

    def _lag(self, u: Number, a: Number) -> Number:
        if self.kind != MUSCLE:
            return (u - a) / max(self.times[0], LEAST)
        scale, missing = 0.5 + 1.5 * math.clip(a, 0.0, 1.0), math.clip(u, 0.0, 1.0) - a
        rising, falling, width = self.times[0] * scale, self.times[1] / scale, self.times[2]
        share = math.where(missing > 0.0, 1.0, 0.0) if width < LEAST else _sigmoid(missing / width + 0.5)
        return missing / math.maximum(falling + (rising - falling) * share, LEAST)


@dataclass(frozen=True)
class MuscleCurves:
    """Force of a muscle by its length and rate."""

    # shortest, optimal, first: least length and optimal length of the muscle [m], and the least length in optimal ones
    shortest: float
    optimal: float
    first: float
    force: float  # greatest active force at rest [N]
    # lmin, lmax, vmax, fpmax, fvmax: muJoCo's parameters of the curves, in optimal lengths, optimal lengths a second, and
    # greatest forces
    lmin: float
    lmax: float
    vmax: float
    fpmax: float
    fvmax: float

    def gain(self, length: Number, rate: Number) -> Number:
        """Force [N] for an activation of 1, without the passive one."""
        return (
            -self.force * self._by_length(self._normal(length)) * self._by_rate(rate / max(self.optimal * self.vmax, LEAST))
        )

    def bias(self, length: Number) -> Number:
        """Passive force [N]."""
        x, middle = self._normal(length), 0.5 * (1.0 + self.lmax)
        width = max(middle - 1.0, LEAST)
        over, beyond = (x - 1.0) / width, (x - middle) / width
        curve = math.where(x <= 1.0, 0.0, math.where(x <= middle, 0.5 * over * over, 0.5 + beyond))
        return -self.force * self.fpmax * curve

    def _normal(self, length: Number) -> Number:
        return self.first + (length - self.shortest) / max(self.optimal, LEAST)

    def _by_length(self, x: Number) -> Number:
        lmin, lmax = self.lmin, self.lmax
        low, high = 0.5 * (lmin + 1.0), 0.5 * (1.0 + lmax)
        hill = [(x - lmin) / max(low - lmin, LEAST), (1.0 - x) / max(1.0 - low, LEAST)]
        hill += [(x - 1.0) / max(high - 1.0, LEAST), (lmax - x) / max(lmax - high, LEAST)]
        foot_1, top_1, top_2, foot_2 = (0.5 * part * part for part in hill)
        right = math.where(x <= high, 1.0 - top_2, math.where(x <= lmax, foot_2, 0.0))
        left = math.where(x <= low, math.where(x >= lmin, foot_1, 0.0), 1.0 - top_1)
        return math.where(x <= 1.0, left, right)

    def _by_rate(self, v: Number) -> Number:
        y = self.fvmax - 1.0
        shortening = math.where(v <= -1.0, 0.0, (v + 1.0) * (v + 1.0))
        lengthening = math.where(v <= y, self.fvmax - (y - v) * (y - v) / max(y, LEAST), self.fvmax)
        return math.where(v <= 0.0, shortening, lengthening)


def activation(model, i: int) -> Activation:
    """Activation of the actuator of a number."""
    limits = map(float, model.actuator_actrange[i]) if model.actuator_actlimited[i] else (-inf, inf)
    return Activation(int(model.actuator_dyntype[i]), tuple(map(float, model.actuator_dynprm[i, :3])), *limits)


def muscle_curves(model, i: int, numbers: np.ndarray) -> MuscleCurves:
    """Curves of the actuator of a number, by its parameters of gain or bias."""
    first, last, force, scale, lmin, lmax, vmax, fpmax, fvmax = map(float, numbers[:9])
    low, high = map(float, model.actuator_lengthrange[i])
    force = force if force >= 0.0 else scale / max(float(model.actuator_acc0[i]), LEAST)
    return MuscleCurves(low, (high - low) / max(last - first, LEAST), first, force, lmin, lmax, vmax, fpmax, fvmax)


def _sigmoid(x: Number) -> Number:
    """From 0 at 0 to 1 at 1, with two derivatives that are zero there."""
    x = math.clip(x, 0.0, 1.0)
    return x * x * x * (3.0 * x * (2.0 * x - 5.0) + 10.0)
