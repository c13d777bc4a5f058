"""Loads on the links of a motion: wrenches and power."""

from collections.abc import Callable

import numpy as np

from gauss import math
from gauss.codegen import Expression
from gauss.errors import LinkageError
from gauss.linkages.elements import Here, Load
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.placed import Complex, Real, Wrench
from gauss.linkages.plane import angle, dot, pair, rounded


def centre(motion: LinkageKinematics, link) -> Complex:
    """Centre of mass of a link in world [m]."""
    return motion.links[link.name].point(complex(*link.com))


def given(load: Load, motion: LinkageKinematics) -> Wrench:
    """Nominal wrench of a load, at its point of application."""
    moving = motion.links[load.link]
    link = next(link for link in motion.chain.links if link.name == load.link)
    x = moving.point(complex(*(link.com if load.at is None else load.at)))
    force = complex(*load.force)
    return Wrench(x, force * moving.e if load.axes == "link" else force, load.moment)


def acting(load: Load, motion: LinkageKinematics) -> Wrench:
    """Wrench of a load, at its point of application.

    LinkageError if a law returns something else than three numbers for each crank angle.
    """
    moving = motion.links[load.link]
    x, force, moment = wrench = given(load, motion)
    if load.resisting:
        sense = -math.sign(rounded(power(motion, wrench, load.link)))
        force, moment = pair(force.real * sense, force.imag * sense), moment * sense
    if load.viscous:
        moment = moment - load.viscous * moving.omega
    if load.law is not None:
        fx, fy, m = _law(load, load.law, _here(motion, moving, x))
        force, moment = force + pair(fx, fy), moment + m
    return Wrench(x, force, moment)


def _here(motion: LinkageKinematics, moving, x) -> Here:
    crank_angle, e, omega = (rounded(part) for part in (motion.crank_angle, moving.e, moving.omega))
    return Here(crank_angle, motion.crank_speed, angle(e), omega, rounded(x), rounded(moving.velocity(x)))


def _law(load: Load, law: Callable, here: Here):
    try:
        fx, fy, m = law(here)
        if isinstance(here.angle, Expression):
            return fx, fy, m
        fx, fy, m = (np.asarray(part, dtype=float) for part in (fx, fy, m))
        np.broadcast_shapes(fx.shape, fy.shape, m.shape, np.shape(here.angle))
    except (TypeError, ValueError) as error:
        raise LinkageError(
            f"load on link {load.link!r}: its law must return Fx, Fy, M, numbers or one for each crank angle, written with "
            f"gauss.math where it is to be compiled: {error}."
        ) from None
    if not all(np.isfinite(part).all() for part in (fx, fy, m)):
        raise LinkageError(f"load on link {load.link!r}: its law returned something that is not finite.")
    return fx, fy, m


def power(motion: LinkageKinematics, wrench: Wrench, link: str) -> Real:
    """Power of a force and moment on a link [W]."""
    moving = motion.links[link]
    return dot(wrench.force, moving.velocity(wrench.x)) + wrench.moment * moving.omega


def load_power(motion: LinkageKinematics) -> Real:
    """Power of all loads, gravity not among them [W]."""
    return sum((power(motion, acting(load, motion), load.link) for load in motion.chain.loads), 0.0 * motion.crank_speed)
