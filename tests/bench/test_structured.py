"""Programmes with cones, with Coulomb's law and with stages: how they are judged, and who solves them."""

import numpy as np
import pytest

from gauss.backends.programme import Outcome
from gauss.bench import casadi_, mujoco_
from gauss.bench.classes import compare_class
from gauss.bench.clocks import COMPILING
from gauss.bench.contestants import contestants, everyone, ready, suits
from gauss.bench.coulomb import projected
from gauss.bench.folders import of_folder
from gauss.bench.instances import FILE, of_selection
from gauss.bench.measure import NOT_ASKED, TINY_PROGRAMMES, measure
from gauss.bench.structured import CONES, COULOMB, ROWS, STAGES
from gauss.bench.suite import export_suite, instances
from gauss.bench.suite_instances import of_suite
from gauss.bench.summary import is_broken, is_kept, is_right

ROUNDED = 1e-13  # residuals of references that were rounded to doubles, of programmes with numbers near one
SMALL = {
    CONES: ("cones velocities block tilt 1 friction 0.25", "cones grasp 5", "cones whole body hyq_no_sensors"),
    COULOMB: ("coulomb balls 1", "coulomb table 3"),
}
MUJOCO_ERROR = 1e-6  # relative: softness of contacts as MuJoCo has it would leave more than 1e-4
STAGES_ERROR = 1e-6  # relative
FINE = 1e-5  # relative error of x where residuals of 1e-9 are kept: contact forces of soft stacks amplify them
FIRST = [(CONES, "cones balls 1"), (COULOMB, "coulomb balls 1")]
CASES = [
    (kind, name, solver)
    for kind, names in SMALL.items()
    for name in names
    for solver in contestants(kind)
    if solver not in mujoco_.SOLVERS
]


def judged(instance, solver: str, level: str = "high") -> dict:
    return measure(instance, solver, FILE, level) | {"level": level, "group": instance.group, "verdict": instance.verdict}


@pytest.fixture(scope="module")
def small() -> dict:
    return {instance.name: instance for kind, names in SMALL.items() for instance in of_suite(kind, [*names])}


@pytest.mark.parametrize("kind", TINY_PROGRAMMES)
def test_solvers_are_asked_what_they_take(kind):
    instance = TINY_PROGRAMMES[kind]
    asked = {solver for solver in everyone() if suits(solver, instance)}
    assert instance.structure.kind == kind and asked == set(contestants(kind)) and suits("mine:Solver", instance)
    assert ("daqp" in asked) == (kind in (ROWS, STAGES)) and ("newton" in asked) == (kind == COULOMB)


@pytest.mark.parametrize("name", [name for names in SMALL.values() for name in names])
def test_references_leave_no_residuals_and_shifted_ones_do(small, name):
    """Of the answer moved out of its cone, and of multipliers moved out of theirs, each in its own residual."""
    instance = small[name]
    programme = instance.programme(FILE)
    x, multipliers = instance.known.x, instance.known.multipliers
    y, z = programme.multipliers(x, multipliers[: programme.d.size], multipliers[programme.d.size :])
    size = max(np.abs(part).max(initial=1.0) for part in (x, y, z, programme.c))
    assert max(programme.residuals(x, y, z)) <= ROUNDED * size**2
    assert instance.error(None, x) == 0.0 and instance.known.dual_error(np.concatenate([y, z])) <= 1e-9
    less = z.copy()
    less[programme.orthant :: 3] -= 1.0 + np.abs(z).max()
    if not programme.structure.friction:
        assert programme.residuals(x, y, less)[1] >= 0.9
    else:
        assert programme.residuals(-x, *programme.multipliers(-x, y, z))[0] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name", "solver"), CASES)
def test_solvers_of_cones_and_of_coulombs_law(small, kind, name, solver):
    """Whoever claims to have kept 1e-9 is near the reference."""
    row = judged(small[name], solver)
    assert row["outcome"] == "answered" and row["claimed"]
    assert is_kept(row) != (solver == "ecos")  # it stops short: its tolerances are of its own epigraph
    assert row["error"] <= (1e-2 if solver == "ecos" else FINE) or name == "coulomb table 3"


class Liar:
    """Half of the right answer, called right."""

    right = np.zeros(0)

    def __call__(self, programme):
        return Outcome(0.5 * self.right, np.zeros(programme.d.size), np.zeros(programme.k.size), True, "solved")


@pytest.mark.parametrize("name", ["cones grasp 5", "coulomb table 3"])
def test_liars_are_caught(small, name, monkeypatch):
    monkeypatch.setattr(Liar, "right", small[name].known.x)
    row = judged(small[name], f"{__name__}:Liar")
    assert is_broken(row) and not is_right(row)


def test_forces_are_projected_on_the_nearest_of_their_cone():
    """p in K, p − r in the polar of K (r − p ⟂ p)."""
    rng = np.random.default_rng(0)
    r, friction = rng.standard_normal((200, 3)), rng.uniform(0.1, 2.0, 200)
    p = projected(r, friction)
    rest = r - p
    assert (np.hypot(p[:, 1], p[:, 2]) <= friction * p[:, 0] + 1e-15).all()
    assert np.abs((rest * p).sum(axis=1)).max() <= 1e-14
    assert (rest[:, 0] + friction * np.hypot(rest[:, 1], rest[:, 2]) <= 1e-14).all()


@pytest.mark.peer
def test_hpipm_takes_problems_with_stages():
    pytest.importorskip("casadi")
    (instance,) = of_suite("mpc", ["mpc crane 10"])
    row = judged(instance, "hpipm")
    assert row["claimed"] and row["error"] <= 1e-6 and row["dual_error"] <= 1e-5
    other = measure(next(of_selection(["three stops"])), "hpipm", "F2s", "high")
    assert other["outcome"] == NOT_ASKED and "stages only" in other["reason"]


@pytest.mark.parametrize(("form", "name"), [("npz", "cones grasp 5"), ("qps", "mpc crane 10"), ("fclib", "coulomb table 3")])
def test_files_of_the_suite_are_instances_again(tmp_path, form, name):
    """With their structure where the format holds it, and with references from those of our own."""
    export_suite(instances(None, [name]), tmp_path, form)
    (instance,) = of_folder(tmp_path)
    (expected,) = of_suite(name.split()[0], [name])
    assert instance.structure.kind == (ROWS if form == "qps" else expected.structure.kind)
    assert (instance.known is not None) == (form == "npz")
    ours, theirs = instance.programme(FILE), expected.programme(FILE)
    for part in ("H", "C", "K"):
        assert (getattr(ours, part) != getattr(theirs, part)).nnz == 0 or form == "qps"
    assert np.array_equal(ours.c, theirs.c)


@pytest.mark.slow
def test_a_class_of_cones_has_a_table(tmp_path):
    names, asked = ["coulomb balls 1"], ["newton", "admm", "daqp", "recursion"]
    table = compare_class(tmp_path, COULOMB, problems=names, backends=asked, levels=["high"], progress=False)
    assert {row["backend"] for row in table.rows.values()} == {"newton", "admm"}


@pytest.mark.peer
@pytest.mark.parametrize("name", ["cones block tilt 1 friction 0.75", "cones stack 4 pushed", "cones balls 8"])
def test_mujoco_is_asked_the_very_problem(name):
    """Its Newton method finds the reference to rounding: nothing of the problem is regularised away."""
    pytest.importorskip("mujoco")
    (instance,) = of_suite(CONES, [name])
    row = judged(instance, "mujoco_newton")
    assert row["claimed"] and row["error"] <= MUJOCO_ERROR


def test_mujoco_is_not_asked_for_other_cones(small):
    for name in SMALL[CONES]:
        assert not any(suits(solver, small[name]) for solver in mujoco_.SOLVERS)
        row = measure(small[name], "mujoco_newton", FILE, "high")
        assert row["outcome"] == NOT_ASKED and "impulses of contacts" in row["reason"]


@pytest.mark.parametrize("solver", [name for name in casadi_.STAGEWISE if name in contestants(STAGES)])
def test_solvers_of_stages_find_the_reference(solver):
    """To what the tolerance leaves; Fatrop's bounds are loose by 1e-8."""
    (instance,) = of_suite("mpc", ["mpc cart and pole 10"])
    row = judged(instance, solver)
    assert row["claimed"] and row["error"] <= STAGES_ERROR and row["dual_error"] <= 10.0 * STAGES_ERROR


@pytest.mark.slow
@pytest.mark.parametrize("kind, name", [(ROWS, "contacts stops 4 F2"), (STAGES, "mpc cart and pole 10"), *FIRST])
def test_calls_repeat_themselves(kind, name):
    """What a call does to its problem, as to factorise a matrix in its place, the next one would answer for."""
    (instance,) = of_suite(name.split()[0], [name])
    for solver in set(contestants(kind)) - set(COMPILING):
        prepared = ready(solver, instance.programme(FILE), "high")
        with prepared.around:
            first, second = (prepared.read(prepared.call()).x for _ in range(2))
        assert first is None or np.array_equal(first, second), solver
