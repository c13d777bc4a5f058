"""What a MuJoCo model holds that gauss does not model, each by name, with file and line."""

from collections.abc import Iterator

import mujoco
import numpy as np

from gauss.io.mjcf.actuators import actuators, force_law, has_affine_force, is_switched_off, n_controls
from gauss.io.mjcf.names import BODY, COUNTS, SCALAR, SITE, Named
from gauss.io.mjcf.start import START, key_of
from gauss.io.mjcf.switches import is_off
from gauss.io.mjcf.tendons import CROSSING, FIXED, OTHER, kind_of, span

EQUALITIES = ("CONNECT", "WELD", "JOINT", "TENDON")
CONNECT, WELD, JOINT, TENDON = (int(getattr(mujoco.mjtEq, f"mjEQ_{name}")) for name in EQUALITIES)
TRANSMISSION = {name: int(getattr(mujoco.mjtTrn, f"mjTRN_{name}")) for name in ("JOINT", "TENDON", "SITE")}
STATELESS = int(mujoco.mjtDyn.mjDYN_NONE)
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


def refused(named: Named) -> list[str]:
    """Everything that moves the mechanism and has no counterpart."""
    model, found = named.model, []
    if model.opt.density or model.opt.viscosity:
        found.append(f"a medium (option density, viscosity){named.mark('option', 'density') or named.mark('option')}")
    if is_off(model, "ACTUATION"):
        found.append(f"flag actuation that is switched off{named.mark('flag', 'actuation')}")
    found += [f"flexible body {i}" for i in range(model.nflex)]
    parts = [(f"gravcomp of body {named.bodies[i]!r}", "body", i) for i in np.flatnonzero(model.body_gravcomp).tolist()]
    parts += [*_of_joints(named), *_curved(named), *_without_counterpart(named)]
    return found + [f"{text}{named.where(kind, i)}" for text, kind, i in parts]


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


def _without_counterpart(named: Named) -> Iterator[Finding]:
    model = named.model
    for kind, count, against in (
        ("tendon", model.ntendon, _against_tendon),
        ("equality", model.neq, _against_equality),
        ("actuator", len(actuators(model)), _against_actuator),
    ):
        for i in range(count):
            why = against(named, i)
            if why:
                yield f"{kind} {named.name(kind, i)!r}: {why}", kind, i


def left_out(named: Named, stops: bool = False, contacts: bool = False, keyframe: str | int | None = None) -> list[str]:
    """Everything that does not move the mechanism by itself, or not yet, and is not read, unless it is asked for."""
    model, kept = named.model, _inactive(named, keyframe)
    touching = [named.name("geom", i) for i in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist()]
    limited = [named.joints[i] for i in np.flatnonzero(model.jnt_limited).tolist()]
    pairs = [named.name("pair", i) for i in range(model.npair)]
    parts = [] if contacts else [("contacts of geoms", touching), ("contacts of pairs", pairs)]
    parts += [("surface velocity and adhesion of geoms", _sticky(named))] if contacts else []
    parts += [] if stops else [("limits, kept for the assembly of a start only, of joints", limited)]
    return [f"{what} {', '.join(names[:8])}{', …' if len(names) > 8 else ''}" for what, names in parts + kept if names]


def _inactive(named: Named, keyframe: str | int | None) -> list[tuple[str, list[str]]]:
    """Elements that are switched off, stand still, or name other states."""
    model = named.model
    inactive = [named.name("equality", i) for i in range(model.neq) if not model.eq_active0[i]]
    off = [named.name("actuator", i) for i in actuators(model) if is_switched_off(model, i)]
    standing = [named.bodies[i] for i in np.flatnonzero(model.body_mocapid >= 0).tolist()]
    keys = [named.name("key", i) for i in range(model.nkey) if i != key_of(named, keyframe)]
    return [
        ("equalities that are not active:", inactive),
        ("actuators of groups that are switched off:", off),
        ("what moves mocap bodies, which stand still:", standing),
        (f"key frames (one called {START!r}, or that keyframe= names, would be the start):", keys),
    ]


def _sticky(named: Named) -> list[str]:
    """Geoms whose surface moves or adheres, which MuJoCo has from version 4 on."""
    fields = [getattr(named.model, field, None) for field in ("geom_surfacevel", "geom_adhesion")]
    return [named.name("geom", i) for i in range(named.model.ngeom) if any(f is not None and np.any(f[i]) for f in fields)]


def _of_joint(named: Named, i: int) -> list[str]:
    """What a ball or free joint has that only a hinge or slide may have."""
    model, dof = named.model, named.model.jnt_dofadr[i]
    if named.kinds[i] in SCALAR:
        return []
    having = ("dof_damping", "dof_armature", "dof_frictionloss")
    found = [what.removeprefix("dof_") for what in having if getattr(model, what)[dof]]
    found += ["stiffness"] if model.jnt_stiffness[i] else []
    return found + (["limits"] if model.jnt_limited[i] else [])


def _against_tendon(named: Named, i: int) -> str:
    """Why a tendon has no counterpart; empty if it has one."""
    model, kind = named.model, kind_of(named.model, i)
    if kind == OTHER:
        return "it is led over more than two sites, pulleys or geoms"
    if kind == CROSSING:
        return "it joins points of one body"
    for what in ("frictionloss", "armature"):
        if getattr(model, f"tendon_{what}")[i]:
            return f"its {what} is not modelled"
    if model.tendon_stiffness[i] and np.ptp(model.tendon_lengthspring[i]) > 0:
        return "its spring is slack in a range of lengths"
    if model.tendon_limited[i] and kind == FIXED:
        return "its length is limited; limit its joints"
    return "its length has a lower limit" if model.tendon_limited[i] and model.tendon_range[i, 0] > 0 else ""


def _against_equality(named: Named, i: int) -> str:
    """Why an equality has no counterpart; empty if it has one."""
    model = named.model
    kind, data, ends = int(model.eq_type[i]), model.eq_data[i], (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]))
    if kind == JOINT:
        scalar = all(named.kinds[j] in SCALAR for j in ends if j >= 0)
        return "" if scalar else "a joint has several freedoms"
    if kind == TENDON:
        return _against_tendons(model, ends, data)
    if kind not in (CONNECT, WELD):
        return "only connect, weld, joint and tendon are read"
    if int(model.eq_objtype[i]) not in (BODY, SITE):
        return "it binds neither bodies nor sites"
    return "" if kind == CONNECT or _is_closed(named, i) else "the welded pose is not that of the file"


def _against_tendons(model, ends: tuple[int, int], data) -> str:
    """Why an equality of tendons has no counterpart."""
    kinds = [kind_of(model, j) for j in ends if j >= 0]
    if all(kind == FIXED for kind in kinds) and not data[2:5].any():
        return ""
    return "" if len(kinds) == 1 and span(model, ends[0]) is not None else "it couples tendons other than straight lines"


def _is_closed(named: Named, i: int) -> bool:
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
    model, on, first = named.model, int(named.model.actuator_trntype[i]), int(named.model.actuator_trnid[i, 0])
    if on not in TRANSMISSION.values() or (on == TRANSMISSION["JOINT"] and named.kinds[first] not in SCALAR):
        return "only actuators of hinges, slides, tendons and sites are read"
    if on == TRANSMISSION["TENDON"] and kind_of(model, first) != FIXED:
        return "it pulls a tendon other than a fixed one"
    return _against_force(named, i, on, first)


def _against_force(named: Named, i: int, on: int, first: int) -> str:
    """Why the force of an actuator on an element has no counterpart."""
    model = named.model
    if int(model.actuator_dyntype[i]) != STATELESS:
        return "it has states of its own"
    if n_controls(model, i) > 1:
        return "it has several controls"
    if not has_affine_force(model, i):
        return "its force is not affine"
    law = force_law(model, i)
    if on == TRANSMISSION["SITE"] and law[1:].any():
        return "its force at a site depends on the motion"
    return _against_limits(named, i, on, first, law) if law.any() else ""


def _against_limits(named: Named, i: int, on: int, first: int, law: np.ndarray) -> str:
    """Why the limits of the force of an actuator, or its reference, have no counterpart."""
    model = named.model
    limited = model.jnt_actfrclimited if on == TRANSMISSION["JOINT"] else model.tendon_actfrclimited
    if on != TRANSMISSION["SITE"] and limited[first]:
        return "what it pulls limits its force (actuatorfrcrange)"
    if model.actuator_forcelimited[i] and law[1:].any():
        if on != TRANSMISSION["JOINT"] or model.actuator_forcerange[i].sum():
            return "its force is limited, and not to the same value both ways along one joint"
    other = int(model.actuator_trnid[i, 1])
    if on == TRANSMISSION["SITE"] and other >= 0 and model.site_bodyid[other] != 0:
        return "it refers to a site of a moving body"
    return ""
