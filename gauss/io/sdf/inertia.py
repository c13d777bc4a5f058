"""Mass, centre of mass and inertia of an SDFormat link: as given, or of its collisions where the file says auto="true".

    m = Σ ρ V,   c = Σ ρ V c_i / m,   J = Σ R_i J_i R_iᵀ + ρ V (|d|² 1 − d dᵀ),   d = c_i − c

The density ρ is that of the collision, of the <inertial>, or 1000 kg/m³ (SDFormat specification, "Automatic inertia").
"""

from collections.abc import Callable
from math import pi
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from gauss.errors import FileError
from gauss.io.guard import Source
from gauss.io.sdf.elements import TRUE, numbers, pose, value
from gauss.system.frames import IDENTITY, Pose

DENSITY = 1000.0  # kg/m³, of a collision without one
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


class MassProperties(NamedTuple):
    """Mass [kg], moments and products of inertia (6,) [kg m²] in axes ``R_com``, centre of mass (3,) [m] in the link."""

    mass: float
    inertia: tuple[float, ...]
    com: np.ndarray
    R_com: np.ndarray


def of_link(source: Source, link: Element, placed) -> MassProperties:
    """Mass properties of a link.

    FileError if the inertia is automatic and a collision has a shape whose volume is not known.

    Parameters
    ----------
    placed : callable
        (element of a collision) → its pose (R, p) in the link.
    """
    inertial = link.find("inertial")
    if inertial is not None and inertial.get("auto") in TRUE:
        return _of_collisions(source, link, inertial, placed)
    R, com = pose(source, None if inertial is None else inertial.find("pose"))
    moments = None if inertial is None else inertial.find("inertia")
    inertia = tuple(value(source, moments, tag, float(tag in MOMENTS[:3])) for tag in MOMENTS)  # 1 where not given
    return MassProperties(value(source, inertial, "mass", 1.0), inertia, com, R)


def _of_collisions(source: Source, link: Element, inertial: Element, placed) -> MassProperties:
    common = value(source, inertial, "density", DENSITY)
    parts: list[tuple[float, np.ndarray, Pose]] = []
    for collision in link.findall("collision"):
        volume, moments = _solid(source, collision)
        density = value(source, collision, "density", common)
        parts.append((density * volume, density * moments, placed(collision)))
    mass = sum(part[0] for part in parts)
    if not mass:
        name = link.get("name")
        raise FileError(f"{source.place(inertial)}: link {name!r} has no collision with a volume; give mass and inertia.")
    com = sum((m * p for m, _, (_, p) in parts), np.zeros(3)) / mass
    J = np.zeros((3, 3))
    for m, moments, (R, p) in parts:
        d = p - com
        J += R @ np.diag(moments) @ R.T + m * (d @ d * np.eye(3) - np.outer(d, d))
    inertia = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return MassProperties(mass, tuple(map(float, inertia)), com, IDENTITY[0])


def _solid(source: Source, collision: Element) -> tuple[float, np.ndarray]:
    """Volume [m³] of a collision, and its moments of inertia (3,) at a density of 1 [m⁵]."""
    geometry = collision.find("geometry")
    for shape in [] if geometry is None else geometry:
        counts, solid = SOLIDS.get(shape.tag, ({}, None))
        sizes = [numbers(source, size, count) for tag, count in counts.items() if (size := shape.find(tag)) is not None]
        if solid is not None and len(sizes) == len(counts):
            return solid(*(np.array(size) if len(size) > 1 else size[0] for size in sizes))
    name = collision.get("name")
    raise FileError(
        f"{source.place(collision)}: inertia of collision {name!r} is not computed (box, sphere, cylinder, capsule and "
        "ellipsoid are); give mass and inertia of the link."
    )


def _box(size):
    V = float(np.prod(size))
    return V, V / 12.0 * (size @ size - size**2)


def _ellipsoid(radii):
    V = 4.0 / 3.0 * pi * float(np.prod(radii))
    return V, V / 5.0 * (radii @ radii - radii**2)


def _cylinder(r, length):
    V = pi * r * r * length
    across = V * (3.0 * r * r + length * length) / 12.0
    return V, np.array([across, across, V * r * r / 2.0])


def _capsule(r, length):
    """Cylinder between two half balls, whose centres of mass are 3 r/8 beyond its ends."""
    tube, moments = _cylinder(r, length)
    ends = 4.0 / 3.0 * pi * r**3
    across = ends * (0.4 * r * r + length * length / 4.0 + 3.0 * r * length / 8.0)
    return tube + ends, moments + np.array([across, across, ends * 0.4 * r * r])


SOLIDS: dict[str, tuple[dict[str, int], Callable]] = {  # by sizes, with their counts of numbers
    "box": ({"size": 3}, _box),
    "sphere": ({"radius": 1}, lambda r: _ellipsoid(np.full(3, r))),
    "cylinder": ({"radius": 1, "length": 1}, _cylinder),
    "capsule": ({"radius": 1, "length": 1}, _capsule),
    "ellipsoid": ({"radii": 3}, _ellipsoid),
}
