"""Scene with identified parameters: bodies with other masses, centres of mass and inertias, dampers, dry friction."""

from dataclasses import replace

import numpy as np

from gauss.analysis.regressor import FRICTION, RegressorModel, standard_parameters
from gauss.dynamics.inertial_regressor import STANDARD
from gauss.scene import Body, JointSpring, Scene
from gauss.scene.set_valued import JointFriction

SAME_PARAMETERS = 1e-12  # change of a body in the units of the scene that is round-off
LEAST_MASS = 1e-12  # of a body, relative to all: less is none


def identified_scene(model: RegressorModel, values: np.ndarray) -> Scene:
    """Scene of a model with other parameters (p,).

    SceneError if a body has a negative mass or moment, or friction is negative: values that are not consistent.
    """
    scene, n = model.system.scene, len(STANDARD)
    bodies, scale = dict(scene.bodies), model.system.scale
    for k, name in enumerate(model.system.structure.bodies):
        own, units = values[n * k : n * k + n], model.units[n * k : n * k + n]
        if np.abs((own - standard_parameters(bodies[name])) / units).max() > SAME_PARAMETERS:
            bodies[name] = _body(bodies[name], own, LEAST_MASS * scale.mass)
    return _with_friction(replace(scene, bodies=bodies), model, values[n * len(model.system.structure.bodies) :])


def _with_friction(scene: Scene, model: RegressorModel, values: np.ndarray) -> Scene:
    """Scene with viscous and Coulomb friction of joints: two values each."""
    loads, set_valued = dict(scene.loads), dict(scene.set_valued)
    taken = {*loads, *set_valued, *scene.inputs}
    for place, (viscous, dry) in zip(model.friction, values.reshape(-1, len(FRICTION)), strict=True):
        joint = model.system.coordinates[place]
        former = [key for key, one in set_valued.items() if isinstance(one, JointFriction) and one.joint == joint]
        for key in former:
            del set_valued[key]
        if viscous:
            name = _fresh(f"viscous friction of {joint}", taken)
            loads[name] = JointSpring(name, joint, damping=viscous)
        if dry:
            name = former[0] if former else _fresh(f"friction of {joint}", taken)
            set_valued[name] = JointFriction(name, joint, dry)
    return replace(scene, loads=loads, set_valued=set_valued)


def _body(body: Body, parameters: np.ndarray, least_mass: float) -> Body:
    """Body with standard parameters (10,)."""
    mass, h, (xx, yy, zz, xy, xz, yz) = parameters[0], parameters[1:4], parameters[4:]
    if abs(mass) <= least_mass:
        return replace(body, mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0))
    c, about_origin = h / mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    central = about_origin - mass * (c @ c * np.eye(3) - np.outer(c, c))
    moments = tuple(map(tuple, central))
    return replace(body, mass=mass, com=tuple(c), inertia=moments, inertia_axes=(0.0, 0.0, 0.0), inertia_as_given=True)


def _fresh(name: str, taken: set[str]) -> str:
    """Name that is not taken yet."""
    fresh, k = name, 2
    while fresh in taken:
        fresh, k = f"{name} {k}", k + 1
    taken.add(fresh)
    return fresh
