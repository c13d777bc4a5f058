"""Rotor chains: what one evaluation costs from 100 to 1000 shafts, a fifth of the links slipping.

Run it with:

    python -m benchmarks.rotors [--rounds 40]

* kernel: accelerations, link torques, powers and heats of one instant in machine code;
* rates: what the integrator calls, with what is held by friction and clutches, from Python;
* plain: the same equations as Python numbers, not compiled.

Processor time of the one thread is counted; rounds are interleaved over the sizes, and the least is quoted: what else runs
on the machine only adds, by driving the code out of its caches. A straight line a + b n is fitted to the times of each; its
largest deviation from a time is quoted, with the limit of 20 %. Agreement is the largest difference of kernel and plain,
over the largest acceleration. Writes benchmarks/results/rotors.csv and .md, and the figure of the harvester's run-up.
"""

import argparse
import csv
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import gauss  # noqa: E402
from benchmarks.machine import header  # noqa: E402
from gauss.rotors import Linear, Network, Viscous, simulate  # noqa: E402
from gauss.rotors.contract import reduce  # noqa: E402
from gauss.rotors.mechanics import NetworkEquations  # noqa: E402
from gauss.rotors.run import RotorRun  # noqa: E402
from gauss.rotors.switching import switching  # noqa: E402
from gauss.view import plot_rotors  # noqa: E402

RESULTS = Path(__file__).parent / "results"
SIZES = (100, 200, 300, 500, 700, 1000)
GROUP = 5  # shafts between two friction drives
LIMIT = 0.2  # deviation from a straight line
KINDS = ("kernel", "rates", "plain")


def chain(n: int, speed: float = 140.0) -> Network:
    """Chain of n shafts, n/5 friction drives between groups of gears with losses, a motor at its head, turning."""
    network = Network(f"chain of {n}")
    for j in range(n):
        slips = j % GROUP == 1
        ratio = (1.05, 1 / 1.05)[j % 2] if not slips else (-1.02, 1.02)[j % 2]
        speed = speed / ratio if j else speed
        network.shaft(f"shaft {j}", 0.2 + 0.05 * (j % 4), speed if slips or not j else None)
        if slips:
            network.friction_drive(f"drive {j}", f"shaft {j}", f"shaft {j - 1}", ratio, (200.0, 4.0, 0.02), efficiency=0.99)
        elif j:
            network.gear(f"gear {j}", f"shaft {j}", f"shaft {j - 1}", ratio, efficiency=0.995)
        network.torque(f"shaft {j}", Viscous(0.001))
    network.torque("shaft 0", Linear(5.0, 150.0))
    return network


class Case:
    """A chain, ready to be measured."""

    def __init__(self, n: int):
        self.n, network = n, chain(n)
        reduced = reduce(network)
        begin = time.process_time()
        self.equations = NetworkEquations(reduced, compiled=True)
        self.compiling = time.process_time() - begin
        self.run = RotorRun(self.equations, "dop853", 1e-9, (1e-9, 1e-9), np.inf, switching(reduced, 1.0, 1e-9))
        self.run.start()
        self.plain = NetworkEquations(reduced, compiled=False)
        at = (0.0, *self.run.split(self.run.y), self.run.phase.conditions)
        self.calls = {
            "kernel": (200, lambda: self.equations(*at)),
            "rates": (50, lambda: self.run.rates(0.0, self.run.y)),
            "plain": (1, lambda: self.plain(*at)),
        }
        self.times = {kind: [] for kind in KINDS}
        ours, theirs = (equations(*at).acceleration for equations in (self.equations, self.plain))
        self.agreement = float(np.abs(ours - theirs).max() / np.abs(theirs).max())

    def round(self):
        """Measure each kind once."""
        for kind, (repeats, call) in self.calls.items():
            begin = time.process_time()
            for _ in range(repeats):
                call()
            self.times[kind].append((time.process_time() - begin) / repeats)

    def row(self) -> dict:
        """What was measured."""
        found = {"shafts": self.n, "drives": len(self.run.reduced.friction_drives), "coordinates": self.run.reduced.n_groups}
        found |= {f"{kind}_us": 1e6 * min(self.times[kind]) for kind in KINDS}
        return found | {
            "kernel_ns_per_shaft": 1e9 * min(self.times["kernel"]) / self.n,
            "compile_s": self.compiling,
            "agreement": self.agreement,
        }


def deviation(rows, kind: str) -> tuple[float, float, float]:
    """Straight line a + b n [s] through the times, least relative squares, and its largest relative deviation."""
    n, times = (np.array([row[key] for row in rows], dtype=float) for key in ("shafts", f"{kind}_us"))
    basis = np.column_stack([np.ones_like(n), n]) / times[:, None]
    a, b = np.linalg.lstsq(basis, np.ones_like(n), rcond=None)[0]
    return a, b, float(np.abs((a + b * n) / times - 1).max())


COLUMNS = {
    "shafts": "{shafts}",
    "slipping links": "{drives}",
    "coordinates": "{coordinates}",
    "kernel": "{kernel_us:.2f} µs",
    "kernel, a shaft": "{kernel_ns_per_shaft:.1f} ns",
    "rates": "{rates_us:.1f} µs",
    "plain": "{plain_us:.0f} µs",
    "trace and compile": "{compile_s:.2f} s",
    "kernel agrees with plain": "{agreement:.0e}",
}


def main():
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=40, help="interleaved repetitions")
    rounds = parser.parse_args().rounds
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    cases = [Case(n) for n in SIZES]
    for _ in range(rounds):
        for case in cases:
            case.round()
    rows = [case.row() for case in cases]
    lines = [*header("numpy", "scipy", "llvmlite"), f"times are processor times of one thread, the least of {rounds} rounds"]
    for kind in KINDS:
        a, b, off = deviation(rows, kind)
        verdict = "met" if off <= LIMIT else "missed"
        lines.append(f"{kind}: {a:.3g} µs + {1e3 * b:.4g} ns a shaft within {off:.1%}; limit {LIMIT:.0%} {verdict}")
    RESULTS.mkdir(exist_ok=True)
    with open(RESULTS / "rotors.csv", "w", newline="") as file:
        file.writelines(f"# {line}\n" for line in lines)
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    table = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    table += ["| " + " | ".join(cell.format(**row) for cell in COLUMNS.values()) + " |" for row in rows]
    text = "\n".join(["# Speed of rotor chains", "", *(f"- {line}" for line in lines), "", *table, ""])
    (RESULTS / "rotors.md").write_text(text)
    print(text)
    harvester = simulate(gauss.load_rotors("harvester"), 14.0, times=np.linspace(0.0, 14.0, 701))
    plot_rotors(harvester, RESULTS / "rotor_harvester.png")


if __name__ == "__main__":
    main()
