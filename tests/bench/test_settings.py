"""The policy of the comparison: qpbenchmark's tolerances, common limits, everything else as the solver has it."""

import casadi
import clarabel
import numpy as np
import osqp
import piqp
import proxsuite
import pytest
import qpsolvers
from qpbenchmark.solver_settings import SolverSettings
from qpbenchmark.test_set import TestSet

import gauss
from gauss.backends import make
from gauss.backends.accuracy import KEPT, OWN, own_settings
from gauss.bench import casadi_
from gauss.bench.contestants import contestants, everyone
from gauss.bench.instances import of_problem
from gauss.bench.levels import LEVELS, LOOSEST, POLICIES, WALL_LIMIT, as_qpbenchmark_sets, promise, settings
from gauss.bench.measure import measure
from gauss.bench.problems import make_problem
from gauss.bench.settings_report import settings_lines
from gauss.bench.summary import is_right

NAMES = {"low": "low_accuracy", "mid": "mid_accuracy", "high": "high_accuracy"}  # of qpbenchmark


class Ours(TestSet):
    """A test set of qpbenchmark with our time limit."""

    title = description = ""
    sparse_only = False

    def __iter__(self):
        return iter(())

    def define_tolerances(self, runtime: float = WALL_LIMIT):
        super().define_tolerances(runtime)


THEIRS = Ours().solver_settings


@pytest.mark.parametrize("level", NAMES)
@pytest.mark.parametrize("solver", [name for name in contestants() if name not in casadi_.SOLVERS])
def test_tolerances_are_those_of_qpbenchmark(solver, level):
    """What qpbenchmark sets, we set to the same; what else we set is listed, or a limit that all get."""
    if not SolverSettings.is_implemented(solver):
        pytest.skip("qpbenchmark does not set it")
    ours, theirs = settings(solver, level), THEIRS[NAMES[level]][solver]
    if solver == "highs":
        theirs = {name: max(value, 1e-10) for name, value in theirs.items()}  # it refuses less
    if solver == "gurobi":
        theirs = {name: max(value, 1e-9) for name, value in theirs.items()}
    assert theirs.items() <= ours.items()
    policy = POLICIES[solver]
    assert set(ours) - set(theirs) == set(policy.beyond) | {name for name in policy.limits if name not in theirs}
    assert as_qpbenchmark_sets(solver, level).items() == {k: v for k, v in ours.items() if k not in policy.beyond}.items()


def defaults(solver) -> dict:
    """Settings of a solver as its library has them."""
    if solver == "osqp":
        made = osqp.OSQP()
        made.setup(*(np_csc(np.eye(1)), np.ones(1), np_csc(np.eye(1)), np.ones(1), np.ones(1)), verbose=False)
        found = made.settings
    else:
        found = {
            "clarabel": clarabel.DefaultSettings,
            "piqp": lambda: piqp.SparseSolver().settings,
            "proxqp": lambda: proxsuite.proxqp.sparse.QP(1, 0, 0).settings,
        }[solver]()
    return {name: getattr(found, name) for name in dir(found) if not name.startswith("_")}


def np_csc(matrix):
    from scipy import sparse

    return sparse.csc_matrix(matrix)


@pytest.mark.parametrize("solver", ("clarabel", "osqp", "piqp", "proxqp"))
def test_settings_exist_and_iterations_are_not_cut(solver):
    """Names are those of the library, and no limit of iterations is below its default."""
    its = defaults(solver)
    assert set(settings(solver, "high")) <= set(its)
    assert all(count >= its[name] for name, count in POLICIES[solver].limits.items() if isinstance(count, int))


@pytest.mark.parametrize("solver", ("clarabel", "osqp", "piqp"))
def test_what_gauss_tunes_is_no_part_of_the_comparison(solver):
    tuned = set(OWN.get(solver, {})) | set(KEPT[solver])
    tuned -= set(POLICIES[solver].limits)  # which the comparison has, too
    assert tuned and not tuned & set(settings(solver, "tightest"))


def test_the_report_lists_every_setting():
    known = contestants()
    text = "\n".join(settings_lines(known, "high"))
    comparison, own = text.split("## Settings with which gauss")
    for solver in known:
        line = next(line for line in comparison.splitlines() if line.startswith(f"| {solver} |"))
        assert all(f"{name} {value}" in line for name, value in settings(solver, "high").items())
        if solver not in casadi_.SOLVERS:
            line = next(line for line in own.splitlines() if line.startswith(f"| {solver} |"))
            given = own_settings(solver) | KEPT.get(solver, {})
            assert all(f"{name} {value}" in line for name, value in given.items())


@pytest.mark.parametrize("solver", ("piqp", "proxqp"))
def test_the_gap_is_asked_for_wherever_it_is_checked(solver):
    """A check whose tolerance is left at its default ends at that, whatever else is asked for."""
    for level, tolerance in LEVELS.items():
        given = settings(solver, level)
        assert given["check_duality_gap"] and given["eps_duality_gap_abs"] == tolerance
    assert own_settings(solver)["eps_duality_gap_abs"] == own_settings(solver)["eps_abs"]


def test_every_contestant_has_a_policy():
    assert set(everyone()) <= set(POLICIES)


@pytest.mark.parametrize("solver", POLICIES)
@pytest.mark.parametrize("level", LEVELS)
def test_no_more_is_promised_than_what_is_asked_for(solver, level):
    """Of those that take tolerances; a gap is promised where a setting, or the solver's default, has it looked at."""
    found = promise(solver, level)
    if not POLICIES[solver].has_tolerance:
        assert found == (LOOSEST, LOOSEST, np.inf, False)
        return
    asked = [value for name, value in settings(solver, level).items() if name not in POLICIES[solver].limits]
    assert found.primal == found.dual and found.primal in asked or solver == "gurobi"
    assert found.gap in (found.primal, np.inf)
    gaps = [name for name in settings(solver, level) if "gap" in name or name in ("abstol", "check_duality_gap")]
    assert bool(gaps) <= np.isfinite(found.gap)


@pytest.mark.peer
def test_casadi_knows_the_options_that_are_set():
    for solver in casadi_.SOLVERS:
        words = casadi.doc_conic(solver)
        assert all(f"| {name} " in words for name in settings(solver, "high"))


@pytest.mark.peer
def test_jaxopts_osqp_is_called_as_it_is_meant_to_be():
    """Compiled once for a problem, in double precision; with the multipliers of both kinds of rows."""
    pytest.importorskip("jaxopt")
    row = measure(of_problem(make_problem("three stops")), "jaxopt_osqp", "F2s", "high") | {"level": "high"}
    assert row["claimed"] and is_right(row) and row["iterations"] > 0


@pytest.mark.peer
def test_jax_computes_in_double_precision_for_us_alone():
    """Errors of rounding in doubles; what the user set for JAX is as before."""
    jax = pytest.importorskip("jax")
    pytest.importorskip("qpax")
    assert "qpax" in qpsolvers.available_solvers
    before = jax.config.jax_enable_x64
    compulsion = make_problem("ur5").compulsion
    expected, found = gauss.solve(compulsion), gauss.solve(compulsion, make("qpax"))
    assert np.abs(found.qdd - expected.qdd).max() <= 1e-10 * np.abs(expected.qdd).max()
    assert jax.config.jax_enable_x64 == before
    assert jax.numpy.ones(1).dtype == (jax.numpy.float64 if before else jax.numpy.float32)
