"""Tendons of a MuJoCo model: sums of joint coordinates, and straight lines between two points."""

from typing import NamedTuple

import mujoco
import numpy as np

from gauss.io.mjcf.names import Named
from gauss.scene import Scene

FIXED, STRAIGHT, CROSSING, OTHER = "fixed", "straight", "crossing", "other"
ON_JOINT, ON_SITE = int(mujoco.mjtWrap.mjWRAP_JOINT), int(mujoco.mjtWrap.mjWRAP_SITE)


class TendonSpan(NamedTuple):
    """Ends of a straight tendon: a body and a point of its frame [m], twice."""

    body: str
    other: str
    at: tuple
    other_at: tuple


def kind_of(model, i: int) -> str:
    """Fixed: a sum of coordinates of hinges and slides; straight: a line between points of two bodies; or neither."""
    wraps = _wraps(model, i)
    types = [int(model.wrap_type[w]) for w in wraps]
    if all(kind == ON_JOINT for kind in types):
        return FIXED
    if types != [ON_SITE] * 2:
        return OTHER
    bodies = {int(model.site_bodyid[model.wrap_objid[w]]) for w in wraps}
    return STRAIGHT if len(bodies) == 2 else CROSSING


def span(model, i: int) -> tuple[int, int] | None:
    """Sites at the ends of a straight tendon; None of another."""
    if kind_of(model, i) != STRAIGHT:
        return None
    first, last = (int(model.wrap_objid[w]) for w in _wraps(model, i))
    return first, last


def terms(named: Named, i: int) -> list[tuple[str, float]]:
    """Joints and coefficients of a fixed tendon, whose length is Σ coefficient · coordinate, from the pose of the file."""
    model = named.model
    return [(named.joints[model.wrap_objid[w]], float(model.wrap_prm[w])) for w in _wraps(model, i)]


def ends(named: Named, i: int) -> TendonSpan:
    """Ends of a straight tendon, in the frames of their bodies."""
    model = named.model
    one, other = (int(model.wrap_objid[w]) for w in _wraps(model, i))
    body = lambda site: named.bodies[int(model.site_bodyid[site])]  # noqa: E731
    return TendonSpan(body(one), body(other), tuple(model.site_pos[one]), tuple(model.site_pos[other]))


def add_tendon(scene: Scene, named: Named, i: int):
    """Springs, dampers and ropes that a tendon stands for."""
    model, name = named.model, named.name("tendon", i)
    stiffness, damping = float(np.ravel(model.tendon_stiffness[i])[0]), float(np.ravel(model.tendon_damping[i])[0])
    rest = float(model.tendon_lengthspring[i, 0])
    if kind_of(model, i) == FIXED:
        if stiffness or damping:
            at_rest = float(model.tendon_length0[i])  # lengths count from the pose of the file, as coordinates do
            pull(scene, name, terms(named, i), -stiffness * (at_rest - rest), -stiffness, -damping)
        return
    line = ends(named, i)._asdict()
    if stiffness or damping:
        scene.spring(name, **line, stiffness=stiffness, damping=damping, length=rest)
    if model.tendon_limited[i]:
        scene.rope(f"{name} taut" if name in scene.loads else name, **line, length=float(model.tendon_range[i, 1]))


def pull(scene: Scene, name: str, terms: list[tuple[str, float]], constant: float, per_length: float, per_rate: float):
    """Drives of the joints of a fixed tendon under the tension constant + per_length · L + per_rate · L̇."""

    def along(share: float):
        def effort(t, motion):
            length = sum(factor * motion.coordinate(joint) for joint, factor in terms)
            rate = sum(factor * motion.rate(joint) for joint, factor in terms)
            return share * (constant + per_length * length + per_rate * rate)

        return effort if per_length or per_rate else constant * share

    for joint, factor in terms:
        kind = "torque" if scene.joints[joint].kind == "revolute" else "force"
        scene.drive(joint, name=f"{name} on {joint}" if len(terms) > 1 else name, **{kind: along(factor)})


def couple_coordinates(scene: Scene, name: str, terms: list[tuple[str, float]], constant: float):
    """Hold the sum of coordinates of a fixed tendon at a value, counted from the pose of the file."""
    first, factor = terms[0]
    if len(terms) == 1:
        law = "angle" if scene.joints[first].kind == "revolute" else "displacement"
        scene.drive(first, name=name, **{law: constant / factor})
    elif len(terms) == 2:
        scene.couple(name, first, terms[1][0], -terms[1][1] / factor, constant / factor)
    else:
        scene.linear_coupling(name, dict(terms), constant)


def _wraps(model, i: int) -> range:
    return range(int(model.tendon_adr[i]), int(model.tendon_adr[i] + model.tendon_num[i]))
