"""Functions that share one elimination compute the same, whether they call each other or stand in one piece."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, write
from gauss.dynamics import shared_elimination
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.traced_system import Program
from gauss.integrators import Point, Rates
from gauss.system import retract

pytestmark = pytest.mark.slow

SAME = 1e-12  # relative to the largest output: a Newton step and three solutions in a row
NEAR = 1e-3  # of the units of the coordinates: distance of the states from the constraints
NAMES = ("four_bar", "bricard", "cardan", "slider_crank", "rolling_disk", "planetary_gears")  # those with constraints
BAUMGARTE = Drift(gains=(3.0, 4.0))


def outputs(system, drift: Drift) -> dict[str, np.ndarray]:
    """Outputs of the functions of a system for one state beside the constraints."""
    program, start = Program(system, Laws(system), drift), system.initial_state()
    step = NEAR * np.random.default_rng(0).standard_normal(system.n_v) * system.scale.coordinates
    q, v = retract(system, start.q, step), start.v + step / system.scale.time
    state = np.concatenate([[start.t], q, v])
    point = program.layout.pack(Point(start, np.zeros(3), Rates(v, np.zeros(3))))
    found = {"rates": (program.monitored_rates, state), "along": (program.along, state)}
    found["projected"] = program.projected_rates, state
    found["check"] = write(program.check, program.layout.size), point
    found["check with forces"] = write(program.check, program.layout.size, system.n_v), np.concatenate([point, v])
    return {name: Kernel(function, batch=False)(given) for name, (function, given) in found.items()}


@pytest.mark.parametrize(("name", "drift"), [*((name, Drift()) for name in NAMES), ("four_bar", BAUMGARTE)])
def test_calls_compute_what_one_piece_computes(name, drift, monkeypatch):
    """Loops, redundant rows, couplings, relations, rolling; with projection and with Baumgarte feedback."""
    system = gauss.compile_scene(gauss.load(name))
    for limit in ("MOST_INLINED_OPERATIONS", "MOST_PLACE_OPERATIONS"):
        monkeypatch.setattr(shared_elimination, limit, 0)
    called = outputs(system, drift)
    for limit in ("MOST_INLINED_OPERATIONS", "MOST_PLACE_OPERATIONS"):
        monkeypatch.setattr(shared_elimination, limit, 10**9)
    for key, expected in outputs(system, drift).items():
        assert called[key] == pytest.approx(expected, rel=SAME, abs=SAME * max(1.0, np.abs(expected).max())), key
