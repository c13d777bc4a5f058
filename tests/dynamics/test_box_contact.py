"""A box on a plane, on four and on eight points: accelerations, certificates, tipping, landing, forces of least norm."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.backends.solution import Answer
from gauss.dynamics.gap_functions import gaps
from gauss.errors import NonUniqueReactionWarning
from gauss.system import phase_scene

g = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
EXACT = 1e-9  # a motion at rtol 1e-10 over a second or two against its closed form
RELEASE = (
    1e-6  # [s]: a gap opens when it does so with 1e-7 of the accelerations, see LEAVING; what follows is off by its cube
)
QP_BACKENDS = ("daqp", "quadprog", "clarabel", "piqp", "proxqp", "osqp")
QP_TOLERANCE = 1e-7  # of backends asked for 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("backend", QP_BACKENDS)
@pytest.mark.parametrize("corners", [4, 8])
def test_a_box_on_a_plane_slides_and_tips_by_any_backend(backend, corners):
    scene = gauss.load(f"box_on_plane_{corners}")
    system = gauss.compile_scene(scene)
    compulsion = gauss.assemble(system, system.initial_state())
    assert compulsion.G.shape[0] == 4  # the upper four are open
    solution = gauss.solve(compulsion, backend)
    assert str(solution.status) == "solved"
    # the rear feet stay, z̈ = 0.2 ω̇; moments about the centre: F·0.2 − N·0.2 = J ω̇, N = m (g + z̈)
    m, J, F = 2.0, 0.05, 25.0
    turning = 0.2 * (F - m * g) / (J + m * 0.2**2)
    expected = [F / m, 0.0, 0.2 * turning, 0.0, turning, 0.0]
    assert solution.qdd == pytest.approx(expected, abs=QP_TOLERANCE * 12.5)
    assert solution.inequality_multipliers.sum() == pytest.approx(m * (g + 0.2 * turning), rel=1e-6)


def _held(system, names) -> gauss.Solution:
    """Solution in which some gaps are constraints."""
    phase = gauss.compile_scene(phase_scene(system.scene, names))
    return gauss.solve(gauss.assemble(phase, phase.initial_state()), "recursion")


def _falls_through(system, compulsion):
    found = _held(system, [])
    return Answer(found.a, found.qdd, found.multipliers, np.zeros(4), True)


def _glued(system, compulsion):
    sides = [placed.name for placed in system.contacts.placed]
    found, rows = _held(system, sides), len(compulsion.D)
    return Answer(found.a, found.qdd, found.multipliers[:rows], -found.multipliers[rows:], True)


def _pushes_from_afar(system, compulsion):
    forces = np.full(4, 5.0)
    pushed = replace(compulsion, impressed=compulsion.impressed - compulsion.G[:, : compulsion.Phi.size].T @ forces)
    found = gauss.solve(pushed)
    return Answer(found.a, found.qdd, found.multipliers, found.inequality_multipliers + forces, True)


@pytest.mark.parametrize("wrong", [_falls_through, _glued, _pushes_from_afar])
def test_answers_that_enter_pull_or_push_from_afar_are_not_certified(wrong):
    """Forces and accelerations that satisfy the equations of motion, but not the conditions of a contact."""
    system = gauss.compile_scene(gauss.load("box_on_plane_4"))
    compulsion = gauss.assemble(system, system.initial_state())

    def backend(compulsion):
        return wrong(system, compulsion)

    backend.name = "wrong"
    solution = gauss.solve(compulsion, backend)
    assert str(solution.status).startswith("not solved")
    assert solution.certificate.complementarity > 1e-3


@pytest.mark.slow
def test_a_box_pulled_harder_and_harder_tips_at_its_weight_on_four_and_on_eight_corners():
    ends = []
    for corners in (4, 8):
        scene = gauss.load(f"box_on_plane_{corners}")
        del scene.loads["pull"]
        scene.force("pull", "box", force=lambda t: (20.0 * t, 0.0, 0.0), at=(0, 0, 0.2))
        trajectory = gauss.simulate(scene, 1.1, **TIGHT)
        opens = next(event for event in trajectory.events if event.kind == "opens")
        assert opens.t == pytest.approx(2.0 * g / 20.0, abs=RELEASE)
        assert len(opens.gaps) == 2
        before = trajectory.t < opens.t
        assert trajectory.q[before, 0] == pytest.approx(20.0 * trajectory.t[before] ** 3 / 12.0, abs=EXACT)
        assert gauss.compile_scene(scene).scene.contacts and np.abs(gauss.energy(trajectory).balance).max() < EXACT
        with pytest.warns(NonUniqueReactionWarning, match="'stand' are not unique"):
            force = gauss.contact_forces(trajectory, "stand")
        assert force[before].sum(axis=1) == pytest.approx(2.0 * g, rel=1e-7)
        ends.append(trajectory.q[-1])
    assert ends[0] == pytest.approx(ends[1], abs=EXACT)


@pytest.mark.slow
def test_four_corners_land_at_once():
    scene = gauss.load("box_on_plane_4")
    scene.loads.clear()
    scene.start("box moves", position=(0, 0, 0.5, 1, 0, 0, 0))
    trajectory = gauss.simulate(scene, 0.6, **TIGHT)
    impact, closes = trajectory.events
    assert impact.t == pytest.approx(np.sqrt(1.0 / g), abs=EXACT)
    assert len(closes.gaps) == 4
    assert impact.loss == pytest.approx(2.0 * g * 0.5, rel=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize(("pull", "rear", "front"), [(0.0, 4.905, 4.905), (10.0, 2.405, 7.405)])
@pytest.mark.parametrize("corners", [4, 8])
def test_forces_under_a_box_are_those_of_least_norm_and_said_to_be_open(corners, pull, rear, front):
    """Of 19.62 N, and the moment 0.2 m · pull about the centre, by two pairs of feet 0.4 m apart."""
    scene = gauss.load(f"box_on_plane_{corners}")
    scene.loads.clear()
    scene.force("pull", "box", force=(pull, 0, 0), at=(0, 0, 0.2))
    trajectory = gauss.simulate(scene, 0.1, times=[0.1])
    with pytest.warns(NonUniqueReactionWarning, match="least norm"):
        forces = gauss.contact_forces(trajectory, "stand")[0]
    feet = forces if corners == 4 else forces[::2]
    assert feet == pytest.approx([rear, rear, front, front], abs=1e-8)
    assert forces.sum() == pytest.approx(19.62, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
def test_a_coarse_tolerance_makes_a_coarse_motion_and_no_error(rtol):
    motion = gauss.simulate(gauss.load("box_on_plane_8"), 1.0, rtol=rtol, atol=rtol, progress=False)
    assert any(event.kind == "opens" for event in motion.events)
    assert min(gaps(shown).width.min() for shown in motion.motions) > -rtol
