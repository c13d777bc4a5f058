"""Actuators of a MuJoCo model as inputs of a scene, and as loads of the force that they have without control.

    F(u, l, l̇) = clip((g₀ + g₁ l + g₂ l̇) u + b₀ + b₁ l + b₂ l̇, F_min, F_max)

The load is F(u₀), u₀ the control that is given when nobody gives any; the input adds F(u) − F(u₀). Where an activation acts,
the load is F(a), the activation a is a state of the scene, and the input acts on its rate. Muscles have curves for g and b.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.io.mjcf.activations import MUSCLE_BIAS, MUSCLE_GAIN, MuscleCurves, activation, muscle_curves
from gauss.io.mjcf.actuators import bias_of, control, control_range, gain_of, has_state, state_name
from gauss.io.mjcf.names import SCALAR, Named
from gauss.io.mjcf.transmissions import JOINT, JOINT_IN_PARENT, ActuatorTransmission, transmission
from gauss.scene import Scene


@dataclass(frozen=True)
class ActuatorForce:
    """Force of one actuator: number, or law, of its control."""

    acted: ActuatorTransmission  # what it acts on
    gain: np.ndarray  # gain, bias (3,): numbers g and b
    bias: np.ndarray
    control: float  # control that is given when nobody gives any
    ranges: tuple[tuple[float, float], ...]  # least and largest force, of each that limits it
    active: MuscleCurves | None = None  # active, passive: of a muscle, in place of the numbers g and b
    passive: MuscleCurves | None = None

    @property
    def follows(self) -> bool:
        """Whether it depends on the motion under its default control."""
        return bool(self.passive or (self.active and self.control) or (self.gain * self.control + self.bias)[1:].any())

    @property
    def depends_on_control(self) -> bool:
        """Whether a control, or an activation, changes it."""
        return bool(self.active or self.gain.any())

    def of(self, u, motion):
        """Force for a control, by a view of the mechanism; without a view for a force that does not depend on it."""
        length, rate = (0.0, 0.0) if motion is None else (self._length(motion), self._rate(motion))
        g, b = self.gain, self.bias
        gain = g[0] + (g[1] * length + g[2] * rate if g[1:].any() else 0.0)
        bias = b[0] + (b[1] * length + b[2] * rate if b[1:].any() else 0.0)
        gain = gain if self.active is None else self.active.gain(length, rate)
        force = gain * u + (bias if self.passive is None else self.passive.bias(length))
        for low, high in self.ranges:
            force = math.clip(force, low, high)
        return force

    def _length(self, motion):
        depends = self.gain[1] or self.bias[1] or self.active or self.passive
        return self.acted.length(motion) if depends and self.acted.length is not None else 0.0

    def _rate(self, motion):
        depends = self.gain[2] or self.bias[2] or self.active
        return self.acted.rate(motion) if depends and self.acted.rate is not None else 0.0


def actuator_force(named: Named, i: int) -> ActuatorForce:
    """Force of the actuator of a number."""
    model, acted = named.model, transmission(named, i)
    assert acted is not None  # see what is refused
    ranges = [tuple(map(float, model.actuator_forcerange[i]))] if model.actuator_forcelimited[i] else []
    if acted.range is not None:
        on_joint = int(model.actuator_trntype[i]) in (JOINT, JOINT_IN_PARENT)  # limited beyond the gear
        scale = next(iter(acted.acts_on.values())) if on_joint else 1.0
        ranges.append(tuple(sorted(end / scale for end in acted.range)) if scale else (0.0, 0.0))
    active = int(model.actuator_gaintype[i]) == MUSCLE_GAIN
    passive = int(model.actuator_biastype[i]) == MUSCLE_BIAS
    return ActuatorForce(
        acted,
        np.array(gain_of(model, i)),
        np.array(bias_of(model, i)),
        control(model, i),
        tuple((low, high) for low, high in ranges),
        muscle_curves(model, i, model.actuator_gainprm[i]) if active else None,
        muscle_curves(model, i, model.actuator_biasprm[i]) if passive else None,
    )


def add_actuator(scene: Scene, named: Named, i: int):
    """Input of one actuator, and its force without control."""
    model, name, force = named.model, named.name("actuator", i), actuator_force(named, i)
    name = f"actuator {name}" if name in scene.loads or name in scene.relations or name in scene.contacts else name
    if not (force.acted.acts_on or force.acted.forces):  # a tendon within one body moves nothing
        return
    if has_state(model, i):
        _add_activation(scene, named, i, name, force)
        return
    _add_load(scene, named, i, name, force)
    if not force.depends_on_control:
        return
    acts_on, forces, effort = force.acted.acts_on, force.acted.forces, _effort(force)
    if effort is None:
        acts_on = {joint: factor * float(force.gain[0]) for joint, factor in acts_on.items()}
    joint = next(iter(acts_on)) if list(acts_on.values()) == [1.0] else acts_on
    scene.input(name, joint, control_range(model, i), effort, forces)


def _add_activation(scene: Scene, named: Named, i: int, name: str, force: ActuatorForce):
    """State of an actuator, the force that it has by it, and the input that changes its rate."""
    law, state, u_0 = activation(named.model, i), state_name(named.model, i), force.control
    scene.state(state, lambda t, motion: law.rate(u_0, motion.rate(state)))
    force.acted.pull(scene, f"force of {name}", lambda t, motion: force.of(law.bounded(motion.rate(state)), motion))
    scene.input(
        name,
        {state: 1.0},
        control_range(named.model, i),
        lambda u, t, motion: law.rate(u, motion.rate(state)) - law.rate(u_0, motion.rate(state)),
    )


def _effort(force: ActuatorForce) -> Callable | None:
    """Law of the effort that a control adds to the force without control; None where it is proportional, along joints."""
    u_0, gain = force.control, float(force.gain[0])
    if force.ranges or force.active or force.gain[1:].any() or u_0:
        return lambda u, t, motion: force.of(u, motion) - force.of(u_0, motion)
    return (lambda u, t, motion: gain * u) if force.acted.forces and gain != 1.0 else None


def _add_load(scene: Scene, named: Named, i: int, name: str, force: ActuatorForce):
    """Force without control: a constant, a spring and damper of a joint, or a law."""
    acted, u_0 = force.acted, force.control
    if not force.follows:
        constant = float(force.of(u_0, None))
        if constant:
            acted.pull(scene, f"bias of {name}", constant)
        return
    first, on = int(named.model.actuator_trnid[i, 0]), int(named.model.actuator_trntype[i])
    plain = not (force.ranges or force.active or force.passive)
    if not plain or on not in (JOINT, JOINT_IN_PARENT) or named.kinds[first] not in SCALAR:
        acted.pull(scene, f"bias of {name}", lambda t, motion: force.of(u_0, motion))
        return
    (joint, ratio), b = next(iter(acted.acts_on.items())), force.gain * u_0 + force.bias
    if ratio * b[0]:
        acted.pull(scene, f"bias of {name}", float(b[0]))
    at_rest = float(named.model.qpos0[named.model.jnt_qposadr[first]])
    feedback = {"stiffness": -float(ratio**2 * b[1]), "damping": -float(ratio**2 * b[2]), "rest": -at_rest}
    scene.joint_spring(f"feedback of {name}", joint, **feedback)
