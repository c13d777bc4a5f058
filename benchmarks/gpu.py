"""A GPU beside one core of this CPU: forward dynamics of many states, and steps of many motions, in double precision.

Run it with:

    python -m benchmarks.gpu [--device cuda] [--states 1048576] [--rounds 7]

States are random, starts meet the constraints. Arrays lie on the device before the clock starts; a run ends when all threads
have. Forward dynamics come with their error check. Share of the peak: operations of an evaluation as
:mod:`benchmarks.gpu_estimate` counts them, beside ``--peak`` in Tflop/s (34 of an H100 without tensor cores, as its maker
states). Results are compared with those of this CPU. Beside them stand MuJoCo Warp and MJX on the same device
(:mod:`benchmarks.gpu_peers`), where they are installed. ``--device lanes`` runs the same threads one after the other on this
CPU, to try the benchmark. Writes benchmarks/results/gpu.csv and .md.
"""

from functools import partial
from typing import Any

import numpy as np

from benchmarks import gpu_peers
from benchmarks.command import agreeing, command
from benchmarks.gpu_estimate import SCENES, flops
from gauss.bench.machine import header
from gauss.bench.markdown import head, table

ROUNDING = 1e-9  # of forward dynamics and of a short motion, relative to the largest entry
STEPS, STEP, FEW = 50, 1e-4, 256  # of a motion; states that are compared
PEERS = ("scene", "work", "engine", "its time", "per second", "gauss is faster by")
TITLES = ("scene", "work", "device", "one core of this CPU", "ratio", "per second", "share of the peak", "difference")


def measure(device: str, states: int, rounds: int, peak: float) -> tuple[list[dict], list[str]]:
    """Rows of all measurements."""
    import gauss
    from gauss.codegen.gpu.cuda_driver import device_names
    from gauss.codegen.gpu.devices import device as device_of
    from gauss.system import random_state

    rows, rng, place = [], np.random.default_rng(0), device_of(device)
    for name, make in SCENES.items():
        system = gauss.compile_scene(scene := make())
        some = [system.initial_state(s.q, s.v) for s in (random_state(system, rng, spread=0.2) for _ in range(FEW))]
        q, v = (np.tile(np.array([getattr(s, part) for s in some]), (-(-states // FEW), 1)) for part in "qv")
        function: Any = system.function("forward_dynamics", device=device)
        held = [place.put(array) for array in (q, v, np.zeros_like(v))]
        arguments = [(array, array.shape[1], 1) for array in held], place.put(np.zeros(len(q)))
        runs = {
            "forward dynamics": (
                partial(function.rows, place, len(q), *arguments),
                partial(system.forward_dynamics, q, v, 0 * v),
                1,
            ),
            "RK4 step": (
                partial(gauss.rollout, system, q, v, steps=STEPS, step=STEP, every=STEPS, device=device),
                partial(gauss.rollout, system, q[:4096], v[:4096], steps=STEPS, step=STEP, every=STEPS),
                STEPS,
            ),
        }
        for work, (there, here, units) in runs.items():
            one, other = there(), here()
            found = one[0][0].numpy() if work == "forward dynamics" else one.q
            known = other if work == "forward dynamics" else other.q
            count = min(len(found), len(known))
            apart = np.abs(found[:count] - known[:count]).max() / max(1.0, np.abs(known[:count]).max())
            rows.append(
                {
                    "scene": name,
                    "work": work,
                    "device": gpu_peers.seconds(there, rounds) / (len(q) * units),
                    "cpu": gpu_peers.seconds(here, rounds) / (len(known) * units),
                    "operations": flops(function.rows.operations) if work == "forward dynamics" else "",
                    "peak": peak,
                    "difference": agreeing(float(apart), ROUNDING, f"{name}, {work}"),
                }
            )
        rows.extend(gpu_peers.rows(name, scene, q, v, STEPS, STEP, rounds))
    gpus = device_names() if device.startswith("cuda") else [device]
    return rows, [
        *header("numpy", "llvmlite", "cuda-bindings"),
        f"device: {', '.join(gpus)}; {states} states, {STEPS} steps",
    ]


def page(rows: list[dict], conditions) -> list[str]:
    """Lines of the page."""
    lines = []
    for row in rows:
        if row.get("peer"):
            continue
        share = row["operations"] / row["device"] / (row["peak"] * 1e12) if row["operations"] else None
        times = f"{1e9 * row['device']:.3g} ns", f"{1e9 * row['cpu']:.3g} ns", f"{row['cpu'] / row['device']:.3g}"
        last = f"{1.0 / row['device']:.2e}", "–" if share is None else f"{share:.0%}", f"{row['difference']:.0e}"
        lines.append([row["scene"], row["work"], *times, *last])
    ours = {(row["scene"], row["work"]): row["device"] for row in rows if not row.get("peer")}
    beside = []
    for row in (row for row in rows if row.get("peer")):
        if not row.get("time"):
            beside.append([row["scene"], row["work"], row["peer"], "–", "–", "–"])
            continue
        ratio = row["time"] / ours[row["scene"], row["work"]]
        found = f"{1e9 * row['time']:.3g} ns", f"{1.0 / row['time']:.2e}", f"{ratio:.3g}"
        beside.append([row["scene"], row["work"], row["peer"], *found])
    there = head("A GPU beside one core of a CPU", conditions)
    return [*there, *table(TITLES, lines), "", "## Other engines on the same device", "", *table(PEERS, beside)]


if __name__ == "__main__":
    OPTIONS = {
        "device": ("cuda", "name of the device"),
        "states": (1 << 20, "states, and motions"),
        "rounds": (7, "repetitions"),
        "peak": (34.0, "peak of the device in double precision [Tflop/s]"),
    }
    command("gpu", __doc__, measure, page, OPTIONS)
