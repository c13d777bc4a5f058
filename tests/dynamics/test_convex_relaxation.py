"""The convex relaxation of many bodies, as sparse products, is that of one matrix; its steps are bounded."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import packed_balls
from gauss.dynamics.contact import convex_relaxation, free_body_step
from gauss.dynamics.contact.contact_step import CONVEX_ERROR, ContactProblem
from gauss.dynamics.contact.free_body_step import FreeBodyStepper

STEP = 1e-3  # [s]
LARGEST_TOLD = 1.0  # relative error
FEW_STEPS = 30  # of the relaxation
SAME_VELOCITY = 100.0 * CONVEX_ERROR  # [m/s] between two forces of that error: the function is flat near its minimum


@pytest.fixture
def unmet(monkeypatch):
    """Stepper of jolted balls whose Newton steps are never accepted, the forces that it finds, and the state."""
    scene, _ = packed_balls(12, 3, jolt=0.1)
    system = gauss.compile_scene(scene)
    monkeypatch.setattr(free_body_step, "UNSOLVED", -1.0)

    def step(most: int):
        monkeypatch.setattr(free_body_step, "DENSE_CONTACTS", most)
        return FreeBodyStepper(system).python_step(system.initial_state(), STEP)

    return step


@pytest.mark.slow
def test_sparse_products_find_the_velocities_of_one_matrix(unmet, monkeypatch):
    monkeypatch.setattr(ContactProblem, "solve", lambda self, start: (self._convex(start), None))
    sparse, dense = unmet(0), unmet(10**6)
    assert sparse.error is None and dense.error is None
    assert sparse.v == pytest.approx(dense.v, abs=SAME_VELOCITY)


def test_steps_end_and_the_lesser_error_is_told(unmet, monkeypatch):
    monkeypatch.setattr(convex_relaxation, "SPARSE_STEPS", FEW_STEPS)
    found = unmet(0)
    assert found.error is not None and np.isfinite(found.v).all()
    assert found.error <= LARGEST_TOLD
