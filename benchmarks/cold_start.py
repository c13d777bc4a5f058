"""Cold start: how long a fresh process takes from nothing to the first result, with and without kept machine code.

Run it with:

    python -m benchmarks.cold_start [--rounds 15]

Each round starts a new Python process that imports gauss, reads the Panda, compiles its scene and makes one RK4 step of
1 ms, once with an empty folder for machine code and once with the folder that the first run has filled. Beside it, as
scale: Python that does nothing, numpy alone, and Pinocchio that reads the same file and calls ``pin.aba`` once. Whole
processes are timed, start and end of Python included; rounds are interleaved, medians are quoted. Writes
benchmarks/results/cold_start.csv and .md.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from benchmarks.command import command
from gauss.bench.machine import header
from gauss.bench.markdown import head, table
from gauss.io.urdf.robots import robot

ROOT = Path(__file__).parent.parent
GAUSS = """
import json, time
times = [time.perf_counter()]
import gauss
times.append(time.perf_counter())
scene = gauss.load("robot:panda")
times.append(time.perf_counter())
system = gauss.compile_scene(scene)
times.append(time.perf_counter())
gauss.simulate(system, 1e-3, integrator="rk4", step=1e-3)
times.append(time.perf_counter())
print(json.dumps([b - a for a, b in zip(times, times[1:])]))
"""
STAGES = ("import", "read the robot", "build the system", "compile and first step")
PEER = f"""
import numpy as np
import pinocchio as pin
model = pin.buildModelFromUrdf({str(robot("panda"))!r})
pin.aba(model, model.createData(), pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv))
"""
SCALE = {"python": "pass", "numpy": "import numpy", "pinocchio": PEER}
LIMITS = {"without cache": 0.7, "with cache": 0.45}  # what a first result may take [s]


def run(script: str, folder: str) -> tuple[float, list[float]]:
    """Wall time of a fresh process [s], and what it printed."""
    environment = os.environ | {"GAUSS_CACHE": folder, "GAUSS_TIER": "auto", "PYTHONPATH": str(ROOT)}
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    return time.perf_counter() - begin, json.loads(done.stdout or "[]")


def measure(rounds: int) -> list[dict]:
    """Rows of all measurements, interleaved."""
    rows = []
    with tempfile.TemporaryDirectory() as kept:
        run(GAUSS, kept)
        for number in range(rounds):
            with tempfile.TemporaryDirectory() as empty:
                tasks = {"without cache": (GAUSS, empty), "with cache": (GAUSS, kept)}
                tasks |= {name: (script, kept) for name, script in SCALE.items()}
                for name, task in tasks.items():
                    wall, stages = run(*task)
                    rows.append({"what": name, "round": number, "wall_s": wall} | dict(zip(STAGES, stages, strict=False)))
    return rows


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the medians."""
    titles = ["fresh process", "whole", *STAGES, "at most"]
    lines = [_medians(name, [row for row in rows if row["what"] == name]) for name in [*LIMITS, *SCALE]]
    return [*head("From nothing to the first step of a Panda", conditions), *table(titles, lines), ""]


def _medians(name: str, mine: list[dict]) -> list[str]:
    stages = [f"{median(row[stage] for row in mine):.3f} s" if mine[0][stage] != "" else "" for stage in STAGES]
    limit = f"{LIMITS[name]:.2f} s" if name in LIMITS else ""
    return [name, f"{median(row['wall_s'] for row in mine):.3f} s", *stages, limit]


if __name__ == "__main__":
    command("cold_start", __doc__, lambda rounds: (measure(rounds), header("numpy", "pin", "llvmlite")), page)
