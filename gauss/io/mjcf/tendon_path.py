"""Length of a tendon of a MuJoCo model, its rate, and the loads of a tension: sums of coordinates, and lines over sites.

    fixed:    L = L₀ + Σ cᵢ qᵢ
    spatial:  L = Σ_branches (1/divisor) Σ |p_{k+1} − p_k|,   force on the body of site k: T/divisor (e_k − e_{k−1})

A pulley begins another branch, with the divisor of its rope (MuJoCo's documentation, "XML reference: tendon/spatial").
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gauss import math
from gauss.io.mjcf.names import Named
from gauss.scene import GROUND, Force, Scene

ON_JOINT, ON_SITE, ON_PULLEY = (int(getattr(mujoco.mjtWrap, f"mjWRAP_{name}")) for name in ("JOINT", "SITE", "PULLEY"))
TINY = 1e-30  # m², below which the root of a squared length is not taken: the points meet but for rounding
Law = Callable  # (t, motion) → number


@dataclass(frozen=True)
class PathPoint:
    """Site of a tendon: body, point of its frame [m]."""

    body: str
    at: tuple[float, ...]


@dataclass(frozen=True)
class PathSpan:
    """Straight piece of a tendon between two of its points, with the share 1/divisor of its branch."""

    first: PathPoint
    second: PathPoint
    share: float


@dataclass(frozen=True)
class TendonPath:
    """Tendon of a model.

    Parameters
    ----------
    rest : float
        Length in the pose of the file, L₀ [m or rad].
    is_fixed, is_read : bool
        Whether it is a sum of coordinates of hinges and slides; whether it is that, or led over sites and pulleys only.
    terms : dict of str to float
        Joints and coefficients of a fixed tendon.
    spans : tuple of PathSpan
        Straight pieces of a spatial tendon, but for those within one body.
    constant : float
        Length of the pieces within one body [m].
    is_line : bool
        Whether it is one straight line between two bodies.
    """

    rest: float
    is_fixed: bool
    is_read: bool
    terms: dict[str, float]
    spans: tuple[PathSpan, ...] = ()
    constant: float = 0.0
    is_line: bool = False

    def length(self, at):
        """Length [m or rad] by a view of the mechanism."""
        if self.is_fixed:
            return self.rest + sum(factor * at.coordinate(joint) for joint, factor in self.terms.items())
        return self.constant + sum(span.share * _between(span, at)[1] for span in self.spans)

    def rate(self, at):
        """Rate of the length [m/s or rad/s] by a view of the mechanism."""
        if self.is_fixed:
            return sum(factor * at.rate(joint) for joint, factor in self.terms.items())
        total = 0.0
        for span in self.spans:
            along = _between(span, at)[0]
            total = total + span.share * (along @ (_velocity(span.second, at) - _velocity(span.first, at)))
        return total

    def pull(self, scene: Scene, name: str, force: float | Law):
        """Loads of a force along the length, positive where it lengthens the tendon, a number or a law (t, motion)."""
        if self.is_fixed:
            for joint, factor in self.terms.items():
                effort: Any = _times(factor, force) if callable(force) else factor * force
                scene.drive(joint, name=f"{name} on {joint}" if len(self.terms) > 1 else name, torque=effort)
            return
        for one in self.unit_forces(name):
            scene.force(one.name, one.body, _times_vector(one.force, force), at=one.at)

    def unit_forces(self, name: str) -> list[Force]:
        """Forces on bodies of a spatial tendon under a force of 1 N along its length."""
        found = []
        for number, span in enumerate(self.spans):
            for sign, point in ((-1.0, span.first), (1.0, span.second)):
                if point.body != GROUND:
                    called = f"{name} on {point.body}, {number + 1}"
                    found.append(Force(called, point.body, _along(span, sign * span.share), at=point.at))
        return found


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
        return TendonPath(rest, True, True, terms)
    if not all(kind in (ON_SITE, ON_PULLEY) for kind in types):
        return TendonPath(rest, False, False, {})
    spans, constant = _spatial(named, wraps, types)
    return TendonPath(rest, False, True, {}, spans, constant, len(types) == 2 and len(spans) == 1)


def _spatial(named: Named, wraps: range, types: list[int]) -> tuple[tuple[PathSpan, ...], float]:
    """Pieces of a tendon over sites and pulleys, and the length of those within one body."""
    model = named.model
    spans, constant, share, last = list[PathSpan](), 0.0, 1.0, None
    for w, kind in zip(wraps, types, strict=True):
        if kind == ON_PULLEY:
            share, last = 1.0 / float(model.wrap_prm[w]), None
            continue
        site = int(model.wrap_objid[w])
        point = PathPoint(named.bodies[int(model.site_bodyid[site])], tuple(map(float, model.site_pos[site])))
        if last is not None and last.body != point.body:
            spans.append(PathSpan(last, point, share))
        elif last is not None:
            constant += share * float(np.linalg.norm(np.subtract(point.at, last.at)))
        last = point
    return tuple(spans), constant


def _between(span: PathSpan, at):
    """Unit vector (3,) from the first to the second point of a piece, and its length [m]."""
    gap = at.position(span.second.body, span.second.at) - at.position(span.first.body, span.first.at)
    length = np.sqrt(math.maximum(gap @ gap, TINY))
    return gap / length, length


def _velocity(point: PathPoint, at):
    return at.velocity(point.body, point.at)


def _along(span: PathSpan, factor: float) -> Law:
    return lambda t, motion: factor * _between(span, motion)[0]


def _times(factor: float, law: Law) -> Law:
    return lambda t, motion: factor * law(t, motion)


def _times_vector(vector, force: float | Law) -> Law:
    if callable(force):
        return lambda t, motion: force(t, motion) * vector(t, motion)
    return lambda t, motion: force * vector(t, motion)
