"""Random scenes are moved alike by independent routes; what is wrong with a route, the examination says."""

import signal
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.bench.fuzz import routes
from gauss.bench.fuzz.motions import fuzz_motions, markdown
from gauss.bench.fuzz.routes import BAD, Route, examine_motion
from gauss.bench.fuzz.scenes import moved_scene
from gauss.bench.table import header_of, read_table
from gauss.errors import BalanceWarning

NUMBERS = sorted(set(range(30)) - {5, 8, 13, 14, 26, 27})  # of `gauss bench fuzz-motions`, without those that take long
QUICK = 0  # one of them that takes no time

needs_clock = pytest.mark.skipif(not hasattr(signal, "SIGPROF"), reason="no clock of processor time that interrupts")


@pytest.mark.slow
@needs_clock
@pytest.mark.parametrize("number", NUMBERS)
def test_random_motions_agree_or_differ_aloud(number):
    row = examine_motion(0, number)
    assert row["verdict"] not in BAD, row


MENDED = {
    7: "a law whose terms cancel at rest was taken for one that cannot be traced",
    350: "a law that asks for the sign of rates that are rounding alone cut steps without end",
    888: "a body without mass had no radius of gyration, at rest",
    988: "a constraint of a fixed body, beside islands, had no place",
    385: "impacts and contacts did not end where rounding turned a rate that slides",
    428: "a limited drive could not hold against a prescribed motion",
    601: "impacts and contacts did not end where loops lock a joint with friction",
    7626: "bounds of a law of time overflowed",
}
REFUSED = {3291: "neither the motion nor its continuation had a sample"}


@pytest.mark.slow
@needs_clock
@pytest.mark.parametrize("number", MENDED)
def test_scenes_that_once_failed_move(number):
    row = examine_motion(0, number)
    assert row["verdict"] == "agree", row


@pytest.mark.slow
@needs_clock
@pytest.mark.parametrize("number", REFUSED)
def test_scenes_that_cannot_move_are_refused(number):
    row = examine_motion(0, number)
    assert row["verdict"] == "refused", row


@pytest.mark.slow
def test_random_scenes_have_elements_of_many_kinds():
    scenes = [moved_scene(0, number) for number in range(200)]
    assert len({element for given in scenes for element in given.elements}) > 25
    assert {given.integrator for given in scenes} >= {"dop853", "dopri5", "radau5", "taylor", "time_stepping"}


def test_a_scene_is_made_again_and_without_some_elements():
    one, again = moved_scene(0, QUICK), moved_scene(0, QUICK)
    assert (
        one.scene.bodies == again.scene.bodies
        and one.scene.starts == again.scene.starts
        and (one.times == again.times).all()
    )
    gone = [*one.scene.loads][0]
    less = moved_scene(0, QUICK, (gone,))
    assert [*less.scene.loads] == [name for name in one.scene.loads if name != gone]
    assert less.scene.bodies == one.scene.bodies


def _shifted(found):
    return replace(found, v=found.v * 1.01 + 0.01)


def _warned(found):
    warnings.warn("off", BalanceWarning, stacklevel=1)
    return _shifted(found)


def _stray(found):
    warnings.warn("odd", RuntimeWarning, stacklevel=1)
    return found


def _raised(found):
    return 1 // 0


def _late(found):
    begin = time.process_time()
    while time.process_time() < begin + 4.0:
        pass
    return found


WRONG = {_shifted: "silent", _warned: "told", _stray: "stray", _raised: "raised", _late: "timed out"}


@pytest.mark.slow
@needs_clock
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_route_is_found(wrong, monkeypatch):
    simulate = gauss.simulate
    monkeypatch.setattr(
        gauss, "simulate", lambda *a, **k: simulate(*a, **k) if k["verify"] is False else wrong(simulate(*a, **k))
    )
    monkeypatch.setattr(routes, "ROUTE_TIME", 3.0)
    assert examine_motion(0, QUICK)["verdict"] == WRONG[wrong]


def test_routes_that_all_differ_are_sensitive(monkeypatch):
    given = moved_scene(0, QUICK)
    numbers = iter([1.0, 2.0, 2.0, 4.0])  # the second route is repeated by a tighter tolerance

    def route(*_, **__):
        x = np.full((len(given.times), gauss.compile_scene(given.scene).n_v), next(numbers))
        return Route("moved", q=x, v=x)

    monkeypatch.setattr(routes, "_route", route)
    assert examine_motion(0, QUICK)["verdict"] == "sensitive"


@pytest.mark.slow
@needs_clock
def test_a_long_second_route_is_compared_as_far_as_it_came(monkeypatch):
    simulate = gauss.simulate

    def late(*given, **options):
        found = simulate(*given, **options)
        if options["verify"] is False:
            try:
                _late(found)
            except KeyboardInterrupt as error:
                error.trajectory = replace(found, q=found.q[:2], v=found.v[:2], t=found.t[:2])
                raise
        return found

    monkeypatch.setattr(gauss, "simulate", late)
    monkeypatch.setattr(routes, "CUT_TIME", 1.0)
    row, given = examine_motion(0, QUICK), moved_scene(0, QUICK)
    assert (row["verdict"], row["compared"]) == ("agree", given.times[1] / given.duration)


@pytest.mark.slow
@needs_clock
def test_the_table_is_taken_up_where_it_was(tmp_path):
    first = fuzz_motions(tmp_path, count=1, first=QUICK, progress=False)
    before = first.path.read_text()
    second = fuzz_motions(tmp_path, count=1, first=QUICK, progress=False)
    assert second.path.read_text() == before
    report = markdown(read_table(second.path), header_of(second.path))
    assert "1 scenes" in report and "| silent | 0 |" in report
