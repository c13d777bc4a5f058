"""Shaking force and moment of a linkage, and their balance by counterweights (Berkof and Lowen 1969) and counter-rotors."""

from dataclasses import dataclass, replace
from numbers import Real
from typing import NamedTuple

import numpy as np

from gauss.errors import LinkageError
from gauss.linkages.chain import Chain, full_turn
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.cycles import cycle
from gauss.linkages.elements import PlanarLink
from gauss.linkages.loads import centre
from gauss.linkages.plane import cross
from gauss.scene import GROUND

ANGLES = 360  # crank angles at which a balance is fitted


class Shaking(NamedTuple):
    """Inertia forces of all links on the frame.

    Attributes
    ----------
    force : ndarray, shape (k, 2)
        F_s = −Σ m G̈ [N].
    moment : ndarray, shape (k,)
        −Σ [J α + (G − A) × m G̈] about the crank's pivot A [N m].
    """

    force: np.ndarray
    moment: np.ndarray


def shaking(found: Cycle) -> Shaking:
    """Shaking force and moment of a cycle.

    Parameters
    ----------
    found : Cycle
        The cycle.

    Returns
    -------
    Shaking
        Force (k, 2) [N] and moment (k,) [N m] on the ground.
    """
    force, moment = _shaking(found)
    return Shaking(np.stack([force.real, force.imag], axis=1), moment)


def _shaking(found: Cycle):
    chain = found.chain
    A = chain.pivot.point(GROUND)
    force, moment = np.zeros(len(found), dtype=complex), np.zeros(len(found))
    for link in chain.links:
        G, moving = centre(found.motion, link), found.motion.links[link.name]
        inertial = link.mass * moving.acceleration(G)
        force = force - inertial
        moment = moment - link.inertia * moving.alpha - cross(G - A, inertial)
    return force, moment


@dataclass(frozen=True)
class Counterweights:
    """Weights that balance a linkage on its foundation.

    Parameters
    ----------
    moments : dict
        Link → mass × place of its counterweight relative to the link's pivot on the ground, in link axes, (x, y) [kg m].
    before, after : float
        Largest shaking force of the cycle without and with them [N].
    """

    moments: dict[str, tuple[float, float]]
    before: float
    after: float


def counterweights(chain: Chain, links: tuple[str, ...]) -> Counterweights:
    """Counterweights on links with a pivot on the ground that leave the least shaking force (least squares over a turn).

    A four-bar is balanced entirely by weights on both links that turn about the ground (Berkof and Lowen 1969).

    LinkageError if a link has no pivot on the ground.
    """
    _refuse_none(chain, links)
    found = cycle(chain, full_turn(chain, ANGLES))
    force, _ = _shaking(found)
    columns = []
    for name in links:
        moving = found.motion.links[name]
        turning = -(1j * moving.alpha - moving.omega**2) * moving.e  # force of a unit weight × distance
        columns += [turning, 1j * turning]
    A = np.stack([np.concatenate([c.real, c.imag]) for c in columns], axis=1)
    x, *_ = np.linalg.lstsq(A, -np.concatenate([force.real, force.imag]), rcond=None)
    left = force + sum(c * value for c, value in zip(columns, x, strict=True))
    moments = {name: (float(x[2 * k]), float(x[2 * k + 1])) for k, name in enumerate(links)}
    return Counterweights(moments, float(np.abs(force).max()), float(np.abs(left).max()))


class CounterRotors(NamedTuple):
    """Discs geared to links at ratio −1 that take up the shaking moment.

    Attributes
    ----------
    inertias : dict
        Link → moment of inertia of its disc [kg m²].
    before, after : float
        Largest shaking moment of the cycle without and with them [N m].
    """

    inertias: dict[str, float]
    before: float
    after: float


def counter_rotors(chain: Chain, links: tuple[str, ...]) -> CounterRotors:
    """Counter-rotating discs on links pivoted on the ground that leave the least shaking moment (least squares over a turn).

    The moment does not depend on its reference point once the forces are balanced; a force-balanced four-bar whose coupler
    is a physical pendulum is then balanced entirely (Berkof 1973).
    """
    from scipy.optimize import nnls  # takes long to import, and few need it

    _refuse_none(chain, links)
    found = cycle(chain, full_turn(chain, ANGLES))
    _, moment = _shaking(found)
    A = np.stack([found.motion.links[name].alpha + np.zeros(len(found)) for name in links], axis=1)
    x, _ = nnls(A, -moment)
    return CounterRotors(
        dict(zip(links, map(float, x), strict=True)),
        float(np.abs(moment).max()),
        float(np.abs(moment + A @ x).max()),
    )


def _ground_pivot(chain: Chain, link: str):
    for joint in chain.joints:
        if joint.kind == "revolute" and GROUND in (joint.parent, joint.child) and link in (joint.parent, joint.child):
            return joint
    pivoted = [j.other(GROUND) for j in chain.joints if GROUND in (j.parent, j.child) and j.kind == "revolute"]
    raise LinkageError(f"link {link!r} has no pivot on the ground for a counterweight; {', '.join(pivoted)} have one.")


def weighted(chain: Chain, name: str, moment, radius: float) -> PlanarLink:
    """Link with a point mass, whose mass × place relative to the ground pivot is given, at a radius from it.

    LinkageError if the radius is not positive.
    """
    if not isinstance(radius, Real) or not np.isfinite(radius) or radius <= 0:
        raise LinkageError(f"radius of the counterweight on {name!r}: expected a positive length [m], got {radius!r}.")
    pivot = _ground_pivot(chain, name).point(name)
    link = next(link for link in chain.links if link.name == name)
    toward = complex(*moment)
    added = abs(toward) / radius
    if not added:
        return link
    at, com = pivot + toward / added, complex(*link.com)
    mass = link.mass + added
    new = (link.mass * com + added * at) / mass
    inertia = link.inertia + link.mass * abs(com - new) ** 2 + added * abs(at - new) ** 2
    return replace(link, mass=mass, inertia=inertia, com=(new.real, new.imag))


def _refuse_none(chain: Chain, links: tuple[str, ...]):
    """Raise a LinkageError if no links are named, or one has no pivot on the ground."""
    if not links:
        raise LinkageError(f"{chain.name}: name at least one link that turns about the ground.")
    for name in links:
        _ground_pivot(chain, name)
