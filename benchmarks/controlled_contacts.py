"""Time stepping with friction and impacts: error against CPU time, in fixed steps and by error control, beside peers.

Run it with:

    python -m benchmarks.controlled_contacts [--rounds 5]

Motions with closed forms: a ball that slides and then rolls, one that bounces eight times, a block that is pushed for 10 ms
after it has rested for three seconds, slides, and sticks. The error is the largest of the position at 50 times, in metres.
MuJoCo makes the first motion, with elliptic cones and its stiffest contacts of that step (`solref` of two steps), and, where
they are installed (`pip install drake exudyn`), Drake's error-controlled integrator CENIC (benchmarks/cenic.py) and Exudyn
(benchmarks/exudyn_contacts.py); the header of the page says which was not. Siconos has no wheel. CPU time of a motion after
one that was not measured, the least of the rounds. Writes benchmarks/results/controlled_contacts.csv, .md and .png.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

import gauss
from benchmarks import cenic, exudyn_contacts
from benchmarks.command import RESULTS, command
from gauss.bench.contest import duration
from gauss.bench.machine import header
from gauss.bench.markdown import head, in_time, table

g = 9.81
SAMPLES = 50
STEPS = (1e-2, 1e-3, 1e-4, 1e-5)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
FIXED, CONTROLLED, MUJOCO, CENIC, EXUDYN = "fixed steps", "error control", "MuJoCo", "CENIC", "Exudyn"
MU, RADIUS, SPEED = 0.2, 0.1, 2.0  # of the ball that rolls
E = 0.7  # restitution of the ball that bounces
LIMIT, PUSH, BEGIN, LENGTH = 2.0, 102.0, 3.0, 0.01  # of the block: friction, force [N], when and how long [s]


class Case(NamedTuple):
    """Motion with a closed form: scene, duration [s], position [m] at a time."""

    scene: Callable[[], gauss.Scene]
    duration: float
    position: Callable[[float], float]


def rolling() -> gauss.Scene:
    """A ball that slides, then rolls."""
    scene = gauss.Scene("rolls", gravity=(0.0, 0.0, -g))
    scene.body("ball", 1.0, (0.4 * RADIUS**2,) * 3)
    scene.free("free", "ground", "ball")
    scene.sphere("round", "ball", radius=RADIUS)
    scene.half_space("floor")
    scene.contact("rub", "round", "floor", friction=MU)
    scene.start("free", position=(0.0, 0.0, RADIUS, 1.0, 0.0, 0.0, 0.0), rate=(SPEED, 0.0, 0.0, 0.0, 0.0, 0.0))
    return scene


def rolled(t: float) -> float:
    """Its way: it slides until it has 5/7 of its speed."""
    slid = min(t, 2.0 * SPEED / (7.0 * MU * g))
    return SPEED * slid - MU * g * slid**2 / 2.0 + 5.0 / 7.0 * SPEED * (t - slid)


def bouncing() -> gauss.Scene:
    """A ball that falls from 1 m and bounces."""
    scene = gauss.Scene("bounces", gravity=(0.0, 0.0, -g))
    scene.body("ball", 1.0, (0.01,) * 3)
    scene.prismatic("height", "ground", "ball", axis=(0.0, 0.0, 1.0))
    scene.stop("height", 0.0, restitution=E)
    scene.start("height", 1.0)
    return scene


def bounced(t: float) -> float:
    """Its height."""
    speed, t = np.sqrt(2.0 * g), t - np.sqrt(2.0 / g)
    if t < 0.0:
        return 1.0 - g * (t + np.sqrt(2.0 / g)) ** 2 / 2.0
    while t >= 2.0 * E * speed / g:
        speed, t = E * speed, t - 2.0 * E * speed / g
    return E * speed * t - g * t * t / 2.0


def pushed() -> gauss.Scene:
    """A block with dry friction, pushed for a short time."""
    scene = gauss.Scene("is pushed", gravity=(0.0, 0.0, -g))
    scene.body("block", 1.0, (0.1,) * 3)
    scene.prismatic("slide", "ground", "block", axis=(1.0, 0.0, 0.0))
    scene.joint_friction("slide", LIMIT)
    scene.drive("slide", force=lambda t: gauss.math.where((t >= BEGIN) & (t < BEGIN + LENGTH), PUSH, 0.0))
    return scene


def slid(t: float) -> float:
    """Its way."""
    inside = min(max(t - BEGIN, 0.0), LENGTH)
    speed = (PUSH - LIMIT) * inside
    after = min(max(t - BEGIN - LENGTH, 0.0), speed / LIMIT)
    return speed * inside / 2.0 + speed * after - LIMIT * after**2 / 2.0


CASES = {"rolls": Case(rolling, 1.0, rolled), "bounces": Case(bouncing, 2.0, bounced), "is pushed": Case(pushed, 4.0, slid)}


def ours(case: Case, step: float | None = None, rtol: float = 1e-12) -> Callable[[], np.ndarray]:
    """Positions of a motion of gauss."""
    system, times = gauss.compile_scene(case.scene()), np.linspace(0.0, case.duration, SAMPLES)
    run = partial(gauss.simulate, system, case.duration, integrator="time_stepping", times=times, progress=False)
    return lambda: run(step=step, rtol=rtol).q[:, 0]


def theirs(step: float) -> Callable[[], np.ndarray]:
    """Positions of the ball that rolls, by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" cone="elliptic" impratio="100" gravity="0 0 {-g}"/><worldbody>'
        f'<geom type="plane" size="9 9 1" friction="{MU} 0 0" solref="{2 * step} 1"/>'
        f'<body pos="0 0 {RADIUS}"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{3 * f"{0.4 * RADIUS**2} "}"/>'
        f'<geom type="sphere" size="{RADIUS}" friction="{MU} 0 0" solref="{2 * step} 1"/></body></worldbody></mujoco>'
    )
    data, times = mujoco.MjData(model), np.linspace(0.0, CASES["rolls"].duration, SAMPLES)

    def motion() -> np.ndarray:
        mujoco.mj_resetData(model, data)
        data.qvel[0] = SPEED
        found, before = np.zeros(SAMPLES), (0.0, 0.0)
        for k, t in enumerate(times):
            while data.time < t - 1e-9 * step:
                before = data.time, data.qpos[0]
                mujoco.mj_step(model, data)
            share = (t - before[0]) / (data.time - before[0]) if k else 0.0
            found[k] = before[1] + share * (data.qpos[0] - before[1])
        return found

    return motion


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """Errors and times of all motions."""
    runs = {(name, FIXED, h): ours(case, step=h) for name, case in CASES.items() for h in STEPS}
    runs |= {(name, CONTROLLED, rtol): ours(case, rtol=rtol) for name, case in CASES.items() for rtol in TOLERANCES}
    runs |= {("rolls", MUJOCO, h): theirs(h) for h in STEPS}
    times = np.linspace(0.0, CASES["rolls"].duration, SAMPLES)
    if exudyn_contacts.is_installed():
        runs |= {("rolls", EXUDYN, h): exudyn_contacts.rolling(MU, RADIUS, SPEED, times, h) for h in STEPS}
    if cenic.is_installed():
        drake = cenic.rolling(MU, RADIUS, SPEED, times)
        runs |= {("rolls", CENIC, accuracy): partial(drake, accuracy) for accuracy in TOLERANCES}
    rows = []
    for (name, how, number), run in runs.items():
        exact = np.array([CASES[name].position(t) for t in np.linspace(0.0, CASES[name].duration, SAMPLES)])
        found, least = run(), min(duration(run) for _ in range(rounds))
        rows.append({"motion": name, "how": how, "given": number, "error": np.abs(found - exact).max(), "time": least})
    return rows, header("mujoco", "exudyn", "drake")


def draw(rows: list[dict]):
    """Error against time, one panel a motion."""
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, len(CASES), figsize=(12, 4), sharex=True, sharey=True, layout="constrained")
    for panel, name in zip(panels, CASES, strict=True):
        for how, marker in ((FIXED, "o"), (CONTROLLED, "s"), (MUJOCO, "^"), (CENIC, "d"), (EXUDYN, "v")):
            own = [row for row in rows if row["motion"] == name and row["how"] == how]
            panel.loglog([row["time"] for row in own], [row["error"] for row in own], marker=marker, label=how)
        panel.set(title=name, xlabel="CPU time of a motion [s]")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("largest error of the position [m]")
    panels[0].legend()
    figure.savefig(RESULTS / "controlled_contacts.png", dpi=150)
    pyplot.close(figure)


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    draw(rows)
    cells = [[row["motion"], row["how"], f"{row['given']:g}", f"{row['error']:.1e}", in_time(row["time"])] for row in rows]
    lines = [
        *head("Contacts by error control", conditions),
        "Step [s], `rtol`, accuracy; largest error of the position [m].",
    ]
    chart = "![Error of motions with contacts against CPU time](controlled_contacts.png)"
    return [*lines, "", chart, "", *table(("motion", "how", "step, rtol", "error", "CPU time"), cells), ""]


if __name__ == "__main__":
    command("controlled_contacts", __doc__, measure, page, {"rounds": (5, "repetitions")})
