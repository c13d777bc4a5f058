"""Actuators of a MuJoCo model without anybody at the controls: the law of their force, and which of them act.

Force = (g₀ + g₁ l + g₂ l̇) u + b₀ + b₁ l + b₂ l̇ of the length l of what is pulled, for a control u; MuJoCo's documentation,
"Computation: Actuation model". Nobody gives u, so that it is 0, clamped to its range as MuJoCo clamps it.
"""

import mujoco
import numpy as np

from gauss.io.mjcf.switches import is_off

COUNT = (
    "nactuator" if hasattr(mujoco.MjModel, "nactuator") else "nu"
)  # from MuJoCo 4 on an actuator has any number of controls
NO_BIAS, AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
FIXED_GAIN, AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
GROUPS = range(31)  # of actuators, which can be switched off


def actuators(model) -> range:
    """Numbers of all actuators."""
    return range(getattr(model, COUNT))


def is_switched_off(model, i: int) -> bool:
    """Whether the group of an actuator is disabled: then it does not pull."""
    group = int(model.actuator_group[i])
    return group in GROUPS and bool(int(model.opt.disableactuator) >> group & 1)


def n_controls(model, i: int) -> int:
    """How many controls an actuator has."""
    return int(model.actuator_ctrlnum[i]) if COUNT == "nactuator" else 1


def control(model, i: int) -> float:
    """What an actuator of one control is given when nobody gives anything: 0, or the end of its range that is nearest."""
    if n_controls(model, i) != 1 or is_off(model, "CLAMPCTRL"):
        return 0.0
    place = int(model.actuator_ctrladr[i]) if COUNT == "nactuator" else i
    return float(np.clip(0.0, *model.actuator_ctrlrange[place])) if model.actuator_ctrllimited[place] else 0.0


def gear(model, i: int) -> np.ndarray:
    """Gear (6,) of an actuator of one output."""
    return model.actuator_gear[int(model.actuator_outadr[i]) if COUNT == "nactuator" else i]


def has_affine_force(model, i: int) -> bool:
    """Whether the force is that of the formula above."""
    gains = (FIXED_GAIN, AFFINE_GAIN) if control(model, i) else (int(model.actuator_gaintype[i]),)
    return int(model.actuator_biastype[i]) in (NO_BIAS, AFFINE) and int(model.actuator_gaintype[i]) in gains


def force_law(model, i: int) -> np.ndarray:
    """Force, and its derivatives by length and rate, (3,), under the control that there is."""
    bias = model.actuator_biasprm[i, :3] * (int(model.actuator_biastype[i]) == AFFINE)
    gain = model.actuator_gainprm[i, :3] * ([1, 1, 1] if int(model.actuator_gaintype[i]) == AFFINE_GAIN else [1, 0, 0])
    u = control(model, i)
    return bias + gain * u if u else bias


def controls(model) -> dict[str, int]:
    """Place in ``ctrl`` of each actuator of one control, by its name."""
    places = {i: int(model.actuator_ctrladr[i]) if COUNT == "nactuator" else i for i in actuators(model)}
    return {model.actuator(i).name or f"actuator {i}": k for i, k in places.items() if n_controls(model, i) == 1}
