"""Gauss problems of real mechanisms, from gentle to nearly inconsistent; each with its difficulty."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.bench.scenes import chain
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble, position_residual
from gauss.dynamics.kinematics import kinematics
from gauss.errors import BackendError, did_you_mean
from gauss.io import load
from gauss.scene import Scene
from gauss.system import State, System, random_state

FLAT_ANGLE = 1e-6  # [rad], how far the ladder of four-bars is from its flat configuration
STABILISATION_RATE = 1e5  # [1/s], rate of Baumgarte's stabilisation
STABILISED_ANGLE = 1e-6  # [rad], what the stabilised state is off
EDGES = np.array([1.0, 0.6, 0.4])  # of a box [m], its centre of mass in the middle
NOISE = 1e-8  # relative, of the rows of redundant constraints
SOLVABLE, INCONSISTENT, UNKNOWN = "solvable", "inconsistent", "unknown"  # verdicts; the last of files without any


@dataclass(frozen=True)
class MechanismProblem:
    """One compulsion with its name."""

    name: str
    note: str  # what it is, and what is hard about it
    compulsion: Compulsion
    # system, state: where it comes from, if the compulsion is that of a system in a state and nothing else
    system: System | None = None
    state: State | None = None
    load: np.ndarray | None = None  # generalised forces that act there [N m, N]
    verdict: str = SOLVABLE  # "solvable", or "inconsistent" where no accelerations meet all rows: there is no reference then


@dataclass(frozen=True)
class Entry:
    """A problem that can be made: what it is, and how."""

    note: str
    make: Callable[[], MechanismProblem]


SELECTION: dict[str, Entry] = {}


def selected(name: str, verdict: str = SOLVABLE) -> Callable:
    """Register a function that makes a problem under a name; its docstring is the note."""

    def enter(function):
        note = function.__doc__.strip().rstrip(".")
        SELECTION[name] = Entry(note, lambda: replace(_made(name, note, function()), verdict=verdict))
        return function

    return enter


def make_problem(name: str) -> MechanismProblem:
    """Problem of the selection by name; BackendError if there is none."""
    if name not in SELECTION:
        raise BackendError(f"no problem {name!r}. {did_you_mean(name, SELECTION)}")
    return SELECTION[name].make()


def _made(name: str, note: str, parts) -> MechanismProblem:
    if isinstance(parts, Compulsion):
        return MechanismProblem(name, note, parts)
    system, state = parts
    effort = np.random.default_rng(1).standard_normal(system.n_v)
    return MechanismProblem(name, note, assemble(system, state, effort), system, state, effort)


def _anywhere(scene) -> tuple[System, State]:
    """A tree in a random state, its couplings met."""
    system = compile_scene(scene)
    state = random_state(system, np.random.default_rng(0))
    return system, system.initial_state(state.q, state.v) if system.has_closures else state


def _started(scene) -> tuple[System, State]:
    """A mechanism with loops at its own start."""
    system = compile_scene(scene)
    return system, system.initial_state()


@selected("panda")
def panda():
    """Serial arm of seven joints."""
    return _anywhere(load("robot:panda"))


@selected("ur5")
def ur5():
    """Serial arm of six joints."""
    return _anywhere(load("robot:ur5"))


@selected("talos")
def talos():
    """Humanoid of 32 joints on a free base."""
    return _anywhere(load("robot:talos", root="free"))


@selected("chain 50")
def long_chain():
    """Spatial chain of 50 links: the reduced form is ill conditioned."""
    return _anywhere(load("spatial_chain", n=50))


@selected("four-bar")
def four_bar():
    """Planar loop of spatial hinges: 3 redundant rows."""
    return _started(load("four_bar"))


@selected("ladder 10")
def ladder():
    """Ten windows of hinges: 30 redundant rows."""
    return _started(load("n_four_bar", n=10))


@selected("ladder 3 near flat")
def flat_ladder():
    """Three windows 1e-6 rad from the flat configuration, where rows lose rank."""
    system = compile_scene(load("n_four_bar", n=3))
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    return system, system.state(-(np.pi / 2 - FLAT_ANGLE) * signs, -2.0 * signs)


@selected("stewart")
def stewart():
    """Platform on six legs with springs."""
    return _started(load("stewart_platform"))


@selected("bricard")
def bricard():
    """Six skew hinges, immobile by counting: one row redundant only in the poses it can reach."""
    return _started(load("bricard"))


@selected("heavy tip 1e9")
def heavy_tip():
    """Nine links of 1 kg carry one of 1e9 kg."""
    return _anywhere(chain([1.0] * 9 + [1e9]))


@selected("light tip 1e-9")
def light_tip():
    """Nine links of 1 kg carry one of 1e-9 kg: no residual in newtons notices it."""
    return _anywhere(chain([1.0] * 9 + [1e-9]))


@selected("alternating 1e6")
def alternating():
    """Ten links of 1 kg and 1e6 kg in turn."""
    return _anywhere(chain([1.0, 1e6] * 5))


@selected("mm and g")
def small_units():
    """Six links in millimetres and grams: entries from 1 to 1e9."""
    return _anywhere(chain([1000.0] * 6, length=1000.0, gravity=9810.0))


@selected("stiff Baumgarte")
def stiff():
    """Four-bar off its constraints by 1e-6 rad, pulled back at 1e5 1/s: the right-hand side outweighs all else."""
    system, state = _started(load("four_bar"))
    off = replace(state, q=state.q + STABILISED_ANGLE * np.random.default_rng(0).standard_normal(state.q.size))
    compulsion, motion = assemble(system, off), kinematics(system, off)
    moving = compulsion.about_rest().residuals(motion.quasi_velocities(), off.v, np.zeros(compulsion.D.size))[1]
    closures = np.zeros(compulsion.D.size)
    for i in system.structure.closures:
        closures[system.structure.constraints[i].rows] = 1.0
    return replace(
        compulsion,
        D=compulsion.D - closures * (2 * STABILISATION_RATE * moving + STABILISATION_RATE**2 * position_residual(motion)),
        constraint_residual=0.0,
    )


@selected("noisy copies", INCONSISTENT)
def noisy():
    """Four-bar with one hinge doubled and noise of 1e-8 on its rows: inconsistent by 8e-8."""
    scene = load("four_bar")
    last = list(scene.joints.values())[-1]
    scene.add(replace(last, name="again"))
    system, state = _started(scene)
    compulsion = assemble(system, state)
    D, rng = compulsion.D.copy(), np.random.default_rng(0)
    rows = system.structure.constraints[system.structure.closures[-1]].rows
    D[rows] += NOISE * np.abs(D).max() * rng.standard_normal(D[rows].size)
    return replace(compulsion, D=D)


@selected("three stops")
def three_stops():
    """Chain of six links, three of whose joints stand at stops."""
    scene, angle = chain([1.0] * 6), 0.4
    for name in ("joint0", "joint2", "joint4"):
        scene.stop(name, highest=angle)
    system = compile_scene(scene)
    return assemble(system, system.state([angle, 0.3, angle, -0.5, angle, 0.7]))


@selected("box on 4 points")
def box_4():
    """Box at rest on its four corners: the accelerations are unique, the forces are not."""
    return _box(_feet(4), tilt=0.3)


@selected("box on 8 points")
def box_8():
    """Box at rest on eight points of its rim."""
    return _box(_feet(8), tilt=0.3)


@selected("box about to tilt")
def box_tilting():
    """Box on eight points, the moment on it 1e-9 below the one that lifts it: multipliers near zero."""
    return _box(_feet(8), tilt=1.0 - 1e-9)


def _feet(count: int) -> np.ndarray:
    """Points (count, 3) on the rim of the base of a box [m]."""
    corners, middles = [(-1, -1), (1, -1), (1, 1), (-1, 1)], [(0, -1), (1, 0), (0, 1), (-1, 0)]
    return np.array([(x, y, -1) for x, y in (corners + middles)[:count]]) * EDGES / 2


def _box(points: np.ndarray, tilt: float) -> Compulsion:
    """Box of 2 kg on a plane, with a share of the moment about y that lifts its edge."""
    scene, mass, squares = Scene("box"), 2.0, EDGES**2
    scene.body("box", mass, tuple(mass / 12 * (squares.sum() - squares)), position=(0, 0, EDGES[2] / 2))
    scene.free("float", "ground", "box")
    scene.points("feet", "box", points)
    scene.half_space("floor")
    scene.contact("stands", "feet", "floor")
    system = compile_scene(scene)
    load = np.zeros(system.n_v)
    load[1] = tilt * mass * 9.81 * EDGES[0] / 2
    return assemble(system, system.start(), load)
