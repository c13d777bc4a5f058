"""Rigid bodies, by mass, centre of mass and inertia tensor, and named frames on them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.scene import values

TRIANGLE_TOLERANCE = 1e-6  # relative: inertias typed with 7 digits may miss the triangle inequality by as much
ROUNDED_PRODUCT = 1e-14  # product of inertia, relative to the trace, that is round-off


@dataclass(frozen=True)
class Body:
    """Rigid body, described in its own body frame.

    Parameters
    ----------
    name : str
        Name; "ground" is the world.
    mass : float
        Mass [kg]; zero is allowed where joints and other inertias leave the motion determined.
    inertia : array_like
        Inertia about the centre of mass [kg m²]: (Jxx, Jyy, Jzz), (Jxx, Jyy, Jzz, Jxy, Jxz, Jyz) or a
        3 × 3 matrix, in the axes of the body frame turned by ``inertia_axes``; principal axes are found.
        (0, 0, J) stands for a link of a planar mechanism whose other moments do not matter.
    com : array_like, shape (3,)
        Centre of mass in the body frame [m].
    inertia_axes : array_like
        Rotation of the axes of ``inertia`` from the body frame.
    position, rotation : array_like
        Pose of the body frame at the reference configuration (all joint coordinates zero), relative to ``on``.
        A rotation is (roll, pitch, yaw) [rad], a quaternion (w, x, y, z) or a matrix.
    on : str
        Body whose frame ``position`` and ``rotation`` refer to.
    inertia_as_given : bool
        Whether moments that no body can have are taken: that violate the triangle inequality, or stand without mass. The
        accelerations of a model with such data are those of its equations, not of a mechanism.

    Raises
    ------
    SceneError
        If a value is not physical; the message names it.
    """

    name: str
    mass: float
    inertia: tuple = (0.0, 0.0, 0.0)
    com: tuple = (0.0, 0.0, 0.0)
    inertia_axes: tuple = (0.0, 0.0, 0.0)
    position: tuple = (0.0, 0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)
    on: str = "ground"
    inertia_as_given: bool = False

    def __post_init__(self):
        what = f"body {values.text(self.name, 'name of a body')!r}"
        values.text(self.on, f"{what}: on")
        keep = {
            "mass": values.number(self.mass, f"{what}: mass", "kg", non_negative=True),
            "com": values.vector(self.com, f"{what}: com", "m"),
            "position": values.vector(self.position, f"{what}: position", "m"),
            "rotation": values.rotation(self.rotation, f"{what}: rotation"),
            "inertia_axes": values.rotation(self.inertia_axes, f"{what}: inertia_axes"),
            "inertia": _inertia(self.inertia, f"{what}: inertia"),
        }
        values.keep(self, **keep)
        if type(self.inertia_as_given) is not bool:
            raise SceneError(f"{what}: inertia_as_given must be true or false, got {self.inertia_as_given!r}.")
        found = unphysical(self.mass, self.inertia)
        if found is not None and (found.impossible or not self.inertia_as_given):
            raise SceneError(f"{what}: {found.words}")

    def principal(self) -> tuple[np.ndarray, np.ndarray]:
        """Principal central inertias J (3,) [kg m²] and the rotation R_bz of their axes in the body frame."""
        J, axes = principal_axes(_tensor(self.inertia))
        J = np.maximum(J, 0.0)  # typed digits may leave a moment below zero, which would be driven backwards
        return J, rotations.clean(values.rotation_matrix(self.inertia_axes) @ axes)


def principal_axes(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) of a symmetric tensor and the rotation of its axes, the identity where it is diagonal."""
    if np.abs(tensor - np.diag(np.diag(tensor))).max() <= ROUNDED_PRODUCT * np.trace(tensor):
        return np.diag(tensor).copy(), np.eye(3)
    J, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 2] = -axes[:, 2]
    return J, axes


@dataclass(frozen=True)
class Frame:
    """Named frame fixed to a body: a tool centre point, a sensor, a link that was merged into another.

    Parameters
    ----------
    name, body : str
        Name of the frame and of the body that carries it.
    position, rotation : array_like
        Pose in the body frame [m].
    """

    name: str
    body: str
    position: tuple = (0.0, 0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)

    def __post_init__(self):
        what = f"frame {values.text(self.name, 'name of a frame')!r}"
        values.keep(self, position=values.vector(self.position, f"{what}: position", "m"))
        values.keep(self, rotation=values.rotation(self.rotation, f"{what}: rotation"))


def _inertia(value, what: str) -> tuple:
    size = np.size(np.asarray(value, dtype=object))
    if size not in (3, 6, 9):
        raise SceneError(f"{what}: expected 3 moments, 6 entries (xx, yy, zz, xy, xz, yz) or a 3 × 3 matrix, got {value!r}.")
    entries = values.vector(value, what, "kg m²", size)
    if size < 9:
        return entries
    matrix = np.reshape(entries, (3, 3))
    if np.abs(matrix - matrix.T).max() > TRIANGLE_TOLERANCE * np.abs(matrix).max():
        raise SceneError(f"{what}: the matrix {value!r} is not symmetric.")
    return tuple(entries[i : i + 3] for i in (0, 3, 6))


def _tensor(entries: tuple) -> np.ndarray:
    if np.size(entries) == 9:
        matrix = np.array(entries)
        return (matrix + matrix.T) / 2
    xx, yy, zz, xy, xz, yz = (*entries, 0.0, 0.0, 0.0)[:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class Unphysical(NamedTuple):
    """Why no body has some mass and inertia."""

    kind: str  # "negative", "triangle" or "no mass"
    words: str  # in words, with the remedy

    @property
    def impossible(self) -> bool:
        """Whether it cannot be taken as given either."""
        return self.kind == "negative"


def unphysical(mass: float, inertia: tuple) -> Unphysical | None:
    """Why no body has this mass [kg] and inertia [kg m²], as of :class:`Body`; None if one may."""
    J = principal_axes(_tensor(inertia))[0]
    small, middle, large = np.sort(J)
    if small < -TRIANGLE_TOLERANCE * abs(large) or large < 0:
        words = f"inertia has the negative principal moment {small:.6g} kg m²; all must be ≥ 0."
        return Unphysical("negative", words)
    planar_link = small == 0 and middle == 0
    if small + middle < large * (1 - TRIANGLE_TOLERANCE) and not planar_link:
        words = (
            f"principal moments {J} kg m² violate the triangle inequality (each at most the sum of the other two); "
            "check that the inertia is about the centre of mass and its units are kg m²."
        )
        return Unphysical("triangle", words)
    if mass == 0 and large > 0:
        return Unphysical("no mass", f"inertia {J} kg m² without mass; give a mass > 0, or zero inertia.")
    return None
