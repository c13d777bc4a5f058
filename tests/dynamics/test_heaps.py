"""Heaps that come to rest: redundant contacts cycle between sticking and slipping, and rounds of Newton steps end."""

import numpy as np
import pytest
from llvmlite import ir

import gauss
from benchmarks.free_bodies import packed_balls
from gauss.codegen import machine
from gauss.codegen.kernels import BlockContactLaws, BlockContactSolver, ContactGraph, Round
from gauss.codegen.kernels.block_contacts import write_block_contacts
from gauss.codegen.kernels.block_lu import write_order
from gauss.dynamics.contact.compiled_free_body_step import FINE, LEAST_CONTACTS, REDUNDANT_ROUNDS
from gauss.dynamics.contact.contact_step import contact_solver
from gauss.dynamics.contact.contact_stepper import new_contact_stepper

pytestmark = pytest.mark.slow

STEP, STEPS, LAST = 1e-3, 30, 15  # [s]; steps of a heap, and those at its end that are looked at
EXACT = 1e-300  # tolerance of the laws that no step meets


@pytest.fixture(scope="module")
def problems():
    """Contact problems of the steps of a heap: (graph, arguments, results)."""
    found, solve = [], ContactGraph.solve

    def recorded(graph, *given):
        found.append((graph, given, solve(graph, *given)))
        return found[-1][2]

    system = gauss.compile_scene(packed_balls(60, 4, jolt=1e-2)[0])
    stepper, state = new_contact_stepper(system), system.initial_state()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ContactGraph, "solve", recorded)
        for _ in range(STEPS):
            step = stepper.python_step(state, STEP)
            state = gauss.State(state.t + STEP, step.q, step.v)
    return found


def test_steps_of_a_heap_end_at_fine_residuals(problems):
    """Most of them within the rounds that every residual takes."""
    at_most = sum(each.steps for each in REDUNDANT_ROUNDS if each.above <= 1.0 and each.below == np.inf)
    assert all(len(graph.bodies) >= LEAST_CONTACTS for graph, *_ in problems)
    results = [(given[-1], result) for _, given, (_, _, result) in problems[-LAST:]]
    assert np.median([steps for _, (_, steps, _) in results]) <= at_most
    assert all(residual <= FINE * tolerance for tolerance, (residual, *_) in results)


@pytest.mark.parametrize(
    ("round_", "made"),
    [
        (Round(0, 1e-7, 5), 5),
        (Round(0, 1e-7, 5, above=np.inf), 0),
        (Round(0, 1e-7, 5, below=1.0), 0),
        (Round(0, 1e-7, 5, decay=0.5), 5),
    ],
)
def test_a_round_is_made_between_its_residuals(problems, round_, made):
    graph, given, _ = problems[0]
    first, laws = Round(0, 1e-2, 3), contact_solver()
    functions = laws.normal, laws.friction, laws.project_normal, laws.project_friction
    module = ir.Module(name="gauss")
    write_order(module)
    write_block_contacts(BlockContactLaws(*functions, (first, round_), (first, round_), 1), module)
    solver = BlockContactSolver(machine.load(str(module)))
    *_, (_, steps, rounds) = solver.graph(graph.n, graph.bodies).solve(*given[:-1], EXACT)
    assert (steps, rounds) == (first.steps + made, 2)
