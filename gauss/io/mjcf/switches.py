"""Flags of a MuJoCo model that switch a part of its physics off: then it is read as if it held nothing of that part."""

import mujoco

CONTACTS = "geom_contype", "geom_conaffinity"
LIMITS = "jnt_limited", "tendon_limited"
EQUALITIES = ("eq_active0",)
FRICTION = "dof_frictionloss", "tendon_frictionloss"
ABSENT = {  # fields of the model that are all zero under a flag
    "CONSTRAINT": (*EQUALITIES, *FRICTION, *LIMITS, *CONTACTS),
    "EQUALITY": EQUALITIES,
    "FRICTIONLOSS": FRICTION,
    "LIMIT": LIMITS,
    "CONTACT": CONTACTS,
    "SPRING": ("jnt_stiffness", "jnt_stiffnesspoly", "jnt_springyield")
    + ("tendon_stiffness", "tendon_stiffnesspoly", "tendon_springyield"),
    "DAMPER": ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly"),
}


def is_off(model, switch: str) -> bool:
    """Whether a flag is set to "disable"; a switch is named like MuJoCo's mjDSBL_ without that."""
    return bool(model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{switch}")))


def without_what_is_off(model):
    """Empty the fields of a model that its flags make ineffective, and return it."""
    for switch, fields in ABSENT.items():
        if is_off(model, switch):
            for field in fields:
                getattr(model, field)[:] = 0
    if is_off(model, "SPRING") and is_off(model, "DAMPER"):  # then MuJoCo computes no passive force at all
        model.opt.density = model.opt.viscosity = 0.0
        model.body_gravcomp[:] = 0.0
    if is_off(model, "GRAVITY"):
        model.opt.gravity[:] = 0.0
    return model
