"""Work against precision: what is measured, the Pareto front, and the chart of a scene."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from typer.testing import CliRunner

import gauss
from benchmarks import qp_numbers
from benchmarks.work_precision import beaten, report
from benchmarks.work_precision.scenes import CASES
from gauss.bench import precision
from gauss.bench.extrapolation import SPAN, extrapolated
from gauss.bench.precision import Attempt, attempts, centres, front, reference, settings
from gauss.cli import app
from gauss.errors import BackendError, SimulationError
from gauss.view.precision import ZERO, plot_precision, refusals
from tests.support import mechanisms

BENCHMARKS = Path(report.__file__).parents[1]
DURATION = 0.5  # s
DIGITS = 1e-11  # m: a tolerance of 1e-14 over half a second
SHORT = 0.1  # s
FEW = 512  # steps
DRAKES = 1e-10  # m: an accuracy of 1e-9 over a tenth of a second


def _pendulum():
    return gauss.compile_scene(gauss.load("pendulum"))


def test_reference_is_as_good_as_it_says():
    found = reference(system := _pendulum(), DURATION)
    exact = centres(gauss.simulate(system, DURATION, integrator="gauss6", step=1e-3, times=[DURATION]))
    assert found.uncertainty <= DIGITS
    assert np.abs(found.positions - exact).max() <= DIGITS


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_finer_settings_are_more_exact(method):
    found = list(attempts(_pendulum(), DURATION, methods=[method], time_limit=0.3))
    assert [one.setting for one in found] == sorted((one.setting for one in found), reverse=True)
    assert found[0].error > 1e3 * min(one.error for one in found)
    assert min(one.error for one in found) <= DIGITS
    assert all(one.engine == "gauss" and one.seconds > 0 and not one.failed for one in found)


def test_front_is_what_nothing_beats():
    rng = np.random.default_rng(0)
    found = [Attempt("gauss", "x", 1.0, *rng.uniform(size=2)) for _ in range(50)] + [
        Attempt("gauss", "y", 1.0, reason="failed")
    ]
    best = front(found)
    for one in found:
        beaten = any(b.seconds <= one.seconds and b.error <= one.error for b in best)
        assert beaten or one.failed
    assert all(a.error > b.error and a.seconds < b.seconds for a, b in zip(best, best[1:], strict=False))


@pytest.mark.slow
def test_what_cannot_be_computed_stays_with_its_reason():
    """A rolling disk binds velocities, which Störmer–Verlet does not know."""
    (found,) = {one.reason for one in attempts(gauss.load("rolling_disk"), 0.1, methods=["verlet"])}
    assert "velocities" in found


@pytest.mark.parametrize("scene", ["UR5 with PD drives", "spatial double pendulum", "flyball governor (A05)"])
def test_drake_moves_what_gauss_moves(scene):
    """Drives, balls in motion, springs: what is built in Drake is the same mechanism."""
    drake = pytest.importorskip("benchmarks.work_precision.drake_", reason="Drake is not installed", exc_type=ImportError)
    system = gauss.compile_scene(next(case for case in CASES if case.name == scene).make())
    ours = centres(gauss.simulate(system, SHORT, times=[SHORT]))
    assert np.abs(drake.DrakeModel(system).centres("runge_kutta3", 1e-9, SHORT) - ours).max() <= DRAKES


def test_unknown_integrators_are_named():
    with pytest.raises(SimulationError, match="dop853"):
        list(attempts(_pendulum(), DURATION, methods=["dop85"]))


def test_steps_divide_the_duration():
    assert settings("rk4", 2.0)[0] == 2.0 / 32
    assert settings("dop853", 2.0)[0] == 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "options", "said"),
    [
        ("pendulum", ["--integrator", "dop853"], ["reference: dopri5", "tolerance 0.001", "Pareto front"]),
        ("pendulum", ["--backend", "schur", "--backend", "recursion"], ["dop853 with schur", "dop853 with recursion"]),
        ("double_pendulum_stops", ["--integrator", "rk4", "--integrator", "gauss6"], ["rk4, gauss6: does not locate"]),
        ("rolling_ball", [], ["reference: time stepping", "time_stepping"]),
    ],
)
def test_chart_of_a_scene(tmp_path, monkeypatch, scene, options, said):
    """Integrators and backends are curves, contacts with friction have a reference, a refusal is reported once."""
    monkeypatch.setattr(precision, "STEPS", FEW)
    path = tmp_path / "chart.svg"
    run = ["--duration", "0.2", "--patience", "0.001", "--output", str(path)]
    done = CliRunner().invoke(app, ["chart", scene, *run, *options])
    assert done.exit_code == 0, done.output
    for words in said:
        assert words in done.output
    assert all(done.output.count(words) == 1 for words in said if "does not" in words)
    assert "wall time" in path.read_text()


def _rolled(t):
    """Where the ball of models/rolling_ball.toml is [m]: it slides by friction 0.2 until it rolls with 5/7 of 3 m/s."""
    rolls = 2 / 7 * 3 / (0.2 * 9.81)
    sliding = min(t, rolls)
    return 3 * sliding - 0.1 * 9.81 * sliding**2 + 15 / 7 * (t - sliding)


def _slid(t):
    """Where the block of models/block_on_incline.toml is [m]: it slides up, stops, and slides back."""
    up, down = (9.81 * (np.sin(0.6) + sign * 0.5 * np.cos(0.6)) for sign in (1, -1))
    rising = min(t, 3 / up)
    return -(3 * rising - up * rising**2 / 2) + down * (t - rising) ** 2 / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "exact", "duration"),
    [("rolling_ball", _rolled, 0.3), ("rolling_ball", _rolled, 0.8), ("block_on_incline", _slid, 0.7)],
)
def test_references_with_friction_are_as_good_as_they_say(scene, exact, duration):
    found = reference(gauss.compile_scene(gauss.load(scene)), duration, steps=FEW)
    off = abs(found.positions[0, 0] - exact(duration))
    assert off <= found.uncertainty <= 3.0 * duration / FEW  # a step with 3 m/s, the largest speed


@pytest.mark.parametrize(
    ("values", "share"),
    [
        (lambda h: np.array([1.0 + 2.0 * h + 3.0 * h**2, 1.0]), 1e-9),
        (lambda h: np.array([1.0 + h * np.modf(0.3123 / h)[0], 1.0]), SPAN),  # an event somewhere within a step
    ],
)
def test_extrapolation_knows_its_uncertainty(values, share):
    """It is of rounding where values are smooth in the step, and less than the longest step where they jump about."""
    found = extrapolated(values, 1.0, FEW)
    assert np.abs(found.values - 1.0).max() <= found.uncertainty + np.finfo(float).eps
    assert found.uncertainty <= share / FEW


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [(1.0, 1.5, 1.9), (1e-4, 3e-2, 8.0)])
@pytest.mark.parametrize("errors", [(2e-3, 5e-3, 9e-3), (0.3, 1e-15, 0.0), (0.0, 0.0, 0.0)])
def test_ticks_do_not_collide_and_errors_of_zero_are_marked(seconds, errors):
    found = [Attempt("gauss", "x", 0.1**k, *pair) for k, pair in enumerate(zip(errors, seconds, strict=True))]
    figure = plot_precision({"scene": found}, uncertainties={"scene": 1e-12})
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    for axis in (axes.xaxis, axes.yaxis):
        ticks = [*axis.get_ticklabels(), *axis.get_ticklabels(minor=True)]
        boxes = [tick.get_window_extent() for tick in ticks if tick.get_text() and tick.get_visible()]
        assert len(boxes) >= 2
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    stars = [line for line in axes.lines if line.get_marker() == ZERO["marker"] and len(line.get_xdata())]
    assert sum(len(star.get_xdata()) for star in stars) == sum(error == 0.0 for error in errors)
    assert all(star.get_ydata() == pytest.approx(axes.get_ylim()[0]) for star in stars)
    assert ("the reference, to the last bit" in axes.get_legend_handles_labels()[1]) == bool(stars)


def test_a_refusal_is_told_once_with_all_whom_it_stops():
    found = [Attempt("gauss", "a", s, reason="no") for s in (1.0, 0.1)]
    found += [
        Attempt("gauss", "b", 1.0, reason="no"),
        Attempt("gauss", "b", 0.1, 1.0, 1.0),
        Attempt("other", "", 1.0, reason="x"),
    ]
    assert refusals(found) == {"no": ["a", "b (1 of 2)"], "x": ["other"]}


@pytest.mark.parametrize(
    ("backends", "time_limit", "count"), [(["recursion"], 1.0, precision.FEWEST), (["recursion"], 0.1, 1), (None, 1.0, 1)]
)
def test_backends_have_curves(monkeypatch, backends, time_limit, count):
    """Three points though each takes longer than allowed, but for runs that take far too long."""
    monkeypatch.setattr(precision, "attempt", lambda *given: Attempt("gauss", given[2], given[3], 1.0, 2.0))
    system, against = _pendulum(), precision.ReferencePositions(np.zeros((1, 3)), 0.0, "none")
    assert len(list(attempts(system, DURATION, against, ["dop853"], time_limit, backends))) == count


def test_unknown_backends_are_named():
    with pytest.raises(BackendError, match="recursion"):
        list(attempts(_pendulum(), DURATION, backends=["recursio"]))


@pytest.mark.slow
def test_ladder_reference_data():
    """The error is that of centres of mass: those of the ladder's first crank, from its angle."""
    data = mechanisms.reference("n-four-bar")["table"]
    found = centres(gauss.simulate(gauss.load("n_four_bar", n=1), 0.1, times=[0.1]))
    theta = data["1"]["theta"][1]
    assert found[0] == pytest.approx([np.sin(theta) / 2, np.cos(theta) / 2, 0.0], abs=1e-10)


@pytest.mark.slow
def test_readme_has_the_numbers_of_the_tables_of_qp_solvers():
    """Written by ``python -m benchmarks.qp_numbers`` when tables have been measured."""
    assert qp_numbers.section() in (BENCHMARKS / "README.md").read_text(encoding="utf-8")


def test_readme_names_where_others_are_faster_as_the_table_has_it(tmp_path):
    table = report.AttemptTable(BENCHMARKS / "results" / "work_precision.csv", fresh=False)
    readme, copy = BENCHMARKS / "README.md", tmp_path / "README.md"
    text = readme.read_text(encoding="utf-8")
    assert beaten.section(table.found, report.conditions(table)) in text
    copy.write_text(text.replace("machine:", "another:"), encoding="utf-8")
    beaten.rewrite(copy, beaten.section(table.found, report.conditions(table)))
    assert copy.read_text(encoding="utf-8") == text


def test_links_of_the_readme_lead_somewhere():
    links = re.findall(r"\]\(([^)]+)\)", (BENCHMARKS / "README.md").read_text(encoding="utf-8"))
    assert links and all((BENCHMARKS / link).exists() for link in links)


def test_who_is_faster_at_which_error():
    """Coarser attempts do not count at a finer error, failed ones never; a tie is none; what gauss misses is said."""

    def scene(*found):
        return [Attempt(engine, "x", 1.0, error, seconds, reason=reason) for engine, error, seconds, reason in found]

    scenes = {
        "faster": scene(("gauss", 1e-12, 3.0, ""), ("other", 1e-5, 2.0, ""), ("other", 1e-12, 0.1, "lost")),
        "tie": scene(("gauss", 1e-12, 1.0, ""), ("other", 1e-12, 1.0, "")),
        "alone": scene(("gauss", 1e-10, 1.0, ""), ("other", 1e-12, 9.0, "")),
    }
    count, *_, faster, alone = beaten.beaten(scenes)
    assert count.startswith("4 of 27 cells")
    assert faster == "| faster | " + " | ".join(["other x, 1.5 ×"] * 3 + [""] * 6) + " |"
    assert alone == "| alone | " + " | ".join([""] * 8 + ["other x, gauss does not reach it"]) + " |"
    assert beaten.beaten({"tie": scenes["tie"]}) == ["Nowhere at these errors: 0 of 9 cells."]
