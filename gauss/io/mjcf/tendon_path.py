"""Length of a tendon of a MuJoCo model, its rate, and the loads of a tension: sums of coordinates, and lines over sites.

    fixed:    L = L₀ + Σ cᵢ qᵢ
    spatial:  L = Σ_branches (1/divisor) Σ |p_{k+1} − p_k|,   force on the body of site k: T/divisor (e_k − e_{k−1})

A pulley begins another branch, with the divisor of its rope (MuJoCo's documentation, "XML reference: tendon/spatial").
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gauss import math
from gauss.io.mjcf.names import Named
from gauss.scene import GROUND, Force, Scene

ON_JOINT, ON_SITE, ON_PULLEY = (int(getattr(mujoco.mjtWrap, f"mjWRAP_{name}")) for name in ("JOINT", "SITE", "PULLEY"))
TINY = 1e-30  # m², below which the root of a squared length is not taken: the points meet but for rounding
Law = Callable  # (t, motion) → number


class PathPoint(NamedTuple):
    """Site of a tendon: body, point of its frame [m]."""

    body: str
    at: tuple


class PathSpan(NamedTuple):
    """Straight piece of a tendon between two of its points, with the share 1/divisor of its branch."""

    first: PathPoint
    second: PathPoint
    share: float


class TendonPath:
    """Tendon of a model.

    Parameters
    ----------
    named : Named
        The model.
    i : int
        Number of the tendon.
    """

    def __init__(self, named: Named, i: int):
        self.named, self.number = named, i
        self.rest = float(named.model.tendon_length0[i])

    @property
    def wraps(self) -> range:
        """Numbers of what it is led over."""
        model = self.named.model
        return range(int(model.tendon_adr[self.number]), int(model.tendon_adr[self.number] + model.tendon_num[self.number]))

    @cached_property
    def types(self) -> list[int]:
        """Types of what it is led over."""
        return [int(self.named.model.wrap_type[w]) for w in self.wraps]

    @property
    def is_fixed(self) -> bool:
        """Whether it is a sum of coordinates of hinges and slides."""
        return all(kind == ON_JOINT for kind in self.types)

    @property
    def is_read(self) -> bool:
        """Whether it is led over sites and pulleys only, or is fixed."""
        return self.is_fixed or all(kind in (ON_SITE, ON_PULLEY) for kind in self.types)

    @cached_property
    def terms(self) -> dict[str, float]:
        """Joints and coefficients of a fixed tendon."""
        model, found = self.named.model, dict[str, float]()
        for w in self.wraps:
            joint = self.named.joints[model.wrap_objid[w]]
            found[joint] = found.get(joint, 0.0) + float(model.wrap_prm[w])
        return found

    @cached_property
    def spans(self) -> list[PathSpan]:
        """Straight pieces of a spatial tendon; those within one body do not change and are left out."""
        model, found, share, last = self.named.model, list[PathSpan](), 1.0, None
        for w, kind in zip(self.wraps, self.types, strict=True):
            if kind == ON_PULLEY:
                share, last = 1.0 / float(model.wrap_prm[w]), None
                continue
            site = int(model.wrap_objid[w])
            point = PathPoint(self.named.bodies[int(model.site_bodyid[site])], tuple(map(float, model.site_pos[site])))
            if last is not None and last.body != point.body:
                found.append(PathSpan(last, point, share))
            last = point
        return found

    @cached_property
    def constant(self) -> float:
        """Part of the length of a spatial tendon that does not change [m]: pieces within one body."""
        model, total, share, last = self.named.model, 0.0, 1.0, None
        for w, kind in zip(self.wraps, self.types, strict=True):
            site = int(model.wrap_objid[w])
            if kind == ON_PULLEY:
                share, site = 1.0 / float(model.wrap_prm[w]), -1
            elif last is not None and last >= 0 and model.site_bodyid[last] == model.site_bodyid[site]:
                total += share * float(np.linalg.norm(model.site_pos[site] - model.site_pos[last]))
            last = site
        return total

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
            total = total + span.share * (along @ (at.velocity(*span.second) - at.velocity(*span.first)))
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


def _between(span: PathSpan, at):
    """Unit vector (3,) from the first to the second point of a piece, and its length [m]."""
    gap = at.position(*span.second) - at.position(*span.first)
    length = np.sqrt(math.maximum(gap @ gap, TINY))
    return gap / length, length


def _along(span: PathSpan, factor: float) -> Law:
    return lambda t, motion: factor * _between(span, motion)[0]


def _times(factor: float, law: Law) -> Law:
    return lambda t, motion: factor * law(t, motion)


def _times_vector(vector, force: float | Law) -> Law:
    if callable(force):
        return lambda t, motion: force(t, motion) * vector(t, motion)
    return lambda t, motion: force * vector(t, motion)
