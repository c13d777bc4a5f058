"""Accuracy that each backend reaches on Gauss problems of real mechanisms, and whether it is honest about it.

Run it with:

    python -m benchmarks.backend_accuracy [--states 5]

Every backend gets the same compulsions, through the scaled form F2s where it takes no other, at a tolerance of 1e-9 where
it has one. The error is the largest difference of q̈ over the largest |q̈| against the refined recursion, which is itself
right to about 1e-15 (checked against 60 digits in tests/test_exact.py). The worst of all states counts. Writes
benchmarks/results/backend_accuracy.csv and .md.
"""

import argparse
import csv
import time
from pathlib import Path
from statistics import median

import numpy as np

import gauss
from benchmarks.machine import header
from gauss.backends import available, make
from gauss.compulsion import Compulsion
from gauss.system import random_state

RESULTS = Path(__file__).parent / "results"
REFERENCE = "recursion"
WRONG = 1e-3  # an answer further off than this is called wrong


def problems() -> dict:
    """Systems by name."""
    chains = {"heavy tip 1e6": (1, 1e6), "heavy tip 1e12": (1, 1e12), "light tip 1e-12": (1, 1e-12)}
    found = {
        "panda": gauss.load("robot:panda"),
        "ur5": gauss.load("robot:ur5"),
        "talos, free base": gauss.load("robot:talos", root="free"),
        "random tree, 20 joints": gauss.load("random_tree", n=20, seed=1),
        "chain of 50": gauss.load("spatial_chain", n=50),
        "four-bar, 3 redundant rows": gauss.load("four_bar"),
    }
    found |= {name: tip_chain(*masses) for name, masses in chains.items()}
    found["alternating 1 : 1e6"] = chain([1.0, 1e6] * 5)
    return {name: gauss.compile_scene(scene) for name, scene in found.items()}


def chain(masses) -> gauss.Scene:
    """Spatial chain of rods of 1 m with given masses."""
    scene, previous = gauss.Scene("chain"), "ground"
    for i, mass in enumerate(masses):
        moments = (0.02 * mass, mass / 12, mass / 12)
        scene.body(f"link{i}", mass, moments, com=(0.5, 0, 0), on=previous, position=(1.0 if i else 0.0, 0, 0))
        scene.revolute(f"joint{i}", previous, f"link{i}", axis=np.roll((0, 0, 1), i), frame=f"link{i}")
        previous = f"link{i}"
    return scene


def tip_chain(rest: float, tip: float) -> gauss.Scene:
    """Ten links, the last of another mass."""
    return chain([rest] * 9 + [tip])


def states(system, count: int) -> list[Compulsion]:
    """Compulsions of random states with random drives."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        if system.has_closures:
            nudge = random_state(system, rng, spread=0.2, slide=0.05)
            state = system.initial_state(nudge.q, nudge.v)
        else:
            state = random_state(system, rng)
        found.append(gauss.assemble(system, state, rng.standard_normal(system.n_v)))
    return found


def measure(backend: str, compulsions, references) -> dict:
    """Worst error, claims and certificates, and median time of one backend on one problem."""
    method = make(backend)
    errors, times, certified, claimed, silent, reason = [], [], 0, 0, 0, ""
    for compulsion, reference in zip(compulsions, references, strict=True):
        begin = time.perf_counter()
        solution = gauss.solve(compulsion, method)
        times.append(time.perf_counter() - begin)
        finite = np.isfinite(solution.qdd).all()
        errors.append(np.abs(solution.qdd - reference).max() / np.abs(reference).max() if finite else np.nan)
        certified += solution.status.certified
        claimed += solution.status.found
        silent += solution.status.found and not errors[-1] <= WRONG
        reason = reason or solution.status.reason
    return {
        "worst_error": max(errors) if np.isfinite(errors).all() else np.nan,
        "certified": certified,
        "claimed": claimed,
        "states": len(errors),
        "claimed_but_wrong": silent,
        "median_ms_with_certificate": 1e3 * median(times),
        "reason": reason[:100],
    }


def table(rows) -> str:
    """Markdown: backend against problem; errors that are not certified stand in brackets."""
    names = list(dict.fromkeys(row["problem"] for row in rows))
    lines = ["| backend | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for backend in dict.fromkeys(row["backend"] for row in rows):
        cells = [_cell(next(r for r in rows if r["backend"] == backend and r["problem"] == name)) for name in names]
        lines.append(f"| {backend} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row) -> str:
    if row["backend"] == REFERENCE:
        return "reference"
    if np.isnan(row["worst_error"]):
        return "refused" if not row["claimed"] else "not finite"
    text = f"{row['worst_error']:.0e}"
    return text if row["certified"] == row["states"] else f"({text})"


def main():
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--states", type=int, default=5, help="random states per problem")
    count = parser.parse_args().states
    rows = []
    for problem, system in problems().items():
        compulsions = states(system, count)
        references = [gauss.solve(c, REFERENCE).qdd for c in compulsions]
        for backend in available():
            rows.append({"problem": problem, "backend": backend} | measure(backend, compulsions, references))
            print(f"{problem:28} {backend:10} {_cell(rows[-1])}", flush=True)
    RESULTS.mkdir(exist_ok=True)
    lines = header("gauss", "numpy", "scipy", "qpsolvers", *sorted({"osqp", "clarabel", "daqp", "piqp", "proxsuite", "scs"}))
    with open(RESULTS / "backend_accuracy.csv", "w", newline="") as file:
        file.writelines(f"# {line}\n" for line in lines)
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    note = "Worst relative error of q̈ over the states; in brackets: not certified, hence reported as not solved."
    text = "\n".join(["# Accuracy of backends", "", *(f"- {line}" for line in lines), "", note, "", table(rows), ""])
    (RESULTS / "backend_accuracy.md").write_text(text)


if __name__ == "__main__":
    main()
