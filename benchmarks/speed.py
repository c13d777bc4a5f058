"""Forward dynamics: the compiled recursion of gauss beside Pinocchio's C++, in one run.

Run it with:

    python -m benchmarks.speed [--rounds 15]

* one state: a compiled loop over states, scalar code, one core; batch: the same with SIMD code (structure of arrays);
* peer: Pinocchio's C++ ABA through ``pin.abaInParallel`` over 4096 states on one thread, and ``pin.aba`` called from
  Python; the model is Pinocchio's own reading of the URDF, or built from the scene joint by joint.

Rounds are interleaved, medians are quoted, ratios are medians of ratios. Agreement is the largest relative difference of q̈
over the states. The share of peak compares operations (a sine and cosine counted as 42) per second in the batch kernel with
a dgemm on the same core. Writes benchmarks/results/speed.csv and .md.
"""

import argparse
import csv
import os
import time
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("OPENBLAS_CORETYPE", None)  # the dgemm that the batch kernel is compared with gets its best

import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

import gauss  # noqa: E402
from benchmarks.machine import header  # noqa: E402
from gauss.assembly import forward_dynamics  # noqa: E402
from gauss.crosscheck.pinocchio_ import twin  # noqa: E402
from gauss.system import random_state  # noqa: E402
from gauss.tracing import trace  # noqa: E402

RESULTS = Path(__file__).parent / "results"
STATES = 4096
TRIGONOMETRY = 42  # operations of one sine and cosine
SCENES = {
    "panda": ("robot:panda", {"mimic": False}),
    "ur5": ("robot:ur5", {}),
    "talos, fixed base": ("robot:talos", {}),
    "chain of 10": ("spatial_chain", {"n": 10}),
    "planar chain of 10": ("n_pendulum", {"n": 10}),
    "chain of 32": ("spatial_chain", {"n": 32}),
}


def measure(name: str, rounds: int) -> dict:
    """Times and agreement of one scene."""
    source, options = SCENES[name]
    system = gauss.compile_scene(gauss.load(source, **options))
    n = system.n_v
    begin = time.perf_counter()
    dynamics = lambda q, v, f: forward_dynamics(system, q, v, f)  # noqa: E731
    batch, single = (trace(dynamics, system.n_q, n, n, batch=wide) for wide in (True, False))
    made = time.perf_counter() - begin
    rng = np.random.default_rng(0)
    states = [random_state(system, rng) for _ in range(STATES)]
    effort = rng.standard_normal((STATES, n))
    columns = np.concatenate([np.array([s.q for s in states]), np.array([s.v for s in states]), effort], axis=1).T.copy()
    model = twin(system).model
    pool = pin.ModelPool(model, 1)
    q, v, tau = (np.asfortranarray(part) for part in np.split(columns, 3))
    peer, data = np.zeros_like(q, order="F"), model.createData()
    ours = batch(columns)
    pin.abaInParallel(1, pool, q, v, tau, peer)
    agreement = np.abs(ours - peer).max() / np.abs(peer).max()
    tasks = {
        "batch": lambda: batch(columns),
        "one": lambda: single(columns),
        "pinocchio": lambda: pin.abaInParallel(1, pool, q, v, tau, peer),
        "pinocchio_python": lambda: [pin.aba(model, data, q[:, i], v[:, i], tau[:, i]) for i in range(256)],
    }
    times = {key: [] for key in tasks}
    for _ in range(rounds):
        for key, task in tasks.items():
            begin = time.perf_counter()
            task()
            times[key].append((time.perf_counter() - begin) / (256 if key == "pinocchio_python" else STATES))
    operations = sum(batch.operations.values()) + (TRIGONOMETRY - 2) * batch.operations.get("sin", 0)
    return {
        "scene": name,
        "joints": n,
        "operations": operations,
        "one_us": 1e6 * median(times["one"]),
        "batch_us": 1e6 * median(times["batch"]),
        "pinocchio_cpp_us": 1e6 * median(times["pinocchio"]),
        "pinocchio_python_us": 1e6 * median(times["pinocchio_python"]),
        "ratio_one": median(p / t for p, t in zip(times["pinocchio"], times["one"], strict=True)),
        "ratio_batch": median(p / t for p, t in zip(times["pinocchio"], times["batch"], strict=True)),
        "share_of_dgemm": operations / median(times["batch"]) / dgemm(),
        "agreement": agreement,
        "trace_and_compile_s": made,
    }


def dgemm(size: int = 512, rounds: int = 9) -> float:
    """Operations per second of a matrix product on one core."""
    A = np.random.default_rng(0).standard_normal((size, size))
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        A @ A
        times.append(time.perf_counter() - begin)
    return 2 * size**3 / median(times)


COLUMNS = {
    "scene": "{scene}",
    "joints": "{joints}",
    "operations": "{operations}",
    "one state": "{one_us:.3f} µs",
    "batch": "{batch_us:.3f} µs",
    "Pinocchio C++": "{pinocchio_cpp_us:.2f} µs",
    "pin.aba from Python": "{pinocchio_python_us:.2f} µs",
    "C++ / one": "{ratio_one:.1f}",
    "C++ / batch": "{ratio_batch:.0f}",
    "of dgemm": "{share_of_dgemm:.0%}",
    "agreement": "{agreement:.0e}",
    "trace and compile": "{trace_and_compile_s:.2f} s",
}


def table(rows) -> str:
    """Markdown of the measurements."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    lines += ["| " + " | ".join(cell.format(**row) for cell in COLUMNS.values()) + " |" for row in rows]
    return "\n".join(lines)


def main():
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved repetitions")
    rounds = parser.parse_args().rounds
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    rows = [measure(name, rounds) for name in SCENES]
    RESULTS.mkdir(exist_ok=True)
    lines = header("numpy", "pin", "llvmlite")
    with open(RESULTS / "speed.csv", "w", newline="") as file:
        file.writelines(f"# {line}\n" for line in lines)
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    text = "\n".join(["# Speed of forward dynamics", "", *(f"- {line}" for line in lines), "", table(rows), ""])
    (RESULTS / "speed.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
