"""Random Gauss problems: trees, loops, loops that nearly fold, redundant rows with noise, stops and contacts.

A problem is given by a seed and its number, so that each can be made again by itself. Loops are closed where they stand:
every joint is said at the reference configuration, and rates are drawn among those that the rows allow.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.motions import allowed
from gauss.bench.scenes import chain
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.scene import Scene
from gauss.system import System, random_state

PAIRS = ("revolute", "prismatic", "cylindrical", "universal", "ball", "planar", "screw", "fixed", "free")
CLOSING = ("revolute", "ball", "cylindrical", "universal", "prismatic")


def fuzzed(seed: int, number: int) -> tuple[str, Compulsion]:
    """Kind and compulsion of a random problem; the kinds take turns."""
    kind = list(KINDS)[number % len(KINDS)]
    return kind, KINDS[kind](np.random.default_rng((seed, number)))


def decades(rng, lowest: float, highest: float) -> float:
    """Number whose logarithm is uniform between those of 10^lowest and 10^highest."""
    return float(10.0 ** rng.uniform(lowest, highest))


def put_body(scene: Scene, rng, name: str, place, size: float, spread: float):
    """Body of random mass, moments that a body can have, and random principal axes."""
    mass = decades(rng, -spread, spread)
    squares = mass * size**2 * rng.uniform(1e-3, 0.2, 3)  # second moments of its mass along its axes
    turn = tuple(rng.uniform(-np.pi, np.pi, 3))
    scene.body(name, mass, tuple(squares.sum() - squares), position=tuple(place), rotation=turn)


def put_joint(scene: Scene, rng, name: str, parent: str, child: str, at, size: float, kinds=PAIRS):
    """Joint of a random kind along a random axis."""
    kind = str(rng.choice(kinds))
    options = {} if kind in ("ball", "fixed", "free") else {"axis": tuple(rng.standard_normal(3))}
    options |= {"pitch": size * rng.uniform(0.01, 0.3)} if kind == "screw" else {}
    scene.joint(name, kind, parent, child, at=tuple(at), **options)


def random_tree(rng, most: int = 8, spread: float | None = None, size: float | None = None) -> tuple[Scene, float, list]:
    """Tree of bodies at random places; also its size [m] and these places."""
    size = decades(rng, -3, 3) if size is None else size
    scene = Scene("tree", gravity=tuple(size * rng.standard_normal(3) * 10))
    spread = rng.choice([0.3, 2.0, 4.0]) if spread is None else spread
    places: list[np.ndarray] = []
    for i in range(rng.integers(1, most + 1)):
        on = int(rng.integers(-1, i)) if rng.random() < 0.3 else i - 1
        before = places[on] if on >= 0 else np.zeros(3)
        places.append(before + size * rng.standard_normal(3))
        put_body(scene, rng, f"body{i}", places[-1], size, spread)
        at = before + (places[-1] - before) * rng.uniform(0.2, 0.8) + 0.2 * size * rng.standard_normal(3)
        put_joint(scene, rng, f"joint{i}", f"body{on}" if on >= 0 else "ground", f"body{i}", at, size)
    return scene, size, places


def _effort(system: System, rng, strength: float):
    return strength * rng.standard_normal(system.n_v) * decades(rng, -3, 3)


def _strength(system: System, size: float) -> float:
    """Force that gives the mean mass an acceleration of ten sizes per square second."""
    return 10.0 * size * float(system.Phi.reshape(-1, 6)[:, 3].mean())


def _anywhere(scene: Scene, rng, size: float) -> Compulsion:
    system = compile_scene(scene)
    state = random_state(system, rng, slide=0.5 * size, speed=decades(rng, -2, 2))
    return assemble(system, state, _effort(system, rng, _strength(system, size)))


def _where_it_stands(scene: Scene, rng, size: float) -> Compulsion:
    """Compulsion at the reference configuration, with rates that the rows allow."""
    system = compile_scene(scene)
    at_rest = system.state()
    rates = allowed(Factor(assemble(system, at_rest))).rates
    v = rates @ rng.standard_normal(rates.shape[1])
    turning = max(float(np.abs(v).max(initial=0.0)), 1e-300)
    v *= decades(rng, -2, 1) * max(1.0, size) / turning if v.any() else 0.0
    return assemble(system, system.state(v=v), _effort(system, rng, _strength(system, size)))


def _tree(rng) -> Compulsion:
    """Up to eight bodies of masses up to eight orders apart, joints of every kind, a millimetre to a kilometre, anywhere."""
    scene, size, _ = random_tree(rng)
    return _anywhere(scene, rng, size)


def _mass_ratios(rng) -> Compulsion:
    """Chains whose masses rise, fall or alternate by up to twelve orders."""
    links, ratio = int(rng.integers(2, 11)), decades(rng, 3, 12)
    orders = {"rise": np.linspace(0, 1, links), "fall": np.linspace(1, 0, links), "turn": np.arange(links) % 2}
    orders["tip"] = np.arange(links) == links - 1
    masses = ratio ** orders[str(rng.choice(list(orders)))].astype(float)
    return _anywhere(chain([float(mass) for mass in masses]), rng, 1.0)


def _loop(rng) -> Compulsion:
    """Tree closed by one to three joints between its bodies or to the ground."""
    scene, size, places = random_tree(rng)
    for k in range(rng.integers(1, 4)):
        child = int(rng.integers(0, len(places)))
        parent = int(rng.integers(-1, child)) if child else -1
        at = places[child] + 0.3 * size * rng.standard_normal(3)
        put_joint(scene, rng, f"closing{k}", f"body{parent}" if parent >= 0 else "ground", f"body{child}", at, size, CLOSING)
    return _where_it_stands(scene, rng, size)


def polygon(rng, fold: float, size: float | None = None) -> tuple[Scene, float]:
    """Links in a plane, hinged end to end: three rows are redundant. ``fold`` is how far they are from one line."""
    size = decades(rng, -2, 2) if size is None else size
    links = int(rng.integers(3, 7))
    corners = size * rng.uniform(-1.0, 1.0, (links + 1, 2)) * (1.0, fold)
    scene = Scene("polygon", gravity=(0.0, -10.0 * size, 0.0))
    for i in range(links):
        middle = (*(corners[i] + corners[i + 1]) / 2, 0.0)
        mass = decades(rng, -2, 2)
        scene.body(f"link{i}", mass, tuple(mass * size**2 * np.array([0.1, 0.2, 0.3])), position=middle)
        scene.revolute(f"hinge{i}", f"link{i - 1}" if i else "ground", f"link{i}", at=(*corners[i], 0.0))
    scene.revolute("last", f"link{links - 1}", "ground", at=(*corners[-1], 0.0))
    return scene, size


def _planar_loop(rng) -> Compulsion:
    """Polygon of three to six hinged links: three rows are redundant."""
    scene, size = polygon(rng, 1.0)
    return _where_it_stands(scene, rng, size)


def _nearly_folded(rng) -> Compulsion:
    """Loop whose hinges lie within 10⁻¹ to 10⁻¹² of one line, where rows lose rank."""
    scene, size = polygon(rng, decades(rng, -12, -1))
    return _where_it_stands(scene, rng, size)


def _said_twice(rng) -> Compulsion:
    """Planar loop with a repeated hinge and noise of up to 10⁻³ on the right-hand sides of the rows."""
    scene, size = polygon(rng, 1.0)
    scene.add(replace(scene.joints["last"], name="again"))
    compulsion = _where_it_stands(scene, rng, size)
    D = compulsion.D.copy()
    rows = compulsion.structure.constraints[-1].rows
    D[rows] += decades(rng, -15, -3) * np.abs(D).max() * rng.standard_normal(6)
    return replace(compulsion, D=D)


def _coupled(rng) -> Compulsion:
    """Chain of hinges, neighbours coupled by gears, some of them twice."""
    links = int(rng.integers(3, 8))
    scene = chain([decades(rng, -2, 2) for _ in range(links)])
    for k in range(rng.integers(1, links - 1)):
        scene.couple(f"gear{k}", f"joint{k + 1}", f"joint{k}", ratio=decades(rng, -1, 1))
    return _where_it_stands(scene, rng, 1.0)


def _stops(rng) -> Compulsion:
    """Chain some of whose joints stand at stops."""
    links = int(rng.integers(2, 8))
    scene = chain([decades(rng, -1, 1) for _ in range(links)])
    for k in range(links):
        if rng.random() < 0.6:
            scene.stop(f"joint{k}", **dict[str, Any]({str(rng.choice(["highest", "lowest"])): 0.0}))
    system = compile_scene(scene)
    return assemble(system, system.state(), _effort(system, rng, _strength(system, 1.0)))


def _box(rng) -> Compulsion:
    """Box that stands on three to ten points, pushed about."""
    size, mass = decades(rng, -2, 2), decades(rng, -3, 3)
    edges = size * rng.uniform(0.2, 1.0, 3)
    squares = edges**2
    scene = Scene("box", gravity=(0.0, 0.0, -10.0 * size))
    scene.body("box", mass, tuple(mass / 12 * (squares.sum() - squares)), position=(0, 0, edges[2] / 2))
    scene.free("float", "ground", "box")
    feet = rng.uniform(-0.5, 0.5, (rng.integers(3, 11), 3)) * edges
    feet[:, 2] = -edges[2] / 2
    scene.points("feet", "box", feet)
    scene.half_space("floor")
    scene.contact("stands", "feet", "floor")
    system = compile_scene(scene)
    load = 10.0 * mass * size * rng.standard_normal(6) * decades(rng, -2, 1)
    load[3:] *= 1.0 if rng.random() < 0.5 else size
    return assemble(system, system.start(), load)


KINDS: dict[str, Callable] = {
    "tree": _tree,
    "mass ratios": _mass_ratios,
    "loop": _loop,
    "planar loop": _planar_loop,
    "nearly folded": _nearly_folded,
    "said twice": _said_twice,
    "coupled": _coupled,
    "stops": _stops,
    "box": _box,
}
