"""Cases of contacts: many and redundant points, a stack of unequal masses, friction that reverses."""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.instants import ERROR, KnownInstants, instants, worst_error
from gauss.bench.atlas.methods import Method
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.scene import Scene
from gauss.simulation import simulate

EDGE = 0.2  # of a box [m]
PUSH, PERIOD, TURNS, STEP = 8.0, 0.4, 3, 2.5e-3  # force on a block [N], its period [s], its halves, step [s]
FRICTION = 2.0  # on the block [N]


def _free(scene: Scene, name: str, mass: float, height: float, size) -> None:
    squares = np.array(size) ** 2
    scene.body(name, mass, tuple(mass / 12.0 * (squares.sum() - squares)))
    scene.free(f"{name} floats", "ground", name)
    scene.start(f"{name} floats", position=(0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0))


def _instant(scene: Scene, efforts: dict[str, float]) -> Compulsion:
    """Compulsion at the start; efforts by names of rates."""
    system = compile_scene(scene)
    tau = np.zeros(system.n_v)
    for rate, effort in efforts.items():
        tau[system.coordinates.index(rate)] = effort
    return assemble(system, system.initial_state(), tau)


def _feet(count: int) -> KnownInstants:
    """A plate of 2 kg on a grid of feet, with a moment and a force along the floor."""
    scene, mass = Scene("plate on feet"), 2.0
    line = np.linspace(-0.5, 0.5, count)
    scene.half_space("floor")
    _free(scene, "plate", mass, 0.0, (1.0, 1.0, 0.05))
    scene.points("feet", "plate", [(x, y, 0.0) for x in line for y in line])
    scene.contact("stands", "feet", "floor")
    first, *_ = compile_scene(scene).coordinates
    return instants(_instant(scene, {first: 3.0}))


def _in_a_corner() -> KnownInstants:
    """A box that a floor and two walls hold at twelve points, three times as many as it needs."""
    scene = Scene("box in a corner")
    _free(scene, "box", 2.0, 0.0, (EDGE,) * 3)
    scene.points("corners", "box", EDGE * (np.array(list(np.ndindex(2, 2, 2))) - 0.5))
    for name, normal in (("floor", (0, 0, 1)), ("west", (1, 0, 0)), ("south", (0, 1, 0))):
        scene.half_space(name, at=tuple(-0.5 * EDGE * np.array(normal)), normal=normal)
        scene.contact(f"on {name}", "corners", name)
    x, y, *_ = compile_scene(scene).coordinates
    return instants(_instant(scene, {x: -3.0, y: -2.0}))


def _stack(ratio: float):
    """Three boxes on each other, each heavier than that below it; a force along the floor on each."""

    def prepare() -> KnownInstants:
        scene, names, below = Scene("stack"), ("low", "middle", "high"), "floor"
        scene.half_space("floor")
        for k, name in enumerate(names):
            _free(scene, name, np.sqrt(ratio) ** k, EDGE * (k + 0.5), (EDGE,) * 3)
            scene.points(f"feet of {name}", name, [(x, y, -0.5 * EDGE) for x in (-0.1, 0.1) for y in (-0.1, 0.1)])
            scene.contact(f"{name} stands", f"feet of {name}", below)
            below = f"lid of {name}"
            scene.half_space(below, name, at=(0, 0, 0.5 * EDGE))
        return instants(_instant(scene, {f"{name} floats.x": 0.1 * np.sqrt(ratio) ** k for k, name in enumerate(names)}))

    return prepare


def _reversals(method: Method, _) -> float:
    """A block of 1 kg with friction that a force of alternating sign pushes: it slides to and fro; where it ends."""
    scene = Scene("to and fro", gravity=(0.0, 0.0, -10.0))
    scene.body("block", 1.0)
    scene.prismatic("rail", "ground", "block", axis=(1, 0, 0))
    scene.joint_friction("rail", FRICTION)
    half = 0.5 * PERIOD
    scene.drive("rail", force=lambda t: PUSH if int(t / half + 1e-9) % 2 == 0 else -PUSH)
    end = half * TURNS
    found = simulate(scene, end, integrator="time_stepping", step=STEP, backend=method.backend, progress=False)
    x = v = t = 0.0
    for k in range(TURNS):
        push, after = PUSH * (-1) ** k, half * (k + 1)
        while t < after - 1e-12:
            a = push - FRICTION * np.sign(v or push)
            span = after - t if v * a >= 0.0 else min(after - t, -v / a)
            x, v, t = x + v * span + 0.5 * a * span**2, v + a * span, t + span
            v = 0.0 if abs(v) < 1e-12 else v
    return float(abs(found.q[-1, 0] - x) / abs(x))


CONTACTS = (
    FailureCase("a hundred contacts", f"{ERROR}; a plate on 100 feet", worst_error, lambda: _feet(10)),
    FailureCase("redundant contacts", f"{ERROR}; a box in a corner", worst_error, _in_a_corner),
    FailureCase("stack, mass ratio 1e6", f"{ERROR}; three boxes", worst_error, _stack(1e6)),
    FailureCase(
        "sliding reversals",
        "error of the place of a block, time stepping, of first order there",
        _reversals,
        passes=5e-3,
        fails=1e-1,
    ),
)
