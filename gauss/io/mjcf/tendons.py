"""Tendons of a MuJoCo model: their springs, dampers, limits, armature and friction; lengths, rates, and loads of a tension.

    fixed:    L = L₀ + Σ cᵢ qᵢ
    spatial:  L = Σ_branches (1/divisor) Σ L_k,   force on the body of site k: T/divisor (e_k − e_{k−1})

A pulley begins another branch, with the divisor of its rope (MuJoCo's documentation, "XML reference: tendon/spatial").
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gauss import math
from gauss.io.mjcf.names import Named
from gauss.io.mjcf.tendon_spans import Law, PathPoint, PathSpan, WrapSurface
from gauss.rotations import from_quaternion
from gauss.scene import GROUND, Force, Scene

KINDS = ("JOINT", "SITE", "PULLEY", "CYLINDER")
ON_JOINT, ON_SITE, ON_PULLEY, ON_CYLINDER = (int(getattr(mujoco.mjtWrap, f"mjWRAP_{name}")) for name in KINDS)


@dataclass(frozen=True)
class TendonPath:
    """Tendon of a model."""

    rest: float  # length in the pose of the file, L₀ [m or rad]
    is_fixed: bool  # whether it is a sum of coordinates of hinges and slides
    terms: dict[str, float]  # joints and coefficients of a fixed tendon
    spans: tuple[PathSpan, ...] = ()  # pieces of a spatial tendon, but for straight ones within one body
    constant: float = 0.0  # length of the pieces within one body [m]
    is_line: bool = False  # whether it is one straight line between two bodies

    def length(self, at):
        """Length [m or rad] by a view of the mechanism."""
        if self.is_fixed:
            return self.rest + sum(factor * at.coordinate(joint) for joint, factor in self.terms.items())
        return self.constant + sum(span.length(at) for span in self.spans)

    def rate(self, at):
        """Rate of the length [m/s or rad/s] by a view of the mechanism."""
        if self.is_fixed:
            return sum(factor * at.rate(joint) for joint, factor in self.terms.items())
        return sum(span.rate(at) for span in self.spans)

    def pull(self, scene: Scene, name: str, force: float | Law):
        """Loads of a force along the length, positive where it lengthens the tendon, a number or a law (t, motion)."""
        if self.is_fixed:
            for joint, factor in self.terms.items():
                effort: Any = _scaled(factor, force) if callable(force) else factor * force
                scene.drive(joint, name=f"{name} on {joint}" if len(self.terms) > 1 else name, torque=effort)
            return
        for one in self.unit_forces(name):
            parts = (times(part, force) for part in (one.force, one.moment))
            scene.force(one.name, one.body, *parts, at=one.at)

    def unit_forces(self, name: str) -> list[Force]:
        """Forces on bodies of a spatial tendon under a force of 1 N along its length."""
        return [one for number, span in enumerate(self.spans) for one in span.forces(name, number + 1)]


def tendon_path(named: Named, i: int) -> TendonPath:
    """Tendon of a number."""
    model = named.model
    wraps = range(int(model.tendon_adr[i]), int(model.tendon_adr[i] + model.tendon_num[i]))
    types, rest = [int(model.wrap_type[w]) for w in wraps], float(model.tendon_length0[i])
    if all(kind == ON_JOINT for kind in types):
        terms = dict[str, float]()
        for w in wraps:
            joint = named.joints[model.wrap_objid[w]]
            terms[joint] = terms.get(joint, 0.0) + float(model.wrap_prm[w])
        return TendonPath(rest, True, terms)
    spans, constant = _spatial(named, wraps, types)
    return TendonPath(rest, False, {}, spans, constant, len(types) == 2 and len(spans) == 1)


def _spatial(named: Named, wraps: range, types: list[int]) -> tuple[tuple[PathSpan, ...], float]:
    """Pieces of a tendon over sites, geoms and pulleys, and the length of the straight ones within one body."""
    model = named.model
    spans, constant, share, last, over = list[PathSpan](), 0.0, 1.0, None, None
    for w, kind in zip(wraps, types, strict=True):
        if kind == ON_PULLEY:
            share, last = 1.0 / float(model.wrap_prm[w]), None
            continue
        if kind != ON_SITE:
            over = _surface(named, w)
            continue
        point = _site(named, int(model.wrap_objid[w]))
        if last is not None and (over is not None or last.body != point.body):
            spans.append(PathSpan(last, point, share, over))
        elif last is not None:
            constant += share * float(np.linalg.norm(np.subtract(point.at, last.at)))
        last, over = point, None
    return tuple(spans), constant


def _surface(named: Named, w: int) -> WrapSurface:
    """Geom that a tendon wraps around."""
    model, geom, side = named.model, int(named.model.wrap_objid[w]), round(float(named.model.wrap_prm[w]))
    axes, centre = from_quaternion(np.array(model.geom_quat[geom])), np.array(model.geom_pos[geom])
    body, cylinder = named.bodies[int(model.geom_bodyid[geom])], int(model.wrap_type[w]) == ON_CYLINDER
    towards = None if side < 0 else _site(named, side)
    return WrapSurface(body, tuple(map(float, centre)), axes, float(model.geom_size[geom, 0]), cylinder, towards)


def _site(named: Named, site: int) -> PathPoint:
    model = named.model
    return PathPoint(named.bodies[int(model.site_bodyid[site])], tuple(map(float, model.site_pos[site])))


def _scaled(factor: float, law: Law) -> Law:
    return lambda t, motion: factor * law(t, motion)


def times(part, force: float | Law):
    """Vector, or a law of one, times a number or a law."""
    if not callable(part):
        if not any(part):
            return part
        return (lambda t, motion: force(t, motion) * np.array(part)) if callable(force) else tuple(force * x for x in part)
    if callable(force):
        return lambda t, motion: force(t, motion) * part(t, motion)
    return lambda t, motion: force * part(t, motion)


def add_tendon(scene: Scene, named: Named, i: int, stops: bool):
    """Elements of a tendon; limits of fixed ones where stops are requested, those of spatial ones always."""
    model, name, path = named.model, named.name("tendon", i), tendon_path(named, i)
    stiffness, damping = float(np.ravel(model.tendon_stiffness[i])[0]), float(np.ravel(model.tendon_damping[i])[0])
    low, high = map(float, model.tendon_lengthspring[i])
    between = path.is_line
    if (stiffness or damping) and between and low == high:
        scene.spring(name, **_ends(path), stiffness=stiffness, damping=damping, length=low)
    elif stiffness or damping:
        path.pull(scene, name, _resistance(path, stiffness, damping, low, high))
    if model.tendon_limited[i] and (stops or not path.is_fixed):
        _limit(scene, named, i, path, name)
    _add_inertia_and_friction(scene, named, i, path, name)


def _add_inertia_and_friction(scene: Scene, named: Named, i: int, path: TendonPath, name: str):
    """Armature and dry friction, along the tendon: those of a rotor that it turns, but for friction of a single joint."""
    friction, armature = float(named.model.tendon_frictionloss[i]), float(named.model.tendon_armature[i])
    if friction and path.is_fixed and len(path.terms) == 1:
        joint, factor = next(iter(path.terms.items()))
        scene.joint_friction(joint, abs(factor) * friction, name=f"friction of {name}")
        friction = 0.0
    if friction or armature:
        shaft = _add_rotor(scene, name, path, armature)
        if friction:
            scene.joint_friction(shaft, friction, name=f"friction of {name}")


def _ends(path: TendonPath) -> dict:
    span = path.spans[0]
    return {"body": span.first.body, "other": span.second.body, "at": span.first.at, "other_at": span.second.at}


def _resistance(path: TendonPath, stiffness: float, damping: float, low: float, high: float):
    """Law of the force −k (L − L_s) − d L̇, slack between the two lengths of the spring."""

    def force(t, motion):
        length = path.length(motion)
        beyond = length - low if low == high else math.maximum(length - high, 0.0) + math.minimum(length - low, 0.0)
        return -stiffness * beyond - damping * path.rate(motion)

    return force


def _limit(scene: Scene, named: Named, i: int, path: TendonPath, name: str):
    """Largest and least length as ropes and one-sided constraints."""
    shortest, longest = map(float, named.model.tendon_range[i])
    if path.is_line:
        if longest > 0.0:
            scene.rope(f"{name} taut" if name in scene.loads else name, **_ends(path), length=longest)
    else:
        scene.one_sided(f"{name} taut", lambda at: longest - path.length(at))
    if path.is_fixed or shortest > 0.0:
        scene.one_sided(f"{name} at its shortest", lambda at: path.length(at) - shortest)


def _add_rotor(scene: Scene, name: str, path: TendonPath, inertia: float) -> str:
    """Shaft of a rotor on the ground that turns by 1 rad for each rad or m of the tendon: it adds its inertia only."""
    rotor, shaft = f"rotor of {name}", f"shaft of {name}"
    scene.body(rotor, 1.0, (inertia,) * 3)
    scene.revolute(shaft, GROUND, rotor)
    if path.is_fixed and len(path.terms) == 1:
        joint, factor = next(iter(path.terms.items()))
        scene.couple(f"armature of {name}", shaft, joint, factor)
    elif path.is_fixed:
        scene.linear_coupling(f"armature of {name}", path.terms | {shaft: -1.0}, 0.0)
    else:
        scene.constrain(f"armature of {name}", lambda at: path.length(at) - path.rest - at.coordinate(shaft))
    return shaft


def hold_tendon(scene: Scene, name: str, path: TendonPath, offset: float):
    """Hold a tendon at its length in the pose of the file, plus an offset."""
    if not path.is_fixed:
        if path.is_line:
            scene.distance(name, **_ends(path), length=path.rest + offset)
        else:
            scene.constrain(name, lambda at: path.length(at) - path.rest - offset)
        return
    couple_coordinates(scene, name, list(path.terms.items()), offset)


def couple_tendons(scene: Scene, name: str, path: TendonPath, other: TendonPath, polynomial: list[float]):
    """Let a tendon be a polynomial of another; lengths count from the pose of the file."""
    if path.is_fixed and other.is_fixed and not any(polynomial[2:]):
        factors = dict(path.terms)
        for joint, factor in other.terms.items():
            factors[joint] = factors.get(joint, 0.0) - polynomial[1] * factor
        terms = [(joint, factor) for joint, factor in factors.items() if factor]
        couple_coordinates(scene, name, terms, polynomial[0])
        return

    def residual(at):
        moved = other.length(at) - other.rest
        return path.length(at) - path.rest - sum(factor * moved**power for power, factor in enumerate(polynomial))

    scene.constrain(name, residual)


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
