"""Actuators of a MuJoCo model: the numbers of their force, which of them act, and their controls.

Force = (g₀ + g₁ l + g₂ l̇) u + b₀ + b₁ l + b₂ l̇ of the length l of what is pulled, for a control u, or an activation that
follows one; MuJoCo's documentation, "Computation: Actuation model". Muscles have curves for both. Where nobody gives u, it
is 0, clamped to its range as MuJoCo clamps it.
"""

import mujoco
import numpy as np

from gauss.io.mjcf.activations import KNOWN_TYPES, MUSCLE_BIAS, MUSCLE_GAIN
from gauss.io.mjcf.switches import is_off

COUNT = (
    "nactuator" if hasattr(mujoco.MjModel, "nactuator") else "nu"
)  # from MuJoCo 4 on an actuator has any number of controls
NO_BIAS, AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
FIXED_GAIN, AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
STATELESS = int(mujoco.mjtDyn.mjDYN_NONE)
GROUPS = range(31)  # of actuators, which can be switched off


def actuators(model) -> range:
    """Numbers of all actuators."""
    return range(getattr(model, COUNT))


def is_switched_off(model, i: int) -> bool:
    """Whether all actuators, or the group of one, are disabled: then it does not pull."""
    if is_off(model, "ACTUATION"):
        return True
    group = int(model.actuator_group[i])
    return group in GROUPS and bool(int(model.opt.disableactuator) >> group & 1)


def adheres(model, i: int) -> bool:
    """Whether it presses a body against those that it touches: without contacts it does nothing."""
    return int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_BODY)


def n_controls(model, i: int) -> int:
    """How many controls an actuator has."""
    return int(model.actuator_ctrlnum[i]) if COUNT == "nactuator" else 1


def control(model, i: int) -> float:
    """Default value of the control of an actuator: 0, or the nearest end of its range."""
    if n_controls(model, i) != 1 or is_off(model, "CLAMPCTRL"):
        return 0.0
    place = control_place(model, i)
    return float(np.clip(0.0, *model.actuator_ctrlrange[place])) if model.actuator_ctrllimited[place] else 0.0


def gear(model, i: int) -> np.ndarray:
    """Gear (6,) of an actuator of one output."""
    return model.actuator_gear[int(model.actuator_outadr[i]) if COUNT == "nactuator" else i]


def control_range(model, i: int) -> tuple[float, float] | None:
    """Least and largest control; None where it is not clamped."""
    place = control_place(model, i)
    if is_off(model, "CLAMPCTRL") or n_controls(model, i) != 1 or not model.actuator_ctrllimited[place]:
        return None
    low, high = map(float, model.actuator_ctrlrange[place])
    return low, high


def has_known_force(model, i: int) -> bool:
    """Whether the force is that of the formula above, or of a muscle."""
    gains = (FIXED_GAIN, AFFINE_GAIN, MUSCLE_GAIN)
    return int(model.actuator_biastype[i]) in (NO_BIAS, AFFINE, MUSCLE_BIAS) and int(model.actuator_gaintype[i]) in gains


def is_muscle(model, i: int) -> bool:
    """Whether curves of a muscle make its force."""
    return int(model.actuator_gaintype[i]) == MUSCLE_GAIN or int(model.actuator_biastype[i]) == MUSCLE_BIAS


def has_state(model, i: int) -> bool:
    """Whether it acts by an activation, which follows its control by a differential equation."""
    return int(model.actuator_dyntype[i]) != STATELESS


def acts_early(model, i: int) -> bool:
    """Whether the activation after a step of MuJoCo acts, not that before it."""
    return has_state(model, i) and bool(model.actuator_actearly[i])


def has_known_state(model, i: int) -> bool:
    """Whether it has no activation, or one whose law is known."""
    return not has_state(model, i) or (int(model.actuator_dyntype[i]) in KNOWN_TYPES and int(model.actuator_actnum[i]) == 1)


def state_name(model, i: int) -> str:
    """Name of the state that is the activation of an actuator."""
    return f"{model.actuator(i).name or f'actuator {i}'} activation"


def bias_of(model, i: int) -> np.ndarray:
    """Numbers b of the formula (3,)."""
    return model.actuator_biasprm[i, :3] * float(int(model.actuator_biastype[i]) == AFFINE)


def gain_of(model, i: int) -> np.ndarray:
    """Numbers g of the formula (3,)."""
    affine = float(int(model.actuator_gaintype[i]) == AFFINE_GAIN)
    constant = float(int(model.actuator_gaintype[i]) != MUSCLE_GAIN)
    return model.actuator_gainprm[i, :3] * [constant, affine, affine]


def control_place(model, i: int) -> int:
    """Place of the control of an actuator in ``ctrl``."""
    return int(model.actuator_ctrladr[i]) if COUNT == "nactuator" else i


def controls(model) -> dict[str, int]:
    """Place in ``ctrl`` of each actuator of one control, by its name."""
    single = [i for i in actuators(model) if n_controls(model, i) == 1]
    return {model.actuator(i).name or f"actuator {i}": control_place(model, i) for i in single}
