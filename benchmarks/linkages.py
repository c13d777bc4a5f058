"""Planar linkages: a full cycle group by group, as numpy and as machine code, beside Gauss's principle on the same linkage.

Run it with:

    python -m benchmarks.linkages [--rounds 15]

* numpy: ``linkage.cycle`` at 3600 crank angles, all positions, rates, accelerations, reactions and the torque, with the
  decomposition into groups and all checks; kernel: torque and reactions at the same angles by ``cycle_kernel``;
* scene: the same instant of the linkage's Gauss scene, ``gauss.assemble`` and ``gauss.solve``, certified, one crank angle;
* forward dynamics under the same motor: one evaluation of the reduced equation from Python; a run of 2 s at rtol 1e-8 by
  ``linkage.run`` and by ``gauss.simulate`` on the scene.

Processor time of the one thread is counted, so that other work on the machine does not enter; rounds are interleaved,
medians are quoted. Agreement is the largest difference of torque and reactions, relative to the largest of them: kernel
against numpy at all angles, scene against numpy at 24. Writes benchmarks/results/linkages.csv and .md, and the figure of the
four-bar's cycle.
"""

import os
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import gauss  # noqa: E402
from benchmarks.command import RESULTS, agreeing, command  # noqa: E402
from gauss.bench.contest import Competitor, interleaved, repeated, with_time  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import formatted_table, head  # noqa: E402
from gauss.io import linkages  # noqa: E402
from gauss.linkages import ReducedLinkage, cycle_kernel, scene_state  # noqa: E402
from gauss.linkages.crank_ranges import near  # noqa: E402
from gauss.view import plot_linkage  # noqa: E402

ANGLES = 3600
STATES = 24
RUN = 2.0  # s
STALL, SLOPE = 120.0, 6.0  # motor torque 120 N m less 6 N m s/rad times the speed
ROUNDING = 1e-12  # relative to the largest torque or reaction
LIMIT = 2.0  # ms that a cycle of the four-bar may take


def measured(name: str, rounds: int) -> dict:
    """Times and agreement of one linkage."""
    linkage = gauss.load_linkage(name)
    angles = np.linspace(0.0, 2 * np.pi, ANGLES, endpoint=False)
    found = linkage.cycle(angles)
    kernel, made = with_time(lambda: cycle_kernel(linkage.chain))
    rows = [angles, found.motion.crank_speed, np.zeros(ANGLES)]
    inputs = np.array(rows + [row for pose in near(linkage.chain, angles).values() for row in pose])
    equation = ReducedLinkage(linkage.chain)
    system = gauss.compile_scene(linkage.to_scene())
    states = [scene_state(system, found, k) for k in range(0, ANGLES, ANGLES // STATES)]
    free = gauss.compile_scene(linkage.to_scene(torque=lambda t, motion: STALL - SLOPE * motion.rate("A")))
    start = scene_state(free, linkage.cycle([0.0]), 0)
    scale = max(np.abs(found.torque).max(), *(np.abs(value).max() for value in found.reactions.values()))
    motor = {"speed": linkage.drives[0].speed, "rtol": 1e-8}
    tasks = {
        "numpy": Competitor(lambda: linkage.cycle(angles)),
        "kernel": Competitor(lambda: kernel(inputs)),
        "scene": Competitor(lambda: [gauss.solve(gauss.assemble(system, state)) for state in states], len(states)),
        "reduced": Competitor(repeated(lambda: equation.acceleration(0.5, 10.0, STALL), 1000), 1000),
        "run_reduced": Competitor(lambda: linkage.run(RUN, lambda t, angle, speed: STALL - SLOPE * speed, **motor), every=5),
        "run_scene": Competitor(
            lambda: gauss.simulate(free, RUN, state=start, rtol=1e-8, atol=1e-10, progress=False), every=5
        ),
    }
    seconds = {key: median(values) for key, values in interleaved(tasks, rounds).items()}
    return {
        "linkage": name,
        "groups": " + ".join(group.kind for group in linkage.chain.groups),
        "operations": sum(kernel.operations.values()),
        "numpy_ms": 1e3 * seconds["numpy"],
        "kernel_us": 1e6 * seconds["kernel"],
        "kernel_per_angle_ns": 1e9 * seconds["kernel"] / ANGLES,
        "scene_per_angle_us": 1e6 * seconds["scene"],
        "scene_over_numpy": seconds["scene"] * ANGLES / seconds["numpy"],
        "kernel_agreement": agreeing(_kernel_agreement(kernel(inputs), found) / scale, ROUNDING, f"{name}, kernel"),
        "scene_agreement": agreeing(
            max(_scene_agreement(system, state, found, k) for k, state in _indexed(states)) / scale,
            ROUNDING,
            f"{name}, scene",
        ),
        "reduced_us": 1e6 * seconds["reduced"],
        "run_reduced_ms": 1e3 * seconds["run_reduced"],
        "run_scene_ms": 1e3 * seconds["run_scene"],
        "compile_s": made,
    }


def _indexed(states):
    return ((k * (ANGLES // STATES), state) for k, state in enumerate(states))


def _kernel_agreement(outputs, found) -> float:
    expected = [found.torque, *(part for value in found.reactions.values() for part in (value.real, value.imag))]
    return max(np.abs(ours - theirs).max() for ours, theirs in zip(outputs, expected, strict=True))


def _scene_agreement(system, state, found, index: int) -> float:
    multipliers = -gauss.solve(gauss.assemble(system, state)).multipliers
    rows = {constraint.name: constraint.rows for constraint in system.structure.constraints}
    apart = [abs(multipliers[rows[f"drive of {found.chain.pivot.name}"]][0] - found.torque[index])]
    for joint in found.chain.joints:
        apart.append(np.abs(multipliers[rows[joint.name]][3:5] - found.reaction(joint.name).force[index]).max())
    return float(max(apart))


COLUMNS = {
    "linkage": "{linkage}",
    "groups": "{groups}",
    "numpy, 3600 angles": "{numpy_ms:.2f} ms",
    "kernel, 3600 angles": "{kernel_us:.0f} µs",
    "kernel, one angle": "{kernel_per_angle_ns:.1f} ns",
    "scene, one angle": "{scene_per_angle_us:.0f} µs",
    "scene / numpy": "{scene_over_numpy:.0f}",
    "kernel agrees": "{kernel_agreement:.0e}",
    "scene agrees": "{scene_agreement:.0e}",
    "θ̈ by the reduced equation": "{reduced_us:.1f} µs",
    "2 s, reduced": "{run_reduced_ms:.0f} ms",
    "2 s, scene": "{run_scene_ms:.0f} ms",
    "trace and compile": "{compile_s:.2f} s",
}


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    rows = [measured(name, rounds) for name in linkages()]
    four_bar = next(one for one in rows if one["linkage"] == "four_bar")["numpy_ms"]
    lines = [*header("numpy", "scipy", "llvmlite"), "times are processor times of one thread, medians"]
    verdict = "met" if four_bar <= LIMIT else "missed"
    lines.append(f"limit for the four-bar's cycle in numpy: {LIMIT:g} ms, {verdict} with {four_bar:.2f} ms")
    return rows, lines


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    return [*head("Speed of linkages", conditions), *formatted_table(COLUMNS, rows), ""]


def main():
    """Measure, write, draw."""
    if command("linkages", __doc__, measure, page)["report"]:
        return
    linkage = gauss.load_linkage("four_bar")
    plot_linkage(linkage.cycle(linkage.sweep()), RESULTS / "linkage_four_bar.png")


if __name__ == "__main__":
    main()
