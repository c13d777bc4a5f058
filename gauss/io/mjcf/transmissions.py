"""Transmissions of actuators of a MuJoCo model: the length that they act along, its rate, and on what.

MuJoCo's documentation, "Computation: Actuation model, Transmission": l is the gear times a coordinate or a tendon; a site,
and a ball or free joint, get a wrench along their axes.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from gauss.io.mjcf.actuators import gear
from gauss.io.mjcf.names import SCALAR, Named
from gauss.io.mjcf.tendons import Law, tendon_path, times
from gauss.rotations import from_quaternion
from gauss.scene import PAIRS, Force, Scene

KINDS = ("JOINT", "JOINTINPARENT", "TENDON", "SITE")
JOINT, JOINT_IN_PARENT, TENDON, SITE = (int(getattr(mujoco.mjtTrn, f"mjTRN_{name}")) for name in KINDS)


@dataclass(frozen=True)
class ActuatorTransmission:
    """Joints and bodies that an actuator acts on."""

    acts_on: dict[str, float]  # rates of joints, with the generalised force along each for a force of 1 of the actuator
    forces: tuple[Force, ...] = ()  # forces and moments on bodies for a force of 1
    # length, rate: laws (view of the mechanism) of its length and rate; None where its force may not depend on them
    length: Law | None = None
    rate: Law | None = None
    # least and largest force that what is acted on bears from all its actuators
    range: tuple[float, float] | None = field(default=None)

    def pull(self, scene: Scene, name: str, force: float | Law):
        """Loads of a force of the actuator, a number or a law (t, motion)."""
        for joint, factor in self.acts_on.items():
            called = f"{name} on {joint}" if len(self.acts_on) > 1 else name
            owner = joint if joint in scene.joints else joint.rpartition(".")[0]
            rates = scene.joints[owner].pair.rates
            along = np.array([factor * (joint in (owner, f"{owner}.{rate}")) for rate in rates])
            effort = float(factor * force) if len(rates) == 1 and not callable(force) else times(along, force)
            scene.drive(owner, name=called, torque=effort)
        for number, one in enumerate(self.forces):
            called = name if len(self.forces) == 1 else f"{name} on {one.body}, {number + 1}"
            parts = (times(part, force) for part in (one.force, one.moment))
            scene.force(called, one.body, *parts, at=one.at, axes=one.axes)


def transmission(named: Named, i: int) -> ActuatorTransmission | None:
    """Transmission of an actuator; None of a kind that is not read."""
    model, on, first = named.model, int(named.model.actuator_trntype[i]), int(named.model.actuator_trnid[i, 0])
    if on in (JOINT, JOINT_IN_PARENT):
        return _of_joint(named, i, first, on)
    if on == TENDON:
        return _of_tendon(named, i, first)
    return _of_site(named, i, first, int(model.actuator_trnid[i, 1])) if on == SITE else None


def _of_joint(named: Named, i: int, j: int, on: int) -> ActuatorTransmission | None:
    model, joint, kind = named.model, named.joints[j], named.kinds[j]
    ratios = gear(model, i)
    bounds = _bounds(model.jnt_actfrcrange[j]) if model.jnt_actfrclimited[j] else None
    if kind in SCALAR:
        ratio, at_rest = float(ratios[0]), float(model.qpos0[model.jnt_qposadr[j]])
        length = lambda at: ratio * (at.coordinate(joint) + at_rest)  # noqa: E731
        return ActuatorTransmission({joint: ratio}, (), length, lambda at: ratio * at.rate(joint), bounds)
    if on == JOINT_IN_PARENT:
        return None
    factors = np.array(ratios[:3])
    if kind == "free":  # ω is in the axes of the body there, in those of the world here
        Q_0 = model.qpos0[model.jnt_qposadr[j] + 3 :][:4]
        factors = np.concatenate([factors, from_quaternion(Q_0) @ ratios[3:]])
    rates = PAIRS[kind].rates
    found = {f"{joint}.{rate}": float(factor) for rate, factor in zip(rates, factors, strict=True) if factor}
    return ActuatorTransmission(found, range=bounds)


def _of_tendon(named: Named, i: int, number: int) -> ActuatorTransmission:
    model, path, ratio = named.model, tendon_path(named, number), float(gear(named.model, i)[0])
    bounds = _bounds(model.tendon_actfrcrange[number]) if model.tendon_actfrclimited[number] else None
    length, rate = (lambda at: ratio * path.length(at)), (lambda at: ratio * path.rate(at))
    if path.is_fixed:
        return ActuatorTransmission({joint: ratio * x for joint, x in path.terms.items()}, (), length, rate, bounds)
    forces = [
        Force(one.name, one.body, times(one.force, ratio), times(one.moment, ratio), at=one.at)
        for one in path.unit_forces("force")
    ]
    return ActuatorTransmission({}, tuple(forces), length, rate, bounds)


def _of_site(named: Named, i: int, site: int, other: int) -> ActuatorTransmission | None:
    """Force and moment at a site, along its axes, or along those of a site of the ground."""
    model = named.model
    if other >= 0 and model.site_bodyid[other] != 0:
        return None
    body, at = named.bodies[int(model.site_bodyid[site])], tuple(map(float, model.site_pos[site]))
    R = from_quaternion(model.site_quat[site if other < 0 else other])
    force, moment = (R @ part for part in np.split(gear(model, i), 2))
    axes = "body" if other < 0 else "world"

    def rate(view):
        turned = view.rotation(body).T if other < 0 else np.eye(3)
        return (turned @ view.velocity(body, at)) @ force + (turned @ view.angular_velocity(body)) @ moment

    one = Force("force", body, tuple(map(float, force)), tuple(map(float, moment)), at=at, axes=axes)
    return ActuatorTransmission({}, (one,), (lambda at: 0.0) if other < 0 else None, rate)


def _bounds(pair) -> tuple[float, float]:
    return float(pair[0]), float(pair[1])
