"""Forces of the medium that a MuJoCo model moves in, on each body at its centre of mass, or on its ellipsoids.

MuJoCo's documentation, "Computation: Fluid forces", and its functions mj_inertiaBoxFluidModel, mj_addedMassForces and
mj_viscousForces. v and ω are in the axes of the inertia, or of the ellipsoid:

    box b of the same inertia, d = (b₀ + b₁ + b₂)/3:   F_i = −3π d μ v_i − ½ ρ b_j b_k |v_i| v_i
                                                       M_i = −π d³ μ ω_i − ρ b_i (b_j⁴ + b_k⁴) |ω_i| ω_i / 64
"""

from collections.abc import Callable
from math import pi
from typing import NamedTuple

import mujoco
import numpy as np

from gauss import math, rotations
from gauss.io.mjcf.names import Named
from gauss.rotations import cross
from gauss.scene import Scene

LEAST_DIVISOR = mujoco.mjMINVAL  # kg, kg m², m²/s² …: taken by MuJoCo in place of a smaller divisor
Law = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]  # (v, ω) → (F, M)


def add_medium(scene: Scene, named: Named, i: int):
    """Forces of the medium on a body."""
    model = named.model
    if not (model.opt.density or model.opt.viscosity) or model.body_mass[i] < LEAST_DIVISOR:
        return
    geoms = range(model.body_geomadr[i], model.body_geomadr[i] + model.body_geomnum[i])
    ellipsoids = [g for g in geoms if model.geom_fluid[g].ravel()[0] > 0]
    if not ellipsoids:
        _add(scene, named, i, f"medium on {named.bodies[i]}", model.body_ipos[i], model.body_iquat[i], _on_box(model, i))
    for g in ellipsoids:
        name = f"medium on {named.name('geom', g)}"
        _add(scene, named, i, name, model.geom_pos[g], model.geom_quat[g], _on_ellipsoid(model, g))


def _add(scene: Scene, named: Named, i: int, name: str, position, quaternion, law: Law):
    body, at, R = named.bodies[i], tuple(position), rotations.clean(rotations.from_quaternion(np.array(quaternion)))
    wind = np.array(named.model.opt.wind)

    def wrench(motion):
        axes = motion.rotation(body) @ R
        v, omega = axes.T @ (motion.velocity(body, at) - wind), axes.T @ motion.angular_velocity(body)
        return [R @ part for part in law(v, omega)]

    force, moment = (lambda t, motion: wrench(motion)[0]), (lambda t, motion: wrench(motion)[1])
    scene.force(name, body, force, moment, at=at, axes="body")


def _on_box(model, i: int) -> Law:
    """Viscous resistance of a sphere and drag of the box of the inertia of a body."""
    rho, mu = float(model.opt.density), float(model.opt.viscosity)
    J = model.body_inertia[i]
    b = np.sqrt(np.maximum(LEAST_DIVISOR, J.sum() - 2.0 * J) / model.body_mass[i] * 6.0)
    d, faces = b.mean(), np.prod(b) / b
    vanes = b * (np.sum(b**4) - b**4)

    def law(v, omega):
        F = -3.0 * pi * d * mu * v - 0.5 * rho * faces * math.abs(v) * v
        return F, -pi * d**3 * mu * omega - rho * vanes * math.abs(omega) * omega / 64.0

    return law


class _Coefficients(NamedTuple):
    """Numbers of geom_fluid of a geom."""

    interaction: float
    blunt: float
    slender: float
    angular: float
    kutta: float
    magnus: float


def _on_ellipsoid(model, g: int) -> Law:
    """Added mass, Magnus and Kutta lift, viscous and quadratic drag of an ellipsoid; without what depends on v̇."""
    rho, mu, numbers = float(model.opt.density), float(model.opt.viscosity), model.geom_fluid[g].ravel()
    c, virtual_mass, virtual_inertia = _Coefficients(*numbers[:6]), rho * numbers[6:9], rho * numbers[9:12]
    s = _semiaxes(model, g)
    least, middle, largest = np.sort(s)
    volume, greatest_face = 4.0 / 3.0 * pi * np.prod(s), pi * largest * middle
    faces, mean = np.prod(s) / s, 2.0 / 3.0 * s.sum()
    moments = np.array([8.0 / 15.0 * pi * s[k] * max(np.delete(s, k)) ** 4 for k in range(3)])
    turning = c.angular * moments + c.slender * (8.0 / 15.0 * pi * middle * largest**4 - moments)

    def law(v, omega):
        p, h = virtual_mass * v, virtual_inertia * omega
        speed, (numerator, denominator) = _norm(v), ((faces * v) @ (faces * v), (faces**2 * v) @ (faces**2 * v))
        shown = pi * np.sqrt(math.maximum(denominator, LEAST_DIVISOR**2) / math.maximum(numerator, LEAST_DIVISOR))
        lean = numerator / math.maximum(speed * denominator, LEAST_DIVISOR**2)
        circulation = c.kutta * rho * lean * shown * cross(faces**2 * v, v)
        drag = 3.0 * pi * mean * mu + rho * speed * (shown * c.blunt + c.slender * (greatest_face - shown))
        lift = c.magnus * rho * volume * cross(omega, v) + cross(circulation, v)
        spin = pi * mean**3 * mu + rho * _norm(turning * omega)
        F, M = cross(p, omega) + lift - drag * v, cross(p, v) + cross(h, omega) - spin * omega
        return c.interaction * F, c.interaction * M

    return law


def _semiaxes(model, g: int) -> np.ndarray:
    """Half axes [m] of the ellipsoid of a geom (MuJoCo's mju_geomSemiAxes)."""
    size, kind = model.geom_size[g], int(model.geom_type[g])
    if kind == int(mujoco.mjtGeom.mjGEOM_SPHERE):
        return np.full(3, size[0])
    if kind == int(mujoco.mjtGeom.mjGEOM_CAPSULE):
        return np.array([size[0], size[0], size[1] + size[0]])
    if kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
        return np.array([size[0], size[0], size[1]])
    return np.array(size)


def _norm(vector):
    return np.sqrt(math.maximum(vector @ vector, LEAST_DIVISOR**2))
