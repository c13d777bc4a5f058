"""Motions under tables of many rows: those of the exact integrals of the tables, with steps that end at their rows."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PPoly

import gauss
from gauss import math
from gauss.codegen import Graph
from gauss.dynamics.laws.switching_times import timetable

INTEGRATED = 1e-9  # of a motion with rtol 1e-10 between rows, relative to its largest rate
ROWS = 101
TIMES = np.linspace(0.0, 2.0, ROWS)
FORCES = np.random.default_rng(2).standard_normal(ROWS)


def slider(**law) -> gauss.System:
    """A mass of 1 kg on a rail."""
    scene = gauss.Scene("slider", gravity=(0.0, 0.0, 0.0))
    scene.body("mass", 1.0)
    scene.prismatic("rail", "ground", "mass", axis=(1, 0, 0))
    scene.drive("rail", **law)
    scene.start("rail", position=-0.4, rate=0.3)
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "rk4"])
def test_a_table_of_time_gives_the_motion_of_its_integral(integrator):
    """Every adaptive step ends at a row; fixed steps are divided there."""
    force = PPoly([np.diff(FORCES) / np.diff(TIMES), FORCES[:-1]], TIMES)
    rate = force.antiderivative()
    options = {"rtol": 1e-10} if integrator == "dop853" else {"step": 0.01}
    system = slider(force=lambda t: math.interp(t, TIMES, FORCES))
    motion = gauss.simulate(system, 2.0, integrator=integrator, progress=False, **options)
    exact = 0.3 + rate(motion.t)
    assert motion.v[:, 0] == pytest.approx(exact, abs=INTEGRATED * np.abs(exact).max())


def test_the_rows_of_a_table_are_switching_times():
    """To rounding, of linear functions of the time, in pieces, too."""
    graph = Graph()
    clock = graph.symbol("t")
    expected = TIMES[1:-1]
    for law in (math.interp(clock, TIMES, FORCES), math.piecewise(CubicSpline(TIMES, FORCES), clock)):
        found = timetable([law], clock, 0.0, 1.99).switches
        assert found == pytest.approx(expected, abs=1e-15)
    folded = timetable([math.interp(math.abs(clock - 1.0), TIMES, FORCES)], clock, 0.0, 1.99).switches
    assert np.abs(folded[:, None] - expected).min(axis=0).max() < 1e-14


@pytest.mark.slow
def test_a_table_of_a_coordinate_conserves_the_energy_of_its_integral():
    """A force of the place alone has a potential: the integral of the table."""
    places = np.linspace(-1.0, 1.0, ROWS)
    forces = -4.0 * places + 0.5 * np.sin(40.0 * places)
    potential = PPoly([-np.diff(forces) / np.diff(places), -forces[:-1]], places).antiderivative()
    system = slider(force=lambda t, at: math.interp(at.coordinate("rail"), places, forces))
    motion = gauss.simulate(system, 4.0, rtol=1e-10, progress=False)
    energy = 0.5 * motion.v[:, 0] ** 2 + potential(motion.q[:, 0])
    assert energy == pytest.approx(np.full(motion.t.size, energy[0]), rel=INTEGRATED)
    assert motion.stats.plan.dynamics == "compiled"
