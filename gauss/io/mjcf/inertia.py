"""Inertia as MuJoCo accepts it: positive, and with moments that satisfy the triangle inequality."""

import numpy as np

from gauss import rotations
from gauss.errors import FileError
from gauss.io.mjcf.tree import Limb
from gauss.scene import GROUND, Body, Scene
from gauss.scene.body import TRIANGLE_TOLERANCE
from gauss.system import System
from gauss.system.frames import relative

TAKEN = 1e-15  # kg, kg m²: MuJoCo refuses moving bodies with less
LEAST_INERTIA = 1e-14  # kg, kg m²: written in place of what it refuses
ROUNDING = 1e-14  # of the largest moment: the least one is zero but for rounding
NEGLIGIBLE = 1e-9  # of the mass of the scene, and of its moments: what is written in place of nothing must not show
PARALLEL = 1e-12  # sine of the angle between axes that are parallel but for rounding


def inertial(system: System, limbs: list[Limb], limb: Limb, strict: bool = True) -> tuple[dict, str]:
    """Attributes of <inertial>, and a remark on what was changed.

    FileError if the body's inertia is not physical, and its motion would show that; or less than MuJoCo takes.

    Parameters
    ----------
    system : System
        The scene, compiled.
    limbs : list of Limb
        Bodies of the tree.
    strict : bool
        Whether what MuJoCo refuses is refused, where more in its place would show.
    """
    scene, scale = system.scene, system.scale
    body = scene.bodies[limb.body]
    J, R = body.principal()
    remarks = []
    mass = body.mass
    if not mass and not _carries(scene, limbs, body.name):
        raise FileError(f"body {body.name!r}: neither it nor what hangs on it has mass; MuJoCo cannot move it.")
    if _is_replaced(body, mass, scale.mass, "kg", strict):
        mass = LEAST_INERTIA
        remarks.append(f"{LEAST_INERTIA:g} kg instead of no mass")
    if not _is_triangle(J):
        J, remark = _completed(scene, limbs, body, J, R)
        remarks.append(remark)
    least = J.min() if J.min() > ROUNDING * J.max() else 0.0
    if _is_replaced(body, least, scale.mass * scale.length**2, "kg m²", strict):
        J = np.maximum(J, LEAST_INERTIA)
        remarks.append(f"{LEAST_INERTIA:g} kg m² instead of no moment of inertia")
    return {"pos": body.com, "mass": mass, "diaginertia": J, "quat": rotations.to_quaternion(R)}, ", ".join(remarks)


def _is_replaced(body: Body, value: float, whole: float, unit: str, strict: bool) -> bool:
    """Whether a mass or moment is zero, and :data:`LEAST_INERTIA` stands in its place, which does not show in the scene.

    FileError if it would show, or a value that is not zero is less than MuJoCo takes.
    """
    if not value and LEAST_INERTIA <= NEGLIGIBLE * whole:
        return True
    if strict and value < TAKEN:
        what = "mass" if unit == "kg" else "least moment of inertia"
        raise FileError(
            f"body {body.name!r}: its {what}, {value:.3g} {unit}, is less than the {TAKEN:g} {unit} that MuJoCo takes, "
            "and more would show; give it more, or write a larger scene of the same proportions."
        )
    return False


def _is_triangle(J: np.ndarray) -> bool:
    small, middle, large = np.sort(J)
    return small + middle >= large


def _completed(scene: Scene, limbs: list[Limb], body: Body, J: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, str]:
    """Moments that satisfy the triangle inequality and move the same."""
    order = np.argsort(J)
    shortage = J[order[2]] - J[order[0]] - J[order[1]]
    completed = J.copy()
    completed[order[:2]] += shortage / 2 * (1 + 1e-9)  # the sum must not fall short by rounding
    if shortage <= TRIANGLE_TOLERANCE * J[order[2]]:
        return completed, f"moments of inertia raised by {shortage / 2:.1e} kg m² to satisfy the triangle inequality"
    if not _turns_about(scene, limbs, body.name, R[:, order[2]]):
        raise FileError(
            f"body {body.name!r}: moments {J} kg m² violate the triangle inequality, which MuJoCo refuses, and the body "
            "does not move in a plane; give all three moments."
        )
    return completed, "moments of inertia made up across the axis of its planar motion, where they never show"


def _turns_about(scene: Scene, limbs: list[Limb], name: str, axis: np.ndarray) -> bool:
    """Whether a body only ever turns about an axis of its own: all joints that lead to it turn about this axis."""
    by_body = {limb.body: limb for limb in limbs}
    direction = relative(scene, GROUND, name)[0] @ axis
    while name != GROUND:
        limb, R = by_body[name], relative(scene, GROUND, name)[0]
        for step in limb.steps:
            if step.kind != "slide" and (step.axis is None or _sine(R @ step.axis, direction) > PARALLEL):
                return False
        name = limb.on
    return True


def _sine(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross(a, b)))


def _carries(scene: Scene, limbs: list[Limb], name: str) -> bool:
    """Whether a body with mass hangs on a body."""
    below = {name}
    for limb in limbs:
        if limb.on in below:
            below.add(limb.body)
    return any(scene.bodies[body].mass for body in below)
