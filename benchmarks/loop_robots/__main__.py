"""Robots with closed loops and geared rotors: whether they open, how exact and how fast their forward dynamics is.

Run it with:

    python -m benchmarks.loop_robots --folder FOLDER [--rounds 7] [--only cassie] [--seconds 3600]

The folder holds files of generalised_rbda (github.com/ROAM-Lab-ND/generalized_rbda, URDF+, MIT) and of
example-parallel-robots (github.com/Gepetto/example-parallel-robots, URDF and YAML, BSD-3), unchanged, and
``references.json``: states, loads and accelerations in extended precision, made without gauss. Every robot is opened, and
assembled from its neutral pose: how far its coordinates move. Its error is the largest difference to the reference
accelerations of its states, relative to the largest. Forward dynamics of one state, and of a batch of 1024 states a call,
stand beside those of Pinocchio and MuJoCo (:mod:`benchmarks.loop_robots.peers`), one state a call, each with its error.
First answers are those of a fresh process: from the file to the accelerations of the assembled pose, without imports, with
an empty cache of machine code and with a full one. A motion of ten robots without loads begins at the first reference state;
floating robots do not fall. Its drift is the largest residual of the constraints, relative to the size of the robot.

Loops are eliminated where they close (:mod:`gauss.dynamics.embedded_loops`). Operations are those of one state with its
error check, in brackets by the general elimination instead (:mod:`benchmarks.loop_robots.operations`); equal chains of a
robot are computed in lanes, so that several of them are one instruction.

CPU time of the process; medians of interleaved rounds. Writes benchmarks/results/loop_robots.csv and .md.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("GAUSS_TIER", "optimised")

import json  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from statistics import median  # noqa: E402

import numpy as np  # noqa: E402

import gauss  # noqa: E402
from benchmarks.command import agreeing, command, load_at_the_end  # noqa: E402
from benchmarks.loop_robots.operations import operations  # noqa: E402
from benchmarks.loop_robots.peers import PEERS, peers  # noqa: E402
from benchmarks.loop_robots.report import WANTED, page  # noqa: E402
from benchmarks.loop_robots.robots import Robot, robots  # noqa: E402
from gauss.bench.contest import OURS, Competitor, interleaved, repeated  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.dynamics.projection import position_residual_of, relative  # noqa: E402
from gauss.errors import SimulationError  # noqa: E402

ROOT = Path(__file__).parent.parent.parent
CALLS, BATCH = 200, 1024
BATCHED = "batch"
TIMEOUT = 300  # s of a process
MOVED = (  # robots whose motion is followed
    *("four_bar", "planar_leg_linkage", "revolute_rotor_chain", "mini_cheetah_leg", "mit_humanoid_leg"),
    *(
        "Explicit/depth5/loop_size6",
        "revolute_rotor_branch_1_2",
        "Implicit/depth5/loop_size5",
        "5bar_linkage",
        "5bar_linkage_iso3d",
    ),
)
SAMPLES = 41


def measured(folder: str, rounds: int, only: str, seconds: float) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    found = []
    for robot in robots(folder, only):
        line = {"robot": robot.name, "loops": robot.given["loops"], "couplings": robot.given["couplings"]}
        line |= {"nv": robot.given["nv"], "dof": robot.given["dof"], "redundant": _redundant(robot)}
        line |= operations(robot.system) | _assembled(robot) | _times(robot, rounds) | _first_answers(robot)
        if seconds and any(robot.given["id"].endswith(f"/{name}") for name in MOVED):
            line |= _motion(robot, seconds)
        found.append(line)
        print(line, flush=True)
    conditions = [*header("numpy", "pin", "mujoco", "llvmlite"), f"motions of {seconds:g} s", load_at_the_end()]
    return found, conditions


def _redundant(robot: Robot) -> int:
    return max(state["rows"] - state["rank"] for state in robot.given["states"])


def _assembled(robot: Robot) -> dict:
    """Change of the coordinates from the neutral pose [rad, m], and residual."""
    system = robot.system
    state = system.initial_state()
    residual = relative(system, position_residual_of(system, state)) if system.has_closures else 0.0
    return {"moved": float(np.abs(state.q - system.reference.q).max()), "residual": residual}


def _times(robot: Robot, rounds: int) -> dict:
    """Errors and times [s] of all competitors."""
    system, instants = robot.system, robot.instants()
    ours, first = system.forward_dynamics, instants[0]
    given = first.state.q, first.state.v, first.load
    batch = [np.tile(one, (BATCH, 1)) for one in given]
    out = ours(*batch)
    error = max(one.error(ours(one.state.q, one.state.v, one.load)) for one in instants)
    found = {"error": agreeing(error, WANTED, robot.name)}
    tasks = {OURS: Competitor(lambda: _called(ours, given), CALLS), BATCHED: Competitor(lambda: ours(*batch, out), BATCH)}
    for name, peer in peers(system, first).items():
        tasks[name] = Competitor(repeated(peer.run, CALLS), CALLS)
        found[f"{name} error"] = peer.error
    _, times = interleaved(tasks, 2), interleaved(tasks, rounds)
    return found | {name: median(times[name]) for name in tasks}


def _called(function, given):
    for _ in range(CALLS):
        function(*given)


def _first_answers(robot: Robot) -> dict:
    """CPU times of fresh processes [s]: with an empty cache, with a full one."""
    found = {}
    with tempfile.TemporaryDirectory() as cache:
        own = {"GAUSS_CACHE": cache, "GAUSS_TIER": "auto", "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"} | own
        script = [sys.executable, "-m", "benchmarks.loop_robots.child", str(robot.folder), robot.given["id"]]
        for name in ("cold", "warm"):
            done = subprocess.run(
                script, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT, check=True
            )
            found[name] = sum(json.loads(done.stdout).values())
    return found


def _motion(robot: Robot, seconds: float) -> dict:
    """Drift of the constraints and of the energy over a motion, and its CPU time [s]."""
    scene = robot.scene()
    if "floating" in robot.given["joints"].values():
        scene = replace(scene, gravity=(0.0, 0.0, 0.0))
    system = gauss.compile_scene(scene)
    times, begin = np.linspace(0.0, seconds, SAMPLES), time.process_time()
    start = robot.instants()[0].state
    try:
        motion = gauss.simulate(system, seconds, state=start, times=times, rtol=1e-10, progress=False)
    except SimulationError as error:
        print(robot.name, error, flush=True)
        motion = error.trajectory
    spent = time.process_time() - begin
    states = [system.state(q, v) for q, v in zip(motion.q, motion.v, strict=True)]
    residuals = [relative(system, position_residual_of(system, state)) for state in states]
    return {"drift": max(residuals), "moved_until": float(motion.t[-1]), "motion": spent}


if __name__ == "__main__":
    options = {
        "folder": ("", "folder of the robots with references.json"),
        "rounds": (7, "interleaved repetitions"),
        "only": ("", "part of a path"),
        "seconds": (3600.0, "duration of the motions, 0 for none"),
    }
    command("loop_robots", __doc__, measured, lambda lines, conditions: page(__doc__, PEERS, lines, conditions), options)
