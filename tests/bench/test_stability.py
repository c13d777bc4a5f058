"""The stability atlas: its cases and verdicts, and that gauss's own choice passes all of them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.backends import make
from gauss.bench.atlas import CASES, METHODS
from gauss.bench.atlas.case import DEGRADED, HONEST, PASSED, SILENT, FailureCase, judged
from gauss.bench.atlas.methods import DEFAULT, Method
from gauss.bench.atlas.run import explore, markdown
from gauss.bench.problems import make_problem
from gauss.cli import app
from gauss.errors import BackendError, BalanceWarning, SimulationError

# What takes seconds is in the committed atlas only.
SLOW = ("chain of 1000 links", "ladder of 2 through flat", "ladder of 8 through flat", "slider-crank, equal links")
SLOW += ("grazing a stop", "Painlevé's rod", "servo losing its hold", "contact at 4 and 8 points")
QUICK = [name for name in CASES if name not in SLOW]
# Of one instant, and not slow: where methods differ most.
SHARP = ("mass ratio 1e+09", "near a singular point", "noise on redundant rows", "link without inertia")
SHARP += ("contradicting rows",)


def fails(method, data):
    raise SimulationError("no more")


def warns(method, data):
    warnings.warn("off", BalanceWarning, stacklevel=1)
    return 1.0


@pytest.mark.parametrize(
    "figure, solvable, verdict",
    [
        (lambda method, data: 1e-12, True, PASSED),
        (lambda method, data: 1e-6, True, DEGRADED),
        (lambda method, data: 1.0, True, SILENT),
        (lambda method, data: np.nan, True, SILENT),
        (fails, True, HONEST),
        (warns, True, HONEST),
        (fails, False, PASSED),
        (lambda method, data: 0.0, False, SILENT),
    ],
)
def test_verdicts(figure, solvable, verdict):
    found = judged(FailureCase("case", "figure", figure, solvable=solvable), DEFAULT, None)
    assert found["verdict"] == verdict


def test_the_atlas_is_large_enough():
    assert len(CASES) >= 18 and len(METHODS) >= 10
    assert METHODS[DEFAULT.name] == Method("auto", integrator="dop853", stabilisation="projection")


def test_every_backend_is_judged_by_the_same_two_rules():
    """Certified and believed, gauss's own methods like QP solvers."""
    kinds = {(method.backend, method.certified) for method in METHODS.values() if method.backend != "auto"}
    assert {backend for backend, certified in kinds if certified} == {
        backend for backend, certified in kinds if not certified
    }


def test_a_method_that_is_believed_takes_no_rows_that_it_does_not_know():
    compulsion = make_problem("box on 4 points").compulsion
    with pytest.raises(BackendError, match="takes no inequality rows"):
        Method("recursion", certified=False).instant(compulsion)


@pytest.mark.slow
@pytest.mark.parametrize("certified", (True, False))
def test_wrong_claims_are_believed_or_certified(monkeypatch, certified):
    """A backend that claims half of the acceleration: believed it is wrong in silence, certified it says so."""

    def half(*_, **__):
        right = make("recursion")

        class Half:
            name = "half"

            def __call__(self, compulsion):
                answer = right(compulsion)
                return replace(answer, qdd=answer.qdd / 2)

        return Half()

    monkeypatch.setattr("gauss.bench.atlas.methods.make", half)
    monkeypatch.setattr("gauss.bench.atlas.methods.solve", lambda compulsion, *_, **__: gauss.solve(compulsion, half()))
    case = CASES["mass ratio 1e+09"]
    found = judged(case, Method("daqp", certified=certified), case.prepare())
    assert found["verdict"] == (HONEST if certified else SILENT)


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_gauss_own_choice_passes_every_case(name):
    """What has a solution is solved, what has none is reported."""
    case = CASES[name]
    found = judged(case, DEFAULT, case.prepare())
    assert found["verdict"] == PASSED, found


@pytest.mark.slow
@pytest.mark.parametrize("name", SHARP)
def test_no_method_of_gauss_fails_silently(name):
    data = CASES[name].prepare()
    for method in METHODS.values():
        if method.certified and method.ours and method.integrator == "rk4" and method.stabilisation == "projection":
            assert judged(CASES[name], method, data)["verdict"] != SILENT, method.name


def test_a_method_of_low_order_says_that_its_energy_is_off():
    """The balance of the double pendulum is off by a percent, and that is said."""
    with pytest.warns(BalanceWarning, match="smaller step"):
        Method(integrator="semi_implicit_euler").motion(gauss.compile_scene(gauss.load("double_pendulum")), 1.0, 5e-3)


@pytest.mark.slow
def test_atlas_goes_on_and_is_drawn(tmp_path):
    cases, methods = ["stiff Baumgarte", "contradicting rows"], [DEFAULT.name, Method("kkt").name]
    first = explore(tmp_path, cases=cases[:1], methods=methods, progress=False)
    before = first.path.read_text()
    arguments = [f"--{key}={value}" for key, values in (("case", cases), ("method", methods)) for value in values]
    app(["bench", "stability", "--output", str(tmp_path), *arguments], standalone_mode=False)
    assert first.path.read_text().startswith(before)
    assert {p.name for p in tmp_path.iterdir()} == {"stability.csv", "stability.md", "stability.png"}
    rows = explore(tmp_path, cases=cases, methods=methods, progress=False).numbers()
    verdicts = {(row["case"], row["method"]): row["verdict"] for row in rows}
    assert len(rows) == 4 and verdicts[cases[0], methods[0]] == PASSED and verdicts[cases[0], methods[1]] == HONEST
    assert "redundant rows" in markdown(rows, ["date", "machine"])
    with pytest.raises(BackendError, match="no case 'ladder'"):
        explore(tmp_path, cases=["ladder"])
