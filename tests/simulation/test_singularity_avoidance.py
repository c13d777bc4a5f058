"""Where closing rows fade or contradict each other: rounding is foreseen, for one loop and for many in a row."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, NEAR_SINGULAR_ROUNDOFF
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.integrators import METHODS, Point, Rates
from gauss.simulation.compiled_steps.singularity_avoidance import StageNodes
from gauss.system import State, retract

WITHIN = 1000.0  # the worst of many errors beside the estimate; by pivots alone, long ladders are thousands of times worse
RATE, NEAR = 4.8, (1e-2, 3e-3)  # rad/s, rad from flat


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 10])
def test_rounding_near_flat_configurations_is_foreseen(n):
    """Cranks that turn alike: ((n + 1)/3 + n) l θ̈ = g ((n + 1)/2 + n) sin θ."""
    system = gauss.compile_scene(gauss.load("n_four_bar", n=n))
    alike, kernel = system.initial_state().v, Kernel(Program(system, Laws(system)).projected_rates, batch=False)
    for near in NEAR:
        angles = np.pi / 2 - near * np.linspace(1.0, 1.4, 40)
        exact = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n) * np.sin(angles)
        rates = np.outer(alike, np.full(angles.size, RATE))
        found = kernel(np.concatenate([np.zeros((1, angles.size)), np.outer(alike, angles), rates]))
        accelerations, weakness = found[2 * system.n_v : 3 * system.n_v], found[-2]
        error = np.abs(accelerations - np.outer(alike, exact)).max(axis=0)
        noise = NEAR_SINGULAR_ROUNDOFF * RATE**2 * weakness * np.sqrt(weakness)
        assert (error <= WITHIN * noise).all()
        assert (noise <= WITHIN * error.max()).all()


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.0, 1e-8, 1e-6, 1e-4])
def test_rows_that_contradict_each_other_lack_something(off):
    """One of Bricard's rows repeats the others where these are met, and contradicts them beside: no correction shows it."""
    system = gauss.compile_scene(gauss.load("bricard"))
    program, start = Program(system, Laws(system)), system.initial_state()
    q = retract(system, start.q, off * np.random.default_rng(1).uniform(-1.0, 1.0, system.n_v))
    found = Kernel(program.rates, batch=False)(np.concatenate([[0.0], q, start.v]))
    point = Point(State(0.0, q, start.v), np.zeros(3), Rates(*np.split(found, [system.n_v])))
    error, lacking = Kernel(write(program.check, program.layout.size), batch=False)(program.layout.pack(point))
    assert error <= ACCELERATION_TOLERANCE
    assert (lacking <= ACCELERATION_TOLERANCE) == (
        np.abs(position_residual(kinematics(system, point.state))).max() <= ACCELERATION_TOLERANCE
    )


@pytest.mark.parametrize("name", ["dop853", "dopri5"])
def test_steps_are_moved_away_from_singular_configurations(name):
    """What is left of rows grows with the time from there: the place is found, and a shifted step has no stage near."""
    pair = METHODS[name].pair
    nodes = StageNodes(np.append(pair.c, 1.0), pair.extra_c)
    times = np.concatenate([pair.c, [1.0], pair.extra_c])
    for place in np.linspace(0.06, 1.4, 400):
        left = 3.0 * np.abs(np.append(pair.c, 1.0) - place)
        weakest = np.append(pair.c, 1.0)[np.argmin(left)]
        if 0.0 < weakest < 1.0:
            assert nodes.place(left) == pytest.approx(place)
        if place > 1.0:
            assert 1.0 + nodes.ahead(left) == pytest.approx(place)
        factor = nodes.shift(place)
        assert 0.0 < factor <= 1.0
        within = place / factor if place / factor < 1.0 else place - factor  # of this step, or of the next one
        assert np.abs(times - within).min() >= 0.3 * nodes.half
