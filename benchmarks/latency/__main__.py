"""First answers: CPU time of a fresh process with an empty cache of machine code, with a warm one, and of a later call.

Run it with:

    python -m benchmarks.latency [--rounds 3] [--only "Stewart platform"]

An answer is a motion of 0.2 s at rtol 1e-9, for every shipped scene, families of scenes and 20 robots, or the first call of
a function of a humanoid with two loops. CPU time of the main thread; imports, and reading of the scene from its file, are
stated apart. The first process compiles quickly, a second one, which is not timed, fills the cache with optimised code, and
the third is the warm one.

Beside it, as scale: fresh processes of Python, of numpy, and of Pinocchio that reads the Panda and calls
``pin.aba`` once. The least of the rounds is quoted: whatever else the machine does only adds to it. Writes
benchmarks/results/latency.csv, .md and .png.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.command import RESULTS, chosen, command
from benchmarks.latency.report import chart, page
from benchmarks.latency.scenes import scenes
from gauss.bench.machine import header
from gauss.io.urdf.robots import robot

ROOT = Path(__file__).parent.parent.parent
TIMEOUT = 300  # s of wall time for one process
BIPED = "biped, both feet fixed"
FUNCTIONS = ("accelerations", "derivatives", "inverse dynamics")
PINOCCHIO = f"""
import numpy as np
import pinocchio as pin
model = pin.buildModelFromUrdf({str(robot("panda"))!r})
pin.aba(model, model.createData(), pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv))
"""
SCALE = {"Python": "pass", "numpy": "import numpy", "Pinocchio": PINOCCHIO}


def measure(rounds: int, only: str) -> tuple[list[dict], list[str]]:
    """Rows of all processes, and the conditions."""
    tasks = [(name, "motion") for name in scenes()] + [(BIPED, function) for function in FUNCTIONS]
    named = chosen(only, dict.fromkeys(scene for scene, _ in tasks))
    tasks = [task for task in tasks if task[0] in named]
    rows: list[dict] = []
    for number in range(rounds):
        for scene, answer in tasks:
            with tempfile.TemporaryDirectory() as folder:
                for cache, tier in (("cold", "auto"), ("", "optimised"), ("warm", "auto")):
                    found = _first_answer(scene, answer, folder, tier)
                    line = {"scene": scene, "answer": answer, "cache": cache, "round": number}
                    rows += [line | found] if cache else []
        rows += [
            {"scene": name, "answer": "process", "cache": "", "round": number, "first": _process(script)}
            for name, script in ({} if only else SCALE).items()
        ]
    return rows, header("numpy", "llvmlite", "pin")


def _first_answer(scene: str, answer: str, folder: str, tier: str) -> dict:
    """What a fresh process measures; only the reason where it fails."""
    own = {"GAUSS_CACHE": folder, "GAUSS_TIER": tier, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | own
    command_line = [sys.executable, "-m", "benchmarks.latency.child", scene, answer]
    try:
        done = subprocess.run(
            command_line, env=environment, cwd=ROOT, capture_output=True, text=True, check=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"more than {TIMEOUT} s"}
    except subprocess.CalledProcessError as error:
        return {"failed": error.stderr.strip().rpartition("\n")[2]}
    return json.loads(done.stdout)


def _process(script: str) -> float:
    """CPU time of a whole process [s]."""
    before = os.times()
    subprocess.run([sys.executable, "-c", script], check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


if __name__ == "__main__":
    begin = time.perf_counter()
    options = {"rounds": (3, "fresh processes of each kind"), "only": ("", "part of the name of the scenes to measure")}
    command("latency", __doc__, measure, page, options)
    chart(RESULTS)
    print(f"{time.perf_counter() - begin:.0f} s")
