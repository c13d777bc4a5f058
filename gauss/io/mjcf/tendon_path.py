"""Length of a tendon of a MuJoCo model, its rate, and the loads of a tension: sums of coordinates, and paths over sites.

    fixed:    L = L₀ + Σ cᵢ qᵢ
    spatial:  L = Σ_branches (1/divisor) Σ L_k,   force on the body of site k: T/divisor (e_k − e_{k−1})

A pulley begins another branch, with the divisor of its rope (MuJoCo's documentation, "XML reference: tendon/spatial").
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gauss.io.mjcf.names import Named
from gauss.io.mjcf.tendon_spans import Law, PathPoint, PathSpan, WrapSurface
from gauss.rotations import from_quaternion
from gauss.scene import Force, Scene

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
                effort: Any = _times(factor, force) if callable(force) else factor * force
                scene.drive(joint, name=f"{name} on {joint}" if len(self.terms) > 1 else name, torque=effort)
            return
        for one in self.unit_forces(name):
            parts = (_times_vector(part, force) for part in (one.force, one.moment))
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


def _times(factor: float, law: Law) -> Law:
    return lambda t, motion: factor * law(t, motion)


def _times_vector(part, force: float | Law):
    """Vector, or a law of one, times a number or a law."""
    if not callable(part):
        if not any(part):
            return part
        return (lambda t, motion: force(t, motion) * np.array(part)) if callable(force) else tuple(force * x for x in part)
    if callable(force):
        return lambda t, motion: force(t, motion) * part(t, motion)
    return lambda t, motion: force * part(t, motion)
