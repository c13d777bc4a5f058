"""Contacts: what a motion with them costs, and how far it is off, beside MuJoCo.

Run it with:

    python -m benchmarks.contacts [--rounds 7]

Scenes: a rough block that slides up an incline, stops and slides back; a smooth box pulled along a plane on 4 and on 8
contact points; Newton's cradle without loss. gauss locates every event with "dop853" (tolerances 1e-9), or takes steps
of one length with "time_stepping". MuJoCo takes ``mj_step`` through the file that ``gauss.save`` writes of the scene:
contacts as stiff as its step bears, RK4, elliptic friction cones, Newton solver; a box touches a plane at 4 points
there, whatever the scene says. Its balls of the cradle rebound from springs without damping of 1e9 1/s², as it knows no
restitution; with softer ones the shocks overlap. Both are called once for a whole motion; times are CPU times of one
core, medians of interleaved rounds, of which long scenes have fewer; motions of MuJoCo beyond 20 s, which make no machine
code, are made once. Errors are those of the end: against closed forms
of the block and the box, of the energy for the cradle. Next come single evaluations while the box rests on its points:
machine code that checks itself, the certified quadratic programme in Python, and ``mj_forward`` after 0.2 s of
relaxation. Smooth phases and active-set kernels are compiled after some motions (tiered compilation); those that are
timed come later. "first ms" is the first motion of all, with the machine code that it makes, or finds on the disk.

The last scenes have many contacts: a stack, dominoes, balls and convex meshes that fall into a bin. Their error is the
deepest penetration at the end [m], of boxes and meshes into the floor and of balls into each other and the walls. Rows
of 30, 100 and 1000 balls show how a step grows with their number. Packed balls lie in the hollows of four others each. 100
of them got velocities of about 1 cm/s and moved for 0.04 s before, so that they creep: some of their redundant contacts slip
by micrometres per second, and the laws are met to 1e-5 relative, not to 1e-10 as elsewhere. 1000 stand still, and MuJoCo
takes its conjugate gradients there: its Newton solver takes seconds a step.

Robots of Gymnasium and of dm_control follow, with stops and contacts, stepped for 1 s under random inputs that change every
5 steps: the quadruped stands on terrain, with a ball above it, the manipulator is an arm with a gripper between loose
objects. Those whose packages are not installed are left out. Their first motion includes reading the file. Their error is
the deepest penetration at the end: the largest change of a coordinate that moves the shapes apart [m, rad] for gauss, the
least distance of a contact for MuJoCo.

Writes benchmarks/results/contacts.md and .csv.
"""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import gauss
from benchmarks import convex_meshes, free_bodies, walkers
from benchmarks.command import command, load_at_the_end
from benchmarks.convex_meshes import mesh_depth
from gauss.bench.contest import Competitor, Contest, measure, repeated
from gauss.bench.machine import header
from gauss.bench.markdown import head, table

TITLES = ("scene", "method", "first ms", "ms", "µs per step", "error")
g = 9.81
SPRING = 1e9  # 1/s²: stiffness of a contact over the inertia that it moves
WARM = 20  # motions with events before those that are timed: beyond the threshold of tiered compilation
CALLS = 200  # of short functions at a time
LONGEST = 20.0  # CPU time of all rounds of a scene [s]: longer scenes have fewer, but one
JOLT, SETTLING = 1e-2, 0.04  # velocity of balls, and how long they settle [m/s, s]
RELAXATION_STEPS = 200  # steps of MuJoCo before it is asked for accelerations


@dataclass(frozen=True)
class Way:
    """One way to make a motion, or to evaluate accelerations."""

    # scene, method: what is done, and how
    scene: str
    method: str
    run: Callable  # does it and returns a trajectory, MuJoCo's data, or nothing
    error: Callable  # error of what ``run`` returns
    steps: int = 0  # number of steps of one length, 0 of others
    warm: int = 0  # how often it is done before it is timed
    calls: int = 1  # how often it is done at a time

    @property
    def is_peer(self) -> bool:
        """Whether MuJoCo does it."""
        return self.method.startswith("mujoco")


def ours(name: str, scene, duration: float, error: Callable, step: float | None = None) -> Way:
    """Motion by gauss."""
    system = gauss.compile_scene(scene)
    run = {"integrator": "time_stepping", "step": step} if step else {"rtol": 1e-9, "atol": 1e-9}
    method = f"gauss, time_stepping, {step:g} s" if step else "gauss, dop853"

    def motion():
        return gauss.simulate(system, duration, times=[duration], progress=False, **run)

    steps, warm = (round(duration / step), 0) if step else (0, WARM)
    return Way(name, method, motion, lambda found: error(found.q[-1], found.v[-1]), steps, warm)


def theirs(name: str, scene, duration: float, error: Callable, step: float, elastic: bool = False, solver=None) -> Way:
    """Motion by MuJoCo, with another solver if one is given."""
    model = in_mujoco(scene, step, elastic)
    model.opt.solver = model.opt.solver if solver is None else solver
    data, steps = mujoco.MjData(model), round(duration / step)

    def motion():
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_step(model, data, nstep=steps)
        return data

    return Way(name, f"mujoco.mj_step, {step:g} s", motion, lambda found: error(found.qpos, found.qvel), steps)


def in_mujoco(scene, step: float, elastic: bool = False) -> mujoco.MjModel:
    """Model of a scene."""
    if elastic:
        scene = gauss.load(scene)
        for name, contact in list(scene.contacts.items()):
            del scene.contacts[name]
            scene.contact(name, contact.shape, contact.other)
    with tempfile.TemporaryDirectory() as folder:
        model = mujoco.MjModel.from_xml_path(str(gauss.save(scene, Path(folder) / "scene.xml")))
    model.opt.timestep = step
    model.opt.cone, model.opt.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
    if elastic:
        model.pair_solref[:] = -SPRING, 0.0
    return model


def block() -> list[Way]:
    """Up and down an incline in 0.8 s."""
    name, end, scene = "block on an incline, friction 0.5", 0.8, gauss.load("block_on_incline")
    down, rub = g * np.sin(0.6), 0.5 * g * np.cos(0.6)
    turn = 3.0 / (down + rub)
    place = -1.5 * turn + 0.5 * (down - rub) * (end - turn) ** 2

    def error(q, v):
        return abs(q[0] - place)

    return [
        ours(name, scene, end, error, 1e-2),
        ours(name, scene, end, error, 1e-3),
        theirs(name, scene, end, error, 1e-3),
    ]


def box(corners: int) -> list[Way]:
    """Pulled with 10 N for 0.5 s, too little to tip."""
    name, end = f"box on a plane, {corners} points", 0.5
    scenes = gauss.load(f"box_on_plane_{corners}"), gauss.load("box_on_plane_8")
    for scene in scenes:
        scene.loads.clear()
        scene.force("pull", "box", force=(10.0, 0, 0), at=(0, 0, 0.2))

    def error(q, v):
        return abs(q[0] - 2.5 * end * end)

    return [
        ours(name, scenes[0], end, error),
        ours(name, scenes[0], end, error, 1e-3),
        theirs(name, scenes[1], end, error, 1e-3),
    ]


def cradle() -> list[Way]:
    """1.2 s, four impacts; the energy at the end against that of the start."""
    name, end, scene = "Newton's cradle", 1.2, gauss.load("newtons_cradle")
    start = 0.5 * g * (1.0 - np.cos(0.5))

    def error(q, v):
        kinetic = 0.5 * (0.5 + 5e-5) * float(v @ v)
        return abs(kinetic + 0.5 * g * float((1.0 - np.cos(q)).sum()) - start) / start

    peers = [theirs(name, "newtons_cradle", end, error, step, elastic=True) for step in (1e-5, 5e-6)]
    return [ours(name, scene, end, error), *peers]


def many(name: str, scene, end: float, deepest: Callable) -> list[Way]:
    """Free bodies with contacts; the error is the deepest penetration at the end [m]."""
    way, step = ours(name, scene, end, lambda q, v: deepest(q.reshape(-1, 7)), 1e-3), 1e-3
    return [way, theirs(name, scene, end, lambda q, v: deepest(q.reshape(-1, 7)), step)]


def packed(n: int, row: int, jolt: float, end: float, solver=None) -> list[Way]:
    """Balls packed in a bin; the error is the deepest penetration at the end [m]."""
    name, step = f"{n} balls, packed", 1e-3
    scene, wall = free_bodies.packed_balls(n, row, jolt)
    if jolt:
        still = gauss.simulate(scene, SETTLING, times=[SETTLING], integrator="time_stepping", step=step, progress=False)
        for i, (q, v) in enumerate(zip(still.q[-1].reshape(-1, 7), still.v[-1].reshape(-1, 6), strict=True)):
            scene.start(f"ball {i} floats", position=q, rate=v)
    deepest = lambda q, v: free_bodies.ball_depth(q.reshape(-1, 7), wall)  # noqa: E731
    return [ours(name, scene, end, deepest, step), theirs(name, scene, end, deepest, step, solver=solver)]


def crowded() -> list[list[Way]]:
    """A stack, dominoes that topple, balls that fall into a bin."""
    wide, heap = 0.28, convex_meshes.heap(50)
    return [
        many("stack of 10 boxes", free_bodies.stack(10), 0.3, lambda q: free_bodies.box_depth(q, (free_bodies.EDGE,) * 3)),
        many("10 dominoes", free_bodies.dominoes(10, push=3.0), 0.6, lambda q: free_bodies.box_depth(q, free_bodies.TILE)),
        many("30 balls in a bin", free_bodies.bin_of_balls(30), 1.0, lambda q: free_bodies.ball_depth(q, free_bodies.WALL)),
        many("100 balls in a bin", free_bodies.bin_of_balls(100, wall=wide), 0.6, lambda q: free_bodies.ball_depth(q, wide)),
        many("50 convex meshes in a bin", heap, 0.4, lambda q: mesh_depth(heap, q)),
        many("1000 balls in a bin", free_bodies.bin_of_balls(1000, wall=0.6), 0.3, lambda q: free_bodies.ball_depth(q, 0.6)),
        packed(100, 5, JOLT, 0.05),
        packed(1000, 10, 0.0, 0.01, mujoco.mjtSolver.mjSOL_CG),
    ]


def robots() -> list[list[Way]]:
    """Walking robots, and an arm with a gripper, under random inputs."""
    steps, found = walkers.ACTIONS * walkers.HOLD, []
    for name, file in walkers.models().items():
        one, other = walkers.ours(file), walkers.theirs(file)
        ours_, theirs_ = f"gauss.Simulator, {walkers.STEP:g} s", f"mujoco.mj_step, {walkers.STEP:g} s"
        found.append([Way(name, ours_, *one, steps, warm=1), Way(name, theirs_, *other, steps)])
    return found


def evaluations(corners: int) -> list[Way]:
    """Accelerations while the box rests on its points and is pulled with 10 N: 5 m/s²."""
    name, scene = f"accelerations of a box on {corners} points", gauss.load(f"box_on_plane_{corners}")
    scene.loads.clear()
    scene.force("pull", "box", force=(10.0, 0, 0), at=(0, 0, 0.2))
    system = gauss.compile_scene(scene)
    state, dynamics, still = system.initial_state(), system.forward_dynamics, np.zeros(system.n_v)
    other = gauss.load("box_on_plane_8")
    other.loads.clear()
    other.force("pull", "box", force=(10.0, 0, 0), at=(0, 0, 0.2))
    model = in_mujoco(other, 1e-3)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=RELAXATION_STEPS)

    def solved():
        return gauss.solve(gauss.assemble(system, state)).qdd

    def compiled():
        return system.accelerations(state)

    def called():
        return dynamics(state.q, state.v, still)

    def forward():
        mujoco.mj_forward(model, data)
        return data.qacc

    expected = np.array([5.0, 0, 0, 0, 0, 0])
    off = lambda found: np.abs(found - expected).max() / 5.0  # noqa: E731
    return [
        Way(name, "gauss, system.forward_dynamics", called, off, calls=CALLS),
        Way(name, "gauss, system.accelerations", compiled, off, calls=CALLS),
        Way(name, "gauss.assemble, gauss.solve", solved, off),
        Way(name, "mujoco.mj_forward", forward, off, calls=CALLS),
    ]


def rows(rounds: int) -> list[dict]:
    """Rows of the table."""
    found = []
    for power_flow in (block(), box(4), box(8), cradle(), evaluations(4), evaluations(8), *crowded(), *robots()):
        errors, first = {}, {}
        for way in power_flow:
            began = time.process_time()
            errors[way.method] = float(way.error(way.run()))
            first[way.method] = 1e3 * (time.process_time() - began)
            for _ in range(way.warm):
                way.run()
        once = {
            way.method: 1e-3 * first[way.method] for way in power_flow if way.is_peer and first[way.method] > 1e3 * LONGEST
        }
        tasks = {
            way.method: Competitor(repeated(way.run, way.calls), way.calls, is_short=way.calls > 1)
            for way in power_flow
            if way.method not in once
        }
        contest = Contest(power_flow[0].scene, tasks, (), 0.0)
        whole = 1e-3 * sum(first[method] for method in tasks)  # [s] of a round
        measured = measure(contest, max(1, min(rounds, int(LONGEST / whole))))
        for way in power_flow:
            seconds = once.get(way.method) or measured.median(way.method)
            per_step = 1e6 * seconds / way.steps if way.steps else None
            row = {"scene": way.scene, "method": way.method, "first_ms": first[way.method], "ms": 1e3 * seconds}
            row["us_per_step"] = per_step
            found.append(row | {"error": errors[way.method]})
            print(*line(found[-1]), sep=" | ", flush=True)
    return found


def line(row: dict) -> list[str]:
    """Cells of a row of the page."""
    per_step = "" if row["us_per_step"] in ("", None) else f"{row['us_per_step']:.3g}"
    return [row["scene"], row["method"], f"{row['first_ms']:.3g}", f"{row['ms']:.3g}", per_step, f"{row['error']:.1e}"]


def page(found: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    about = __doc__.split("\n\n", 3)[3].rsplit("\n\n", 1)[0]
    return [*head("Contacts", conditions), *table(TITLES, map(line, found)), "", about, ""]


def measured(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    found = rows(rounds)
    return found, [*header("numpy", "mujoco", "llvmlite"), load_at_the_end()]


if __name__ == "__main__":
    command("contacts", __doc__, measured, page, {"rounds": (7, "interleaved repetitions")})
