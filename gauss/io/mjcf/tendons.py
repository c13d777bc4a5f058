"""Springs, dampers, limits, armature and friction of tendons of a MuJoCo model."""

import numpy as np

from gauss import math
from gauss.io.mjcf.names import Named
from gauss.io.mjcf.tendon_path import TendonPath, tendon_path
from gauss.scene import GROUND, Scene


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
