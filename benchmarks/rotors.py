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

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import gauss  # noqa: E402
from benchmarks.command import RESULTS, agreeing, command  # noqa: E402
from gauss.bench.contest import Competitor, interleaved, repeated, with_time  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import formatted_table, head  # noqa: E402
from gauss.rotors import Linear, Network, Viscous, simulate  # noqa: E402
from gauss.rotors.contract import reduce  # noqa: E402
from gauss.rotors.mechanics import NetworkEquations  # noqa: E402
from gauss.rotors.run import RotorRun  # noqa: E402
from gauss.rotors.switching import switching  # noqa: E402
from gauss.view import plot_rotors  # noqa: E402

SIZES = (100, 200, 300, 500, 700, 1000)
GROUP = 5  # shafts between two friction drives
ROUNDING = 1e-12  # relative to the largest acceleration
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


class MeasuredChain:
    """A chain, ready to be measured."""

    def __init__(self, n: int):
        self.n, network = n, chain(n)
        reduced = reduce(network)
        self.equations, self.compiling = with_time(lambda: NetworkEquations(reduced, compiled=True))
        self.run = RotorRun(self.equations, "dop853", 1e-9, (1e-9, 1e-9), np.inf, switching(reduced, 1.0, 1e-9))
        self.run.start()
        self.plain = NetworkEquations(reduced, compiled=False)
        at = (0.0, *self.run.split(self.run.y), self.run.phase.conditions)
        calls = {
            "kernel": (200, lambda: self.equations(*at)),
            "rates": (50, lambda: self.run.rates(0.0, self.run.y)),
            "plain": (1, lambda: self.plain(*at)),
        }
        self.tasks = {kind: Competitor(repeated(call, count), count) for kind, (count, call) in calls.items()}
        ours, theirs = (equations(*at).acceleration for equations in (self.equations, self.plain))
        apart = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
        self.agreement = agreeing(apart, ROUNDING, f"chain of {n} shafts")

    def row(self, seconds: dict[str, float]) -> dict:
        """Row of the table, of the times of a call by kind."""
        found: dict[str, float] = {
            "shafts": self.n,
            "drives": len(self.run.reduced.friction_drives),
            "coordinates": self.run.reduced.n_groups,
        }
        found |= {f"{kind}_us": 1e6 * seconds[kind] for kind in KINDS}
        return found | {
            "kernel_ns_per_shaft": 1e9 * seconds["kernel"] / self.n,
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
    "shafts": "{shafts:.0f}",
    "slipping links": "{drives:.0f}",
    "coordinates": "{coordinates:.0f}",
    "kernel": "{kernel_us:.2f} µs",
    "kernel, a shaft": "{kernel_ns_per_shaft:.1f} ns",
    "rates": "{rates_us:.1f} µs",
    "plain": "{plain_us:.0f} µs",
    "trace and compile": "{compile_s:.2f} s",
    "kernel agrees with plain": "{agreement:.0e}",
}


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    chains = {n: MeasuredChain(n) for n in SIZES}
    tasks = {(n, kind): task for n, one in chains.items() for kind, task in one.tasks.items()}
    seconds = interleaved(tasks, rounds)
    rows = [one.row({kind: min(seconds[n, kind]) for kind in KINDS}) for n, one in chains.items()]
    lines = [*header("numpy", "scipy", "llvmlite"), f"times are processor times of one thread, the least of {rounds} rounds"]
    for kind in KINDS:
        a, b, off = deviation(rows, kind)
        verdict = "met" if off <= LIMIT else "missed"
        lines.append(f"{kind}: {a:.3g} µs + {1e3 * b:.4g} ns a shaft within {off:.1%}; limit {LIMIT:.0%} {verdict}")
    return rows, lines


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    return [*head("Speed of rotor chains", conditions), *formatted_table(COLUMNS, rows), ""]


def main():
    """Measure, write, draw."""
    if command("rotors", __doc__, measure, page, {"rounds": (40, "interleaved repetitions")})["report"]:
        return
    harvester = simulate(gauss.load_rotors("harvester"), 14.0, times=np.linspace(0.0, 14.0, 701))
    plot_rotors(harvester, RESULTS / "rotor_harvester.png")


if __name__ == "__main__":
    main()
