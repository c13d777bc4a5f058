"""Cases of one instant: accelerations beside references of 50 digits, or beside those of an equivalent scene."""

from dataclasses import dataclass, replace

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.methods import Method
from gauss.bench.problems import make_problem
from gauss.bench.reference import ReferenceSolution, reference
from gauss.bench.scenes import chain
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.io import load
from gauss.scene import Scene
from gauss.system import random_state

NOISE = 1e-8  # relative, on redundant rows
UNITS = ((1e3, 1e3), (1e6, 1e9), (1e-3, 1e-9))  # mm and g, µm and µg, km and Mt


@dataclass(frozen=True)
class KnownInstants:
    """Instants with what is right in them."""

    compulsions: tuple[Compulsion, ...]
    references: tuple[ReferenceSolution, ...]


def instants(*compulsions: Compulsion) -> KnownInstants:
    """Instants with their references."""
    return KnownInstants(compulsions, tuple(reference(compulsion) for compulsion in compulsions))


def worst_error(method: Method, known: KnownInstants) -> float:
    """Largest relative error of any body or joint in any of the instants."""
    pairs = zip(known.compulsions, known.references, strict=True)
    errors = [right.error(compulsion, method.instant(compulsion)) for compulsion, right in pairs]
    return float(np.max(errors))


def _problems(*names: str):
    return lambda: instants(*(make_problem(name).compulsion for name in names))


def _of(scene, seed: int = 0) -> Compulsion:
    system = compile_scene(scene)
    effort = np.random.default_rng(1).standard_normal(system.n_v)
    return assemble(system, random_state(system, np.random.default_rng(seed)), effort)


def _ratio(ratio: float):
    """Heavy tip, light tip and alternating masses, and a four-bar with a light rocker."""

    def prepare():
        masses = [1.0] * 9 + [ratio], [1.0] * 9 + [1 / ratio], [1.0, ratio] * 5
        scene = load("four_bar")
        scene.bodies["rocker"] = replace(scene.bodies["rocker"], mass=1 / ratio, inertia=(0, 0.1 / ratio, 0.1 / ratio))
        system = compile_scene(scene)
        return instants(*(_of(chain(m)) for m in masses), assemble(system, system.initial_state()))

    return prepare


def _chain(links: int):
    return lambda: instants(_of(load("spatial_chain", n=links)))


def _gimbal() -> KnownInstants:
    """Three rings, the inner two of a milligram, a body inside; 1e-6 rad from lock."""
    scene, on = Scene("gimbal"), "ground"
    rings = (("outer", 1e-6, (0, 0, 1)), ("middle", 1e-6, (0, 1, 0)), ("rotor", 1.0, (1, 0, 0)))
    for name, mass, axis in rings:
        scene.body(name, mass, (0.01 * mass, 0.02 * mass, 0.025 * mass))
        scene.revolute(f"to {name}", on, name, axis=axis)
        on = name
    system = compile_scene(scene)
    state = system.state([0.3, np.pi / 2 - 1e-6, 0.7], [1.0, -2.0, 30.0])
    return instants(assemble(system, state, [0.1, -0.2, 0.3]))


def _massless():
    scene = load("four_bar")
    scene.bodies["rocker"] = replace(scene.bodies["rocker"], mass=0.0, inertia=(0.0, 0.0, 0.0))
    systems = [compile_scene(scene)]
    scene = load("four_bar")
    scene.bodies["rocker"] = replace(scene.bodies["rocker"], mass=1e-14, inertia=(0.0, 1e-15, 1e-15))
    systems.append(compile_scene(scene))
    bare, light = (assemble(system, system.initial_state()) for system in systems)
    return bare, reference(light).qdd


def _massless_difference(method: Method, data) -> float:
    compulsion, expected = data
    return float(np.abs(method.instant(compulsion).qdd - expected).max() / np.abs(expected).max())


def _noisy():
    noisy = make_problem("noisy copies").compulsion
    system = compile_scene(load("four_bar"))
    return noisy, reference(assemble(system, system.initial_state())).qdd


def _moved_by_noise(method: Method, data) -> float:
    """Change of the accelerations by the noise, relative, over the noise."""
    compulsion, expected = data
    found = method.instant(compulsion).qdd[: expected.size]
    return float(np.abs(found - expected).max() / np.abs(expected).max() / NOISE)


def _units():
    """The same chain in SI and in other units, in the same state."""
    systems = [compile_scene(chain([1.0] * 6))]
    for length, mass in UNITS:
        systems.append(compile_scene(chain([mass] * 6, length, 9.81 * length)))
    state = random_state(systems[0], np.random.default_rng(0))
    compulsions = [assemble(system, system.state(state.q, state.v)) for system in systems]
    return compulsions[1:], reference(compulsions[0]).qdd


def _units_difference(method: Method, data) -> float:
    compulsions, expected = data
    found = [method.instant(compulsion).qdd for compulsion in compulsions]
    return float(max(np.abs(qdd - expected).max() for qdd in found) / np.abs(expected).max())


def _contradicting():
    """Four-bar whose doubled hinge asks for another acceleration."""
    compulsion = make_problem("noisy copies").compulsion
    D = compulsion.D.copy()
    D[compulsion.structure.constraints[compulsion.structure.closures[-1]].rows] += 0.01 * np.abs(D).max()
    return replace(compulsion, D=D)


def _between_floor_and_ceiling():
    """Box that a floor pushes up and a ceiling pushes down, faster than each other."""
    compulsion = make_problem("box on 4 points").compulsion
    return replace(compulsion, G=np.concatenate([compulsion.G, -compulsion.G]), h=np.repeat([0.0, -1.0], compulsion.h.size))


def _answered(method: Method, compulsion: Compulsion) -> float:
    method.instant(compulsion)
    return np.inf


LOOPS = ("four-bar", "ladder 10", "bricard")
BOXES = ("box on 4 points", "box on 8 points", "box about to tilt")
ERROR = "largest relative error of a body's or joint's acceleration"
INSTANTS = (
    *(
        FailureCase(f"mass ratio {r:.0e}", f"{ERROR}; chains and a loop", worst_error, _ratio(r))
        for r in (1e3, 1e6, 1e9, 1e12)
    ),
    *(FailureCase(f"chain of {n} links", ERROR, worst_error, _chain(n)) for n in (10, 100, 1000)),
    FailureCase("overconstrained loops", f"{ERROR}; four-bar, ladder, Bricard", worst_error, _problems(*LOOPS)),
    FailureCase(
        "near a singular point", f"{ERROR}; ladder 1e-6 rad from flat", worst_error, _problems("ladder 3 near flat"), 1e-8
    ),
    FailureCase("noise on redundant rows", "change of q̈ over the noise of 1e-8", _moved_by_noise, _noisy, 10.0, 1e3),
    FailureCase("contradicting rows", "said: there is no solution", _answered, _contradicting, solvable=False),
    FailureCase("stiff Baumgarte", f"{ERROR}; rate 1e5 1/s", worst_error, _problems("stiff Baumgarte")),
    FailureCase("huge and tiny units", "change of q̈ when mm, µm or km are used", _units_difference, _units),
    FailureCase("gimbal near lock", f"{ERROR}; rings of a milligram", worst_error, _gimbal),
    FailureCase("link without inertia", "change of q̈ beside a link of 1e-14 kg", _massless_difference, _massless),
    FailureCase("contact at 4 and 8 points", ERROR, worst_error, _problems(*BOXES)),
    FailureCase("three stops", ERROR, worst_error, _problems("three stops")),
    FailureCase("floor and ceiling", "said: there is no solution", _answered, _between_floor_and_ceiling, solvable=False),
)
