"""Elements of a MuJoCo model that gauss does not model, each by name, with file and line."""

from collections.abc import Iterator

import mujoco
import numpy as np

from gauss.errors import listed
from gauss.io.mjcf.actuators import (
    acts_early,
    actuators,
    adheres,
    bias_of,
    gain_of,
    has_known_force,
    has_known_state,
    is_muscle,
    is_switched_off,
    n_controls,
)
from gauss.io.mjcf.names import BODY, COUNTS, SCALAR, SITE, Named
from gauss.io.mjcf.start import START, key_of
from gauss.io.mjcf.switches import is_off
from gauss.io.mjcf.tendons import tendon_path
from gauss.io.mjcf.transmissions import JOINT as ON_JOINT
from gauss.io.mjcf.transmissions import JOINT_IN_PARENT, ActuatorTransmission, transmission

EQUALITIES = ("CONNECT", "WELD", "JOINT", "TENDON")
CONNECT, WELD, JOINT, TENDON = (int(getattr(mujoco.mjtEq, f"mjEQ_{name}")) for name in EQUALITIES)
CURVES = {  # what may depend on deflections and speeds by a polynomial, and of what that is
    "jnt_stiffnesspoly": ("stiffness", "joint"),
    "jnt_springyield": ("yielding spring", "joint"),
    "tendon_stiffnesspoly": ("stiffness", "tendon"),
    "tendon_dampingpoly": ("damping", "tendon"),
    "tendon_springyield": ("yielding spring", "tendon"),
    "actuator_dampingpoly": ("damping", "actuator"),
    "actuator_damping": ("damping", "actuator"),
    "actuator_armature": ("armature", "actuator"),
}
Finding = tuple[str, str, int]  # what is refused, kind and number of the element that has it
WELD_TOLERANCE = 1e-9  # rad, and of the extent of the model: poses of a weld that are those of the file


def refused(named: Named, contacts: bool = False) -> list[str]:
    """Everything that moves the mechanism and has no counterpart."""
    model, found = named.model, []
    found += [f"flexible body {i}" for i in range(model.nflex)]
    found += _compensated(named)
    parts = [*_of_joints(named), *_curved(named), *_without_counterpart(named, contacts)]
    return found + [f"{text}{named.where(kind, i)}" for text, kind, i in parts]


def _compensated(named: Named) -> list[str]:
    """Gravity compensation that MuJoCo counts to the actuators of a joint, and then does not apply, or not in full."""
    model = named.model
    counted = np.flatnonzero(model.jnt_actgravcomp) if model.body_gravcomp.any() else np.zeros(0, dtype=int)
    silent = not len(actuators(model)) or is_off(model, "ACTUATION")
    lost = [named.joints[j] for j in counted.tolist() if silent or model.jnt_actfrclimited[j]]
    return [f"gravity compensation that counts to the actuators (actuatorgravcomp) of joint {name!r}" for name in lost]


def _of_joints(named: Named) -> Iterator[Finding]:
    for i in range(named.model.njnt):
        for what in _of_joint(named, i):
            yield f"{what} of {named.kinds[i]} joint {named.joints[i]!r}", "joint", i


def _curved(named: Named) -> Iterator[Finding]:
    """Springs, dampers and masses that are no constants."""
    model = named.model
    for field, (what, kind) in CURVES.items():
        for i in range(getattr(model, COUNTS[kind])):
            if np.any(getattr(model, field)[i]):
                yield f"{what} of {kind} {named.name(kind, i)!r} beyond a constant one", kind, i
    for i in range(model.njnt):
        if model.dof_dampingpoly[model.jnt_dofadr[i]].any():
            yield f"damping of joint {named.joints[i]!r} beyond a constant one", "joint", i


def _without_counterpart(named: Named, contacts: bool) -> Iterator[Finding]:
    model = named.model
    for kind, count, against in (
        ("equality", model.neq, _against_equality),
        ("actuator", len(actuators(model)), _against_actuator),
    ):
        for i in range(count):
            why = against(named, i)
            if why and not (kind == "actuator" and not contacts and adheres(model, i)):
                yield f"{kind} {named.name(kind, i)!r}: {why}", kind, i


def left_out(named: Named, stops: bool = False, contacts: bool = False, keyframe: str | int | None = None) -> list[str]:
    """Elements that are not read, for they act only where contacts, stops, a keyframe or controls are asked for."""
    parts = _untouched(named, contacts) + _unlimited(named, stops) + _inactive(named, keyframe) + _uncontrolled(named)
    return [f"{what} {listed(names)}" for what, names in parts if names]


def _untouched(named: Named, contacts: bool) -> list[tuple[str, list[str]]]:
    """Contacts, and what is on surfaces."""
    model = named.model
    if contacts:
        return [("surface velocity and adhesion of geoms", _sticky(named))]
    touching = [named.name("geom", i) for i in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist()]
    return [("contacts of geoms", touching), ("contacts of pairs", [named.name("pair", i) for i in range(model.npair)])]


def _unlimited(named: Named, stops: bool) -> list[tuple[str, list[str]]]:
    """Limits of joints and tendons."""
    model = named.model
    limited = np.flatnonzero(model.jnt_limited).tolist()
    if stops:
        return [("limits of ball joints", [named.joints[i] for i in limited if named.kinds[i] not in SCALAR])]
    tied = [named.name("tendon", i) for i in np.flatnonzero(model.tendon_limited).tolist() if tendon_path(named, i).is_fixed]
    joints = [named.joints[i] for i in limited]
    return [("limits, kept for the assembly of a start only, of joints", joints), ("limits of tendons", tied)]


def _inactive(named: Named, keyframe: str | int | None) -> list[tuple[str, list[str]]]:
    """Elements that are switched off, stand still, or name other states."""
    model = named.model
    inactive = [named.name("equality", i) for i in range(model.neq) if not model.eq_active0[i]]
    standing = [named.bodies[i] for i in np.flatnonzero(model.body_mocapid >= 0).tolist()]
    keys = [named.name("key", i) for i in range(model.nkey) if i != key_of(named, keyframe)]
    return [
        ("equalities that are not active:", inactive),
        ("what moves mocap bodies, which stand still:", standing),
        (f"key frames (one called {START!r}, or that keyframe= names, would be the start):", keys),
    ]


def _uncontrolled(named: Named) -> list[tuple[str, list[str]]]:
    """Actuators without effect, or without a control."""
    model = named.model
    name = lambda i: named.name("actuator", i)  # noqa: E731
    acting = [i for i in actuators(model) if not is_switched_off(model, i)]
    return [
        ("actuators that are switched off:", [name(i) for i in actuators(model) if is_switched_off(model, i)]),
        ("adhesion, which needs contacts, of actuators", [name(i) for i in acting if adheres(model, i)]),
        (
            "the step by which activations act early (actearly), of actuators",
            [name(i) for i in acting if acts_early(model, i)],
        ),
    ]


def _sticky(named: Named) -> list[str]:
    """Geoms with a surface velocity or adhesion, fields of MuJoCo from version 4 on."""
    fields = [getattr(named.model, field, None) for field in ("geom_surfacevel", "geom_adhesion")]
    return [named.name("geom", i) for i in range(named.model.ngeom) if any(f is not None and np.any(f[i]) for f in fields)]


def _of_joint(named: Named, i: int) -> list[str]:
    """Properties of a ball or free joint that only a hinge or slide may have."""
    model, dof, body = named.model, named.model.jnt_dofadr[i], int(named.model.jnt_bodyid[i])
    if named.kinds[i] != "free":
        return []
    turned = bool(np.any(model.body_quat[body, 1:]))
    return ["frictionloss, in axes that are not those of the world,"] if model.dof_frictionloss[dof] and turned else []


def _against_equality(named: Named, i: int) -> str:
    """Why an equality has no counterpart; empty if it has one."""
    model = named.model
    kind, ends = int(model.eq_type[i]), (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]))
    if kind == JOINT:
        scalar = all(named.kinds[j] in SCALAR for j in ends if j >= 0)
        return "" if scalar else "a joint has several freedoms"
    if kind not in (CONNECT, WELD, TENDON):
        return "only connect, weld, joint and tendon are read"
    if kind != TENDON and int(model.eq_objtype[i]) not in (BODY, SITE):
        return "it binds neither bodies nor sites"
    return ""


def is_closed(named: Named, i: int) -> bool:
    """Whether a weld holds what the file shows."""
    data = mujoco.MjData(named.model)
    mujoco.mj_kinematics(named.model, data)
    mujoco.mj_comPos(named.model, data)
    mujoco.mj_makeConstraint(named.model, data)
    rows = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & (data.efc_id == i)
    off = data.efc_pos[rows].copy()
    off[:3] /= named.model.stat.extent
    return bool(abs(off).max(initial=0.0) < WELD_TOLERANCE)


def _against_actuator(named: Named, i: int) -> str:
    """Why an actuator has no counterpart; empty if it has one."""
    model, acted = named.model, transmission(named, i)
    if acted is None:
        return "only actuators of joints, of tendons, and of sites beside none or one of the ground are read"
    if n_controls(model, i) > 1:
        return "it has several controls"
    if np.any(getattr(model, "actuator_delay", np.zeros(i + 1))[i]):
        return "its control is delayed"
    if not has_known_force(model, i):
        return "its force is neither affine nor that of a muscle"
    if not has_known_state(model, i):
        return "its activation is no integral, filter or muscle's"
    return _against_force(named, i, acted)


def _against_force(named: Named, i: int, acted: ActuatorTransmission) -> str:
    """Why the force of an actuator on an element has no counterpart."""
    model, numbers = named.model, np.abs(gain_of(named.model, i)) + np.abs(bias_of(named.model, i))
    if is_muscle(model, i):
        numbers = np.ones(3)
    if (numbers[1] and acted.length is None) or (numbers[2] and acted.rate is None):
        return "its force depends on the motion of what has several freedoms, or of a site beside another"
    on_joint = int(model.actuator_trntype[i]) in (ON_JOINT, JOINT_IN_PARENT)
    if not on_joint and _reaches_limited(named, acted):
        return "a joint that it moves limits the sum of its forces (actuatorfrcrange); act on that joint alone"
    return "" if acted.range is None else _against_range(named, i, acted, on_joint)


def _against_range(named: Named, i: int, acted: ActuatorTransmission, on_joint: bool) -> str:
    """Why the range of the force that a joint or tendon bears has no counterpart."""
    model = named.model
    if on_joint and model.jnt_actgravcomp[int(model.actuator_trnid[i, 0])]:
        return "what it pulls limits its force, and gravity compensation with it (actuatorgravcomp)"
    if on_joint and len(acted.acts_on) != 1:
        return "what it pulls limits its force (actuatorfrcrange); limit the force of the actuator"
    ends = [(int(model.actuator_trntype[k]), int(model.actuator_trnid[k, 0])) for k in actuators(model)]
    if ends.count(ends[i]) > 1:
        return "what it pulls limits the sum of its actuators (actuatorfrcrange); limit each actuator"
    return ""


def _reaches_limited(named: Named, acted: ActuatorTransmission) -> bool:
    """Whether an actuator of a tendon or site moves a joint that limits the force of all its actuators."""
    limited = [named.joints[j] for j in np.flatnonzero(named.model.jnt_actfrclimited).tolist()]
    return bool(limited) and (bool(acted.forces) or bool(set(limited) & acted.acts_on.keys()))
