"""Memory of a process that moves many different scenes: the machine code of scenes that are gone is given back.

Run it with:

    python -m benchmarks.memory [--scenes 2000]

Each scene is a pendulum of another mass, whose motion is compiled anew, as in a process of a user. Resident
memory is read from /proc, at the twentieth scene, after which nothing is loaded for the first time, and at the last one.
"""

import argparse
import gc
import os

os.environ["GAUSS_TIER"], os.environ["GAUSS_CACHE"] = "auto", ""

import gauss  # noqa: E402

SETTLED = 20  # number of scenes until all modules are imported and all shared code is made
LIMIT = 100.0  # growth allowed for 2 000 scenes [MB]


def resident() -> float:
    """Resident memory of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def move(number: int):
    """Compile and simulate a scene that differs from all others."""
    scene = gauss.Scene(f"pendulum {number}")
    scene.body("rod", mass=1.0 + 1e-3 * number, inertia=(0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0))
    scene.revolute("J", "ground", "rod", at=(0, 0, 0), axis=(0, 0, 1))
    scene.start("J", 0.3)
    gauss.simulate(scene, 0.01, rtol=1e-8, progress=False)


def growth(scenes: int) -> float:
    """Growth of resident memory from the twentieth scene to the last one [MB]."""
    for number in range(SETTLED):
        move(number)
    gc.collect()
    before = resident()
    for number in range(SETTLED, scenes):
        move(number)
    gc.collect()
    return resident() - before


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.memory", description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=2_000, help="number of scenes")
    given = parser.parse_args()
    print(f"{given.scenes} scenes: {growth(given.scenes):.1f} MB more; at most {LIMIT:g} MB for 2000")
