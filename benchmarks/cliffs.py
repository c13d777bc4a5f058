"""Cliffs: what one more element costs, beside the same scene without it.

Run it with:

    python -m benchmarks.cliffs [--only NAME]

Each scene is measured alone and with one element more. "state" is one call of ``system.accelerations``, "motion" the time
of motions with "dop853" (tolerance 1e-9), after a first one, over their number of evaluations; both are CPU times, medians
of several rounds. The ratio of the motion to that of the same scene without the element is the cliff. "plan" is the driver
and the dynamics of the motion. Laws that call ``float`` are opaque; the others are traced.
Opaque laws of time are sampled thousands of times before a first motion, which is not counted; while they are unchanged,
they are compared at a few times before later ones.

Writes benchmarks/results/cliffs.csv and .md.
"""

import time
import warnings
from collections.abc import Callable
from functools import partial
from statistics import median

import numpy as np

import gauss
from benchmarks.command import chosen, command, load_at_the_end
from gauss import math
from gauss.bench.machine import header
from gauss.bench.markdown import head, in_time, table

TITLES = ("scene", "element", "state", "motion, per evaluation", "ratio of states", "ratio of motions", "plan")
MOST = 3.0  # ratio to the scene without the element that is asked for
ALONE = "none"
ROUNDS, BUDGET = 5, 0.05  # repetitions, and s of each
DURATION, PATIENCE = 0.3, 3.0  # s of a motion, and of CPU time for all of them


def _opaque(t) -> float:
    return 0.1 * np.sin(float(t))


def _in_the_middle(scene: gauss.Scene) -> tuple[str, str]:
    """A joint and a body in the middle of a scene."""
    hinges = [joint.name for joint in scene.joints.values() if joint.kind == "revolute"]
    bodies = list(scene.bodies)
    return hinges[len(hinges) // 2], bodies[len(bodies) // 2]


ELEMENTS: dict[str, Callable[[gauss.Scene, str, str], object]] = {
    ALONE: lambda scene, joint, body: None,
    "drive, traced": lambda scene, joint, body: scene.drive(joint, torque=lambda t: 0.1 * math.sin(t)),
    "drive, opaque": lambda scene, joint, body: scene.drive(joint, torque=_opaque),
    "drive of poses, traced": lambda scene, joint, body: scene.drive(joint, torque=lambda t, at: 0.1 * at.position(body)[0]),
    "drive of poses, opaque": lambda scene, joint, body: scene.drive(
        joint, torque=lambda t, at: 0.1 * float(at.position(body)[0])
    ),
    "force, constant": lambda scene, joint, body: scene.force("push", body, force=(0.1, 0.0, 0.0)),
    "force, traced": lambda scene, joint, body: scene.force("push", body, force=lambda t: (0.1 * math.sin(t), 0.0, 0.0)),
    "force, opaque": lambda scene, joint, body: scene.force("push", body, force=lambda t: (_opaque(t), 0.0, 0.0)),
    "spring": lambda scene, joint, body: scene.spring("spring", body, "ground", other_at=(3.0, 4.0, 5.0), stiffness=1.0),
}


def _shafts(count: int) -> gauss.Scene:
    """Trains of five geared shafts."""
    scene = gauss.Scene(f"{count} shafts")
    for k in range(count):
        scene.body(f"B{k}", 1.0, (0.1, 0.1, 0.15))
        scene.revolute(f"J{k}", "ground", f"B{k}", at=(k, 0.0, 0.0))
        if k % 5:
            scene.couple(f"C{k}", f"J{k}", f"J{k - 1}", ratio=-1.1)
        else:
            scene.drive(f"J{k}", torque=0.1)
    return scene


def _coupled_chain(count: int) -> gauss.Scene:
    """Chain of links, every second hinge geared to the one before it."""
    scene = gauss.load("spatial_chain", n=count)
    hinges = [joint.name for joint in scene.joints.values()]
    for inner, outer in zip(hinges[::2], hinges[1::2], strict=True):
        scene.couple(f"{outer} to {inner}", outer, inner, ratio=-0.5)
    return scene


LARGE = ALONE, "drive, traced", "drive, opaque", "drive of poses, traced", "force, traced", "force, opaque", "spring"
SCENES: dict[str, tuple[Callable[[], gauss.Scene], tuple[str, ...]]] = {
    "chain of 7": (lambda: gauss.load("spatial_chain", n=7), tuple(ELEMENTS)),
    "chain of 40": (lambda: gauss.load("spatial_chain", n=40), tuple(ELEMENTS)),
    "chain of 41": (lambda: gauss.load("spatial_chain", n=41), tuple(ELEMENTS)),
    "chain of 100": (lambda: gauss.load("spatial_chain", n=100), LARGE),
    "128 geared shafts": (lambda: _shafts(128), (ALONE,)),
    "130 geared shafts": (lambda: _shafts(130), (ALONE,)),
    "chain of 66, coupled in pairs": (lambda: _coupled_chain(66), (ALONE,)),
    "chain of 132, coupled in pairs": (lambda: _coupled_chain(132), (ALONE,)),
    "four-bar": (lambda: gauss.load("four_bar"), tuple(ELEMENTS)),
    "hung chain of 140": (lambda: gauss.load("hung_chain", n=140), LARGE),
}


def _per_call(call: Callable[[], object]) -> float:
    """Median CPU time of a call [s]."""
    found: list[float] = []
    while len(found) < ROUNDS:
        count, begin = 0, time.process_time()
        while time.process_time() - begin < BUDGET:
            call()
            count += 1
        found.append((time.process_time() - begin) / count)
    return median(found)


def _measured(make: Callable[[], gauss.Scene], element: str) -> dict:
    """State and motion of a scene with one more element."""
    scene = make()
    ELEMENTS[element](scene, *_in_the_middle(scene))
    system = gauss.compile_scene(scene)
    state, move = system.initial_state(), partial(gauss.simulate, system, rtol=1e-9, progress=False)
    plan, each = move(DURATION / 100).stats.plan, list[float]()
    assert plan is not None
    while len(each) < ROUNDS and sum(each) < PATIENCE:
        begin = time.process_time()
        motion = move(DURATION)
        each.append(time.process_time() - begin)
    for _ in range(3):
        system.accelerations(state)
    return {
        "state_s": _per_call(lambda: system.accelerations(state)),
        "motion_s": median(each) / motion.stats.evaluations,
        "plan": f"{plan.driver}, {plan.dynamics}",
    }


def measured(only: str) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    warnings.simplefilter("ignore")
    rows = []
    for name in chosen(only, SCENES):
        make, elements = SCENES[name]
        for element in elements:
            rows.append({"scene": name, "element": element, **_measured(make, element)})
            print(rows[-1], flush=True)
    return rows, [*header("numpy", "llvmlite"), load_at_the_end()]


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    alone = {row["scene"]: row for row in rows if row["element"] == ALONE}
    cells = [
        [
            row["scene"],
            row["element"],
            *(in_time(float(row[key])) for key in ("state_s", "motion_s")),
            *(f"{float(row[key]) / float(alone[row['scene']][key]):.1f}" for key in ("state_s", "motion_s")),
            row["plan"],
        ]
        for row in rows
    ]
    worst = max(float(row["motion_s"]) / float(alone[row["scene"]]["motion_s"]) for row in rows)
    asked = f"Asked for: at most {MOST:g} times the scene without the element. Largest ratio of motions: {worst:.1f}."
    return [*head("What one more element costs", conditions), *table(TITLES, cells), "", asked, ""]


if __name__ == "__main__":
    command("cliffs", __doc__, measured, page, {"only": ("", "part of the name of a scene")})
