"""Writes the references of A03 to A05: accelerations that gauss traces, stepped by heyoka's Taylor method in 80 bits.

Bricard's linkage falls from rest and has one freedom: it comes to rest again after half a period, and swings back the same
way. Half a period tells the whole motion.
"""

import json

import numpy as np

import gauss
from benchmarks.iftomm.problems import TABLES, BenchmarkProblem, problems
from benchmarks.work_precision.heyoka_ import HeyokaTaylor
from gauss.simulation.motion_records import Stats

TOLERANCE = 1e-18
NEWTON = 4  # steps to where the rates vanish


def table(problem: BenchmarkProblem) -> np.ndarray:
    """What is looked at (k, m), at the samples of a problem."""
    system = gauss.compile_scene(problem.make())
    taylor = HeyokaTaylor(system, TOLERANCE, np.longdouble)
    t = problem.times.astype(np.longdouble)
    if "Bricard" in problem.name:
        half = _rest(taylor, near=2.5)
        t = half - np.abs(half - t % (2 * half))
    order = np.argsort(t)
    states = np.empty((t.size, taylor.start.size))
    states[order] = taylor.states(t[order])
    q, v = np.split(states, [system.n_q], axis=1)
    stats = Stats(0, 0, 0, 0, 0.0, 0.0, "Taylor")
    return problem.seen(gauss.Trajectory(system, problem.times, q, v, np.zeros((t.size, 3)), stats))


def _rest(taylor: HeyokaTaylor, near: float) -> np.longdouble:
    """When the rates vanish."""
    integrator, first = taylor.begun(), taylor.system.n_q
    integrator.propagate_until(np.longdouble(near))
    for _ in range(NEWTON):
        before, step = integrator.state[first], np.longdouble(1e-3)
        integrator.propagate_for(step)
        slope = (integrator.state[first] - before) / step
        integrator.propagate_for(-step - before / slope)
    return integrator.time


def main():
    """Write the file."""
    made = {problem.name: table(problem).tolist() for problem in problems() if problem.against.startswith("Taylor")}
    about = {
        "name": "iftomm",
        "source": "IFToMM library of computational benchmark problems, A03 to A05",
        "description": "A03: x, y of the crank's tip F [m]; A04: x, y, z of P3 [m]; A05: height s of the slider [m]; at 401 "
        "equally spaced times from 0 to the time in the name",
        "digits_trusted": 12,
        "how_obtained": "accelerations traced by gauss, heyoka's Taylor method in 80 bits, tolerance 1e-18; A04 by half a "
        "period, which the motion retraces; A03 agrees with the independent table andrews-squeezer.json",
        "tables": made,
    }
    TABLES.write_text(json.dumps(about, indent=None, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
