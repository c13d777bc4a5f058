"""Motions with loops eliminated where they close, against those of the general elimination."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics import programs
from gauss.dynamics.embedded_aba import Embedding
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.programs import EmbeddedProgram
from gauss.dynamics.rules import Plan
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.traced_system import Program
from gauss.integrators import Point, Rates
from gauss.system import retract
from tests.dynamics.test_embedded_loops import SCENES, _platform

pytestmark = pytest.mark.slow

SAME = 1e-9  # relative to the largest output: both eliminations lose digits near singular states
DAMPED = 1e-3  # of the error of wrong accelerations: the general elimination damps the residual of the constraints
REGULARISED = 1e-6  # of projected states: so are the Newton steps of the general elimination
SAME_MOTION = 1e-9  # of coordinates and rates after some steps, relative to the largest
NEAR = 1e-3  # of the units of the coordinates: distance of the states from the constraints
MOTIONS = SCENES | {"delta": lambda: gauss.load("delta_robot")}
GENERAL, EMBEDDED = (Plan("compiled loop", dynamics) for dynamics in ("compiled", "embedded loops"))
RK4 = {"integrator": "rk4", "step": 1e-3}


def _outputs(system, kind: type[Program], drift: Drift) -> dict[str, np.ndarray]:
    """Outputs of the functions of a system for states beside the constraints; singularities are left out."""
    program, start, n = kind(system, Laws(system), drift), system.initial_state(), system.n_v
    step = NEAR * np.random.default_rng(0).standard_normal(n) * system.scale.coordinates
    q, v = retract(system, start.q, step), start.v + step / system.scale.time
    state = np.concatenate([[start.t], q, v])
    point = program.layout.pack(Point(start, np.zeros(3), Rates(v, np.zeros(3))))  # with wrong accelerations
    check = write(program.check, program.layout.size, n)
    return {
        "rates": Kernel(program.monitored_rates, batch=False)(state)[: n + 3],
        "along": Kernel(program.along, batch=False)(state),
        "projected": Kernel(program.projected_rates, batch=False)(state)[: system.n_q + 2 * n + 3],
        "check": Kernel(check, batch=False)(np.concatenate([point, v])),
    }


@pytest.mark.parametrize("drift", [Drift(), Drift(gains=(3.0, 4.0))], ids=["projection", "Baumgarte"])
@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "rolling_disk", "belt", "platform on hinges", "crossed loops"])
def test_functions_of_both_eliminations_agree(name, drift):
    system = gauss.compile_scene(SCENES[name]())
    found, expected = (_outputs(system, kind, drift) for kind in (EmbeddedProgram, Program))
    for key, own in expected.items():
        within = {"check": DAMPED, "projected": REGULARISED}.get(key, SAME)
        assert found[key] == pytest.approx(own, rel=within, abs=within * max(1.0, np.abs(own).max())), key


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_of_both_eliminations_agree(name):
    system = gauss.compile_scene(MOTIONS[name]())
    found, expected = (gauss.simulate(system, 0.01, plan=plan, progress=False, **RK4) for plan in (EMBEDDED, GENERAL))
    assert found.stats.plan.dynamics == "embedded loops" and found.stats.handed_over is None
    for one, two in ((found.q, expected.q), (found.v, expected.v)):
        assert np.abs(one - two).max() <= SAME_MOTION * max(1.0, np.abs(two).max())


def test_a_batch_makes_the_motions_of_the_general_elimination():
    system = gauss.compile_scene(gauss.load("slider_crank"))
    start = system.initial_state()
    batch = gauss.rollout(system, np.tile(start.q, (3, 1)), np.tile(start.v, (3, 1)), integrator="rk4", step=1e-3, steps=10)
    expected = gauss.simulate(system, 0.01, plan=GENERAL, progress=False, **RK4)
    assert np.abs(batch.q[:, -1] - expected.q[-1]).max() <= SAME_MOTION * max(1.0, np.abs(expected.q[-1]).max())


@pytest.mark.parametrize("method", [{}, RK4], ids=["dop853", "rk4"])
def test_a_motion_near_a_singular_front_goes_on_with_the_general_elimination(method, monkeypatch):
    """A stretched leg cannot meet its own rows, though the platform moves on."""
    monkeypatch.setattr(programs, "embedding_of", lambda system: Embedding())
    system = gauss.compile_scene(replace(_platform("revolute", reach=2.0), gravity=(0.0, 0.1, -9.7)))  # a scene of its own
    found, expected = (gauss.simulate(system, 0.01, plan=plan, progress=False, **method) for plan in (EMBEDDED, GENERAL))
    assert found.stats.handed_over is not None and expected.stats.handed_over is None
    assert np.abs(found.q[-1] - expected.q[-1]).max() <= SAME_MOTION
