"""Loops over coordinates in machine code compute what the source over numbers does: chart, compensated step, first step."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.integrators import METHODS, Chart, Point, Rates, Tolerance, advance, first_step
from gauss.simulation.compiled_steps.explicit_stages import ExplicitStages
from gauss.system import random_state

SAME = 1e-12  # relative difference by rounding
SCENES = {name: lambda name=name: gauss.load(name) for name in ("double_pendulum", "free_body")}
SHARES = {"equal": lambda n: None, "different": lambda n: np.arange(1.0, 2 * n + 1).reshape(2, n)}


class _Equations:
    """Equations of motion by compiled rates."""

    def __init__(self, program: Program):
        self.system, self.rates = program.system, Kernel(program.rates, batch=False)

    def evaluate(self, state) -> Rates:
        found = self.rates(np.concatenate([[state.t], state.q, state.v]))
        return Rates(*np.split(found, [self.system.n_v]))


def _case(name: str, shares: str = "equal"):
    system, method = gauss.compile_scene(SCENES[name]()), METHODS["dop853"]
    program = Program(system, Laws(system), memory=method.state_size(system))
    stages = ExplicitStages(program, method, shares=SHARES[shares](system.n_v))
    state, equations = random_state(system, np.random.default_rng(1)), _Equations(program)
    lost = 1e-13 * np.arange(method.state_size(system))
    return stages, equations, Point(state, np.zeros(3), equations.evaluate(state), lost)


def _near(found, expected):
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    assert np.abs(found - expected).max() <= SAME * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("name", SCENES)
def test_a_slope_is_that_of_the_chart(name):
    stages, equations, point = _case(name)
    y = np.zeros(stages.row)
    y[: stages.n_y] = np.random.default_rng(2).uniform(-0.5, 0.5, stages.n_y)
    slope = stages._slope_function(stages.layout.size, stages.row)
    found = Kernel(slope, batch=False)(np.concatenate([stages.layout.pack(point), [0.3], y]))
    _near(found[: stages.n_y], Chart(equations, point.state)(0.3, y[: stages.n_y]))


@pytest.mark.parametrize("name", SCENES)
def test_a_finished_step_is_the_compensated_one(name):
    stages, equations, point = _case(name)
    change, h = np.random.default_rng(3).uniform(-0.1, 0.1, stages.row), 0.01
    finish = stages.functions()[0].finish
    found = Kernel(finish, batch=False)(np.concatenate([stages.layout.pack(point), [h], change]))
    compensation = point.method_state[:-2]
    chart = Chart(equations, point.state)
    expected = advance(chart, Point(*[*vars(point).values()][:3], compensation), h, change[: stages.n_y])
    size, memory = stages.layout.size, point.method_state.size
    before = slice(0, size - memory)
    _near(found[before], stages.layout.pack(expected)[before])
    assert np.abs(found[size - memory : size - 2] - expected.method_state).max() <= 1e-15
    assert found[size - 1] == point.method_state[-1] + 1.0


@pytest.mark.parametrize("shares", SHARES)
@pytest.mark.parametrize("name", SCENES)
def test_the_first_step_is_that_of_the_source(name, shares):
    stages, equations, point = _case(name, shares)
    settings = 1e-8, 1e-9, 1e-7
    check = write(stages.program.watched_point, stages.layout.size, name="check")
    state = point.state
    given = np.concatenate([[state.t], state.q, state.v, settings])
    h = Kernel(stages.first(check), batch=False)(given)[-1]
    expected = first_step(equations, point, Tolerance(*settings, stages.shares), 8)
    assert abs(h - expected) <= 1e-10 * expected


@pytest.mark.slow
@pytest.mark.parametrize("shares", SHARES)
@pytest.mark.parametrize("name", SCENES)
def test_the_error_is_that_of_the_source(name, shares):
    stages, equations, point = _case(name, shares)
    rng, size, settings = np.random.default_rng(4), stages.layout.size, (1e-8, 1e-9, 1e-7)
    other = Point(random_state(equations.system, rng), point.work, point.rates, point.method_state)
    estimates = 1e-9 * rng.standard_normal((2, stages.row))
    given = [stages.layout.pack(point), [0.02, *settings, 0.0, 0.0, 1e-9], stages.layout.pack(other), np.ones(13)]
    control = stages.functions()[0].control
    found = Kernel(control, batch=False)(np.concatenate([*given, *estimates]))
    ends, tolerance = (point.state, other.state), Tolerance(*settings, stages.shares)
    expected = stages.method.error(equations.system, ends, estimates, 0.02, tolerance)
    assert abs(found[0] - expected) <= 1e-12 * expected
    assert size == len(given[0])
