"""Random scenes to be moved: a tree, a chain or loops, with a few elements of any kind put on them.

A scene is given by a seed and its number, so that each can be made again by itself, also without some of its elements.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss import compile_scene
from gauss.bench.fuzz.laws import random_law
from gauss.bench.fuzz.problems import CLOSING, decades, polygon, put_body, put_joint, random_tree
from gauss.scene import GROUND, Joint, Scene
from gauss.scene.profiles import Move, Ramp, Sine
from gauss.system import System

ODD_UNITS = 0.03  # share of scenes whose sizes are 1e-6 to 1e6 m
MASSLESS = 0.08  # share of scenes with a cross without mass


@dataclass(frozen=True)
class MovedScene:
    """A random scene, and the settings of its motion.

    Attributes
    ----------
    system : System
        The compiled scene, made when it is first asked for; all routes move it.
    """

    scene: Scene  # what moves
    base: str  # what it was made from
    elements: tuple  # what was put on it
    size: float  # of its bodies [m]
    duration: float  # how long it moves [s]
    times: np.ndarray  # samples [s]
    integrator: str
    step: float | None  # step of methods that have one [s]

    @cached_property
    def system(self) -> System:  # noqa: D102 (an attribute)
        return compile_scene(self.scene)


def moved_scene(seed: int, number: int, without: tuple = ()) -> MovedScene:
    """Random scene of a seed and number, without some elements by name."""
    rng = np.random.default_rng((seed, number, 1))
    size = 1.0 if rng.random() > ODD_UNITS else decades(rng, -6, 6)
    base = str(rng.choice(list(BASES), p=[0.35, 0.35, 0.15, 0.08, 0.07]))
    scene = BASES[base](rng, size)
    duration = decades(rng, -1.3, 0.0)
    there = _There(scene, rng, size, duration)
    if rng.random() < MASSLESS:
        there.cross()
    put = 0
    for _ in range(rng.integers(1, 5)):
        while len(there.names) == put:  # what needs a joint of one freedom finds none on some trees
            getattr(there, str(rng.choice(KINDS)))()
        put = len(there.names)
    there.starts(base in ("polygon", "loop"))
    integrator = str(rng.choice(list(INTEGRATORS), p=SHARES))
    if scene.nonsmooth and rng.random() < 0.9:  # the others say that they do not take these
        integrator = "dop853"
    step = float(INTEGRATORS[integrator][1]) or None
    if any(getattr(contact, "friction", 0.0) for contact in scene.contacts.values()):
        integrator, step = "time_stepping", 2e-3
    times = np.sort(duration * rng.uniform(0.02, 0.98, 6))
    found = reduced(scene, without) if without else scene
    return MovedScene(found, base, tuple(there.names), size, duration, np.append(times, duration), integrator, step)


def reduced(scene: Scene, without: tuple) -> Scene:
    """Scene without some elements, by name; starts are named "start JOINT"."""
    left = Scene(scene.name, scene.gravity)
    groups = ("bodies", "frames", "joints", "couplings", "relations", "shapes", "contacts", "set_valued", "loads")
    for element in (element for group in groups for element in getattr(scene, group).values()):
        if element.name not in without:
            left.add(element)
    for joint, start in scene.starts.items():
        if f"start {joint}" not in without:
            left.add(start)
    return left


def _chain(rng, size: float) -> Scene:
    scene, before = Scene("chain", gravity=_gravity(rng, size)), GROUND
    along = rng.random() < 0.5  # all hinges parallel
    for i in range(rng.integers(1, 5)):
        put_body(scene, rng, f"body{i}", ((i + 0.5) * size, 0.0, 0.0), size, 0.5)
        kind = str(rng.choice(["revolute", "revolute", "prismatic"]))
        axis = (0.0, 1.0, 0.0) if along and kind == "revolute" else tuple(rng.standard_normal(3))
        scene.joint(f"joint{i}", kind, before, f"body{i}", at=(i * size, 0.0, 0.0), axis=axis)
        before = f"body{i}"
    return scene


def _floating(rng, size: float) -> Scene:
    scene = Scene("floating", gravity=_gravity(rng, size))
    for i in range(rng.integers(1, 4)):
        put_body(scene, rng, f"body{i}", (2.0 * i * size, 0.0, size * rng.uniform(0.5, 2.0)), size, 0.5)
        scene.free(f"joint{i}", GROUND, f"body{i}", at=scene.bodies[f"body{i}"].position)
    return scene


def _tree(rng, size: float) -> Scene:
    return random_tree(rng, 4, 0.5, size)[0]


def _polygon(rng, size: float) -> Scene:
    return polygon(rng, 1.0, size)[0]


def _loop(rng, size: float) -> Scene:
    scene, _, places = random_tree(rng, 4, 0.5, size)
    child = int(rng.integers(0, len(places)))
    at = places[child] + 0.3 * size * rng.standard_normal(3)
    put_joint(scene, rng, "closing", GROUND, f"body{child}", at, size, CLOSING)
    return scene


def _gravity(rng, size: float) -> tuple:
    down = np.array([0.0, 0.0, -10.0]) if rng.random() < 0.7 else rng.standard_normal(3)
    return tuple(size * down * (rng.random() < 0.8))


BASES = {"tree": _tree, "chain": _chain, "floating": _floating, "polygon": _polygon, "loop": _loop}


class _There:
    """A scene that elements are put on; every method but :meth:`starts` puts one there, if it finds where."""

    def __init__(self, scene: Scene, rng, size: float, span: float):
        self.scene, self.rng, self.size, self.span = scene, rng, size, span
        self.names: list[str] = []
        self.bodies = list(scene.bodies)
        mass = float(np.mean([body.mass for body in scene.bodies.values()]))
        self.force, self.torque = 10.0 * mass * size, 10.0 * mass * size**2

    # What elements are made from.

    def name(self, what: str) -> str:
        self.names.append(what)
        return f"{what} {len(self.names)}"

    def body(self) -> str:
        return str(self.rng.choice(self.bodies))

    def point(self) -> tuple:
        return tuple(0.4 * self.size * self.rng.standard_normal(3))

    def joint(self) -> str | None:
        """One of those of one freedom."""
        simple = [name for name, joint in self.scene.joints.items() if joint.pair.n_v == 1]
        return str(self.rng.choice(simple)) if simple else None

    def unit(self, joint: str) -> float:
        return self.size if self.scene.joints[joint].kind == "prismatic" else 1.0

    def units(self, joint: Joint) -> np.ndarray:
        """Size of every rate of a joint: angles know no size."""
        turning, _ = joint.pair.subspace(np.array(joint.pair.reference))
        return np.where(turning.any(axis=0), 1.0, self.size)

    def effort(self, joint: str) -> float:
        return self.force if self.scene.joints[joint].kind == "prismatic" else self.torque

    def feel(self):
        joint, body, size, axis = self.joint(), self.body(), self.size, int(self.rng.integers(0, 3))
        if joint is None or self.rng.random() < 0.2:
            begin = self.scene.bodies[body].position[axis]
            return lambda motion: ((motion.position(body)[axis] - begin) / size, motion.velocity(body)[axis] / size)
        unit = self.unit(joint)
        return lambda motion: (motion.coordinate(joint) / unit, motion.rate(joint) / unit)

    def law(self, strength: float):
        name, law = random_law(self.rng, strength, self.span, self.feel())
        self.names.append(name)
        return law

    def smooth(self, scale: float, rate: bool):
        """Law of time for a motion; of a coordinate it begins at zero."""
        rng, span = self.rng, self.span
        begin = span * rng.uniform(0.0, 0.8)
        laws: list = [Sine(scale, rng.uniform(0.2, 2.0) / span), Move(0.0, scale, span * rng.uniform(0.1, 1.0), begin)]
        laws += [float(scale)] if rate else [Ramp(0.0, scale)]
        return laws[rng.integers(0, len(laws))]

    # Loads.

    def drive(self):
        if (joint := self.joint()) is not None:
            limit = {"limit": 0.5 * self.effort(joint)} if self.rng.random() < 0.2 else {}
            key = "force" if self.scene.joints[joint].kind == "prismatic" else "torque"
            self.scene.drive(joint, **{key: self.law(self.effort(joint))}, **limit, name=self.name("drive"))

    def push(self):
        along, law = self.rng.standard_normal(3), self.law(self.force)
        along /= np.linalg.norm(along)
        whole: Callable | tuple
        if callable(law):
            given = law.__code__.co_argcount if hasattr(law, "__code__") else 1
            whole = (lambda t: along * law(t)) if given == 1 else (lambda t, motion: along * law(t, motion))
        else:
            whole = tuple(along * law)
        axes = str(self.rng.choice(["world", "body"]))
        self.scene.force(self.name("force"), self.body(), whole, at=self.point(), axes=axes)

    def spring(self):
        body, other = self.body(), str(self.rng.choice([GROUND, *self.bodies]))
        if body != other:
            stiffness = self.force / self.size * decades(self.rng, -1, 2)
            options = {"damping": 0.1 * stiffness * self.rng.random(), "length": self.size * self.rng.random()}
            self.scene.spring(self.name("spring"), body, other, self.point(), self.point(), stiffness=stiffness, **options)

    def joint_spring(self):
        if (joint := self.joint()) is not None:
            stiffness = self.effort(joint) / self.unit(joint) * decades(self.rng, -1, 2)
            options = {"damping": 0.1 * stiffness * self.rng.random(), "rest": self.unit(joint) * self.rng.normal()}
            self.scene.joint_spring(self.name("joint_spring"), joint, stiffness=stiffness, **options)

    # Constraints.

    def relation(self):
        rng, body, axis = self.rng, self.body(), self.rng.standard_normal(3)
        kind = str(rng.choice(["distance", "on_plane", "blade", "sphere", "couple", "cam", "distance law"]))
        if kind == "distance":
            self.scene.distance(self.name(kind), body, GROUND, self.point(), tuple(2.0 * self.size * axis))
        elif kind == "distance law":
            length, grown = 2.0 * self.size, self.smooth(0.3 * self.size, True)
            law = (lambda t: length + grown(t)) if callable(grown) else length
            self.scene.distance(self.name(kind), body, GROUND, (0, 0, 0), self.beside(body, length), length=law)
        elif kind == "on_plane":
            self.scene.on_plane(
                self.name(kind), body, GROUND, (0, 0, 0), self.scene.bodies[body].position, normal=tuple(axis)
            )
        elif kind == "blade":
            self.scene.constrain(self.name(kind), velocity=lambda at: axis @ at.velocity(body))
        elif kind == "sphere":
            middle, radius = np.array(self.beside(body, self.size)), self.size
            place = lambda at: at.position(body) - middle  # noqa: E731
            self.scene.constrain(self.name(kind), lambda at: (place(at) @ place(at) - radius**2) / radius)
        elif (pair := self.pair()) is not None:
            ratio = self.unit(pair[0]) / self.unit(pair[1]) * rng.normal()
            if kind == "couple":
                self.scene.couple(self.name(kind), pair[0], pair[1], ratio=ratio)
            else:
                unit, high = self.unit(pair[1]), 0.3 * self.unit(pair[0])
                self.scene.cam(self.name(kind), pair[1], pair[0], lambda x: high * np.sin(x / unit))

    def beside(self, body: str, far: float) -> tuple:
        along = self.rng.standard_normal(3)
        return tuple(np.array(self.scene.bodies[body].position) + far * along / np.linalg.norm(along))

    def pair(self) -> tuple | None:
        one, other = self.joint(), self.joint()
        return (one, other) if one != other else None

    def prescribed(self):
        if (joint := self.joint()) is not None:
            key = str(
                self.rng.choice(["speed", "displacement" if self.scene.joints[joint].kind == "prismatic" else "angle"])
            )
            law = self.smooth(self.unit(joint) * self.rng.normal(), key == "speed")
            self.scene.drive(joint, **{key: law}, name=self.name("prescribed"))

    def stop(self):
        if (joint := self.joint()) is not None:
            low, high = self.unit(joint) * self.rng.uniform(0.05, 1.0, 2)
            sides = {"lowest": -low, "highest": high}
            sides.pop(str(self.rng.choice(["lowest", "highest", "none"])), None)
            self.scene.stop(joint, **sides, restitution=self.restitution(), name=self.name("stop"))

    def one_sided(self):
        body, axis = self.body(), int(self.rng.integers(0, 3))
        least = self.scene.bodies[body].position[axis] - self.size * self.rng.uniform(0.0, 1.0)
        self.scene.one_sided(self.name("one_sided"), lambda at: at.position(body)[axis] - least, self.restitution())

    def rope(self):
        body, far = self.body(), self.size * self.rng.uniform(0.5, 2.0)
        self.scene.rope(self.name("rope"), body, GROUND, (0, 0, 0), self.beside(body, far), 1.1 * far, self.restitution())

    def contact(self):
        rng, body, name = self.rng, self.body(), self.name("contact")
        radius, position = 0.3 * self.size, np.array(self.scene.bodies[body].position)
        self.scene.sphere(f"{name} ball", body, radius)
        if len(self.bodies) > 1 and rng.random() < 0.4:
            other = str(rng.choice([one for one in self.bodies if one != body]))
            self.scene.sphere(f"{name} other", other, 0.1 * self.size)
        else:
            under = tuple(position - (0.0, 0.0, radius + self.size * rng.uniform(0.0, 1.0) * (rng.random() < 0.8)))
            self.scene.half_space(f"{name} other", at=under, normal=(0.3 * rng.normal() * (rng.random() < 0.3), 0.0, 1.0))
        friction = float(rng.uniform(0.05, 1.0)) if rng.random() < 0.3 else 0.0
        self.scene.contact(name, f"{name} ball", f"{name} other", self.restitution(), friction)

    def restitution(self) -> float:
        return float(self.rng.choice([0.0, 0.5, 0.9, self.rng.random()]))

    def friction(self):
        if (joint := self.joint()) is not None:
            limit = self.effort(joint) * decades(self.rng, -2, 0.5)
            self.scene.joint_friction(joint, limit, name=self.name("joint_friction"))

    def limited(self):
        if (joint := self.joint()) is not None:
            speed, limit = (
                self.smooth(self.unit(joint) * self.rng.normal(), True),
                self.effort(joint) * decades(self.rng, -2, 0.5),
            )
            self.scene.drive(joint, speed=speed, limit=limit, name=self.name("limited"))

    def link(self):
        if (pair := self.pair()) is not None and self.unit(pair[0]) == self.unit(pair[1]):
            if self.rng.random() < 0.5:
                torque = self.effort(pair[0]) * decades(self.rng, -2, 0)
                self.scene.clutch(self.name("clutch"), pair[0], pair[1], torque=torque)
            else:
                self.scene.freewheel(self.name("freewheel"), *pair)

    # Bodies without mass, and starts.

    def cross(self):
        """Body that hangs on another by a cross without mass and two hinges."""
        on, place = self.body(), self.point()
        self.scene.body("cross", 0.0, position=place)
        put_body(self.scene, self.rng, "hung", self.point(), self.size, 0.3)
        self.scene.revolute("first of cross", on, "cross", at=place, axis=(1.0, 0.0, 0.0))
        self.scene.revolute("second of cross", "cross", "hung", at=place, axis=(0.0, 1.0, 0.0))
        self.bodies.append("hung")
        self.names.append("cross")

    def starts(self, closed: bool):
        """Rates of most joints and positions of some; where loops close, the rate of one."""
        rng, joints = self.rng, list(self.scene.joints.values())
        if rng.random() < 0.25:  # at rest
            return
        for joint in [joints[rng.integers(0, len(joints))]] if closed else joints:
            if joint.pair.n_v and joint.kind != "fixed" and rng.random() < 0.8:
                rate = self.units(joint) * rng.standard_normal(joint.pair.n_v)
                turned = joint.pair.n_v == 1 and not closed and rng.random() < 0.3
                position = self.unit(joint.name) * 0.3 * rng.normal() if turned else None
                self.scene.start(joint.name, position, tuple(rate) if joint.pair.n_v > 1 else rate[0])


KINDS: tuple[str, ...] = ("drive",) * 4 + ("push",) * 3
KINDS += ("spring", "joint_spring", "joint_spring", "relation", "relation", "prescribed")
KINDS += ("stop", "one_sided", "rope", "contact", "contact", "friction", "limited", "link")
INTEGRATORS = {  # their shares, and steps [s]
    "dop853": (0.66, 0.0),
    "dopri5": (0.06, 0.0),
    "radau5": (0.06, 0.0),
    "taylor": (0.05, 0.0),
    "rk4": (0.03, 2e-3),
    "semi_implicit_euler": (0.01, 2e-3),
    "verlet": (0.02, 2e-3),
    "variational_midpoint": (0.01, 2e-3),
    "gauss4": (0.02, 4e-3),
    "generalised_alpha": (0.01, 2e-3),
    "energy_momentum": (0.02, 2e-3),
    "time_stepping": (0.02, 2e-3),
    "scipy_lsoda": (0.01, 0.0),
    "cvode_bdf": (0.01, 0.0),
    "ida": (0.01, 0.0),
}
SHARES = [share for share, _ in INTEGRATORS.values()]
