"""Quick and optimised machine code: the same digits, one tier for each run, a clean end of the process at any time."""

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss.codegen import machine, object_cache, object_code, one_tier, optimiser, processor, terminal_line, tiers, write
from gauss.codegen.emit import Writer
from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.object_code import FUNCTION, ModuleUnits
from gauss.codegen.optimiser import OPTIMISER
from gauss.codegen.process_end import can_skip_destructors
from gauss.errors import ArgumentError
from gauss.io.catalog import shipped

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # limit of waiting [s], against a test that hangs


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """Empty cache; modules of any length are compiled quickly first, in units of one function."""
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(tiers.VARIABLE, raising=False)
    monkeypatch.setattr(machine, "SHORTEST_WHOLE", 0)
    monkeypatch.setattr(object_code, "UNIT_LENGTH", 1)
    monkeypatch.setattr(optimiser, "REST", 0.0)
    yield tmp_path / "cache"
    assert OPTIMISER.wait(PATIENCE)


def text(number: float) -> str:
    """Module of two functions, one of which calls the other, with branches and elementary functions."""
    inner = write(lambda x: [np.sin(x[0]) * x[1] + number, np.exp(-(x[0] ** 2)) / (1.0 + x[1] ** 2)], 2, name="inner")
    outer = write(lambda x: [inner(x[:2])[0] * inner(x[1:])[1] + np.sqrt(x[2] ** 2 + 1.0), *inner(x[:2])], 3, name="outer")
    writer = Writer()
    writer.over_states(outer, (processor.width(),))
    return str(writer.module)


class Caller:
    """Machine code of the module, called with a few states."""

    def __init__(self, code: machine.MachineCode):
        self.code, self.entry = code, code.entry("run", SIGNATURE)

    def __call__(self) -> np.ndarray:
        given, found = np.random.default_rng(0).standard_normal((3, 11)), np.empty((3, 11))
        self.entry.call(11, given.ctypes.data, 11, found.ctypes.data, 11)
        return found


def test_units_are_the_module():
    """Each function is in one unit, and nothing else is."""
    whole = ModuleUnits(text(1.0))
    functions = [function for unit in whole.short(1) for function in FUNCTION.findall(unit)]
    assert len(functions) > 2 and functions == whole.functions
    without, having = whole.apart(lambda function: "inner" in function)
    assert sorted(FUNCTION.findall(without) + FUNCTION.findall(having)) == sorted(functions)
    assert all(("inner" in function) == (function in having) for function in functions)


def test_packed_objects_are_unpacked():
    parts = [b"", b"a" * 1000, bytes(range(256))]
    assert object_cache.unpacked(object_cache.packed(parts)) == parts
    assert object_cache.unpacked(object_cache.packed([])) == []


def test_optimised_code_takes_over_with_the_same_digits():
    found = Caller(machine.load(text(2.0)))
    assert found.code.tier == tiers.QUICK or found.code.offer
    first = found()
    assert OPTIMISER.wait(PATIENCE)
    assert found.code.tier == tiers.OPTIMISED and (found() == first).all()
    assert "call" in vars(found.entry)  # nothing is chosen any more


def test_a_run_keeps_its_tier_and_the_next_one_takes_the_better():
    found = Caller(machine.load(text(3.0)))
    OPTIMISER.stop()
    with one_tier() as run:
        OPTIMISER.go_on()
        found()
        assert OPTIMISER.wait(PATIENCE) and found.code.offer
        found()
        assert run.ran == tiers.QUICK and "call" not in vars(found.entry)
        with one_tier() as inner:
            assert inner is run
    with one_tier() as run:
        found()
    assert run.ran == tiers.OPTIMISED


def test_runs_that_overlap_choose_each_for_itself():
    """The later of two runs takes an offer that the earlier one does not take."""
    from contextvars import copy_context

    OPTIMISER.stop()
    found, early = Caller(machine.load(text(4.0))), copy_context()
    first = early.run(tiers.Run().__enter__)
    OPTIMISER.go_on()
    assert OPTIMISER.wait(PATIENCE)
    with one_tier() as later:
        found()
    early.run(found)
    assert (first.ran, later.ran) == (tiers.QUICK, tiers.OPTIMISED)
    assert "call" not in vars(found.entry)
    early.run(first.__exit__)
    assert "call" in vars(found.entry)


@pytest.mark.parametrize("tier", [tiers.QUICK, tiers.OPTIMISED])
def test_the_environment_chooses_a_tier(tier, monkeypatch):
    monkeypatch.setenv(tiers.VARIABLE, tier)
    code = machine.load(text(5.0))
    assert OPTIMISER.wait(PATIENCE) and code.tier == tier
    assert machine.load_cached(code.key).tier == tier


def test_an_unknown_tier_is_refused(monkeypatch):
    monkeypatch.setenv(tiers.VARIABLE, "quik")
    with pytest.raises(ArgumentError, match="quick"):
        machine.load(text(6.0))


@pytest.mark.slow
def test_the_cache_goes_from_quick_to_optimised_code(place):
    """A process that ended early leaves quick code with its module, from which the next one goes on."""
    OPTIMISER.stop()
    quick = Caller(machine.load(text(7.0)))
    key, expected = quick.code.key, quick()
    assert not (place / key).exists() and (place / (key + object_cache.QUICK_SUFFIX)).exists()
    del quick
    again = Caller(machine.load_cached(key))
    OPTIMISER.go_on()
    assert again.code.tier == tiers.QUICK and (again() == expected).all()
    assert OPTIMISER.wait(PATIENCE) and again.code.tier == tiers.OPTIMISED and (again() == expected).all()
    assert machine.load_cached(key).tier == tiers.OPTIMISED
    assert not (place / (key + object_cache.QUICK_SUFFIX)).exists()
    assert machine.load_cached(object_cache.key("nothing")) is None


def test_quick_code_in_the_cache_is_optimised_where_only_that_is_wanted():
    OPTIMISER.stop()
    key = machine.load(text(8.0)).key
    OPTIMISER.go_on()
    with one_tier(tiers.OPTIMISED):
        assert machine.load_cached(key).tier == tiers.OPTIMISED


def test_code_that_is_gone_is_not_optimised(place):
    OPTIMISER.stop()
    key = machine.load(text(9.0)).key
    assert OPTIMISER.left() == 0
    OPTIMISER.go_on()
    assert OPTIMISER.wait(PATIENCE) and not (place / key).exists()


def test_a_failure_in_the_background_leaves_the_quick_code(monkeypatch):
    def broken(*_):
        raise MemoryError("no room")

    monkeypatch.setattr(optimiser, "optimised_objects", broken)
    monkeypatch.setattr(OPTIMISER, "failures", [])
    found = Caller(machine.load(text(10.0)))
    first = found()
    assert OPTIMISER.wait(PATIENCE)
    assert found.code.tier == tiers.QUICK and (found() == first).all()
    assert OPTIMISER.failures == ["MemoryError: no room"] and "no room" in OPTIMISER.status()


SCRIPT = """
import os, sys, time
import gauss
from gauss.codegen import optimiser
from gauss.codegen.object_code import FUNCTION, ModuleUnits
from gauss.codegen.optimiser import OPTIMISER
optimiser.REST = 0.0
system = gauss.compile_scene(gauss.load("n_four_bar", n=3))
move = lambda: gauss.simulate(system, 0.01, rtol=1e-6, progress=False)
first = move()
time.sleep(float(sys.argv[1]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2])
def test_a_process_may_end_while_its_code_is_optimised(delay):
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(delay)], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE
    )
    assert ran.returncode == 0 and not ran.stderr


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_process_may_be_forked_while_its_code_is_optimised():
    """The child goes on with the quick code, and optimises it, too."""
    child = """
assert OPTIMISER.left() and first.stats.plan.tier == "quick"
child = os.fork()
if not child:
    same = (move().q == first.q).all() and OPTIMISER.wait(60) and move().stats.plan.tier == "optimised"
    os._exit(0 if same and (move().q == first.q).all() else 1)
status = os.waitpid(child, 0)[1]
assert OPTIMISER.wait(60) and move().stats.plan.tier == "optimised"
sys.exit(status)
"""
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", SCRIPT + child, "0"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert ran.returncode == 0, ran.stderr


LONG_UNIT = """
import atexit, sys, time
atexit.register(lambda: print("last words"))  # those of Python are called
from gauss.codegen import optimiser
optimiser.REST, optimiser.LONGEST_END, optimiser.Job.advance = 0.0, 0.1, lambda job: time.sleep(1e3)
import gauss
gauss.simulate(gauss.load("pendulum"), 0.01, progress=False)
assert optimiser.OPTIMISER.left()
"""


@pytest.mark.slow
@pytest.mark.skipif(not can_skip_destructors(), reason="the library of C has no on_exit here")
@pytest.mark.parametrize(("end", "code"), [("", 0), ("sys.exit(7)", 7), ("raise ValueError", 1)])
def test_the_end_of_a_process_does_not_wait_for_a_long_unit(end, code):
    """Its exit code, and what is written in its last functions, are kept."""
    command = [sys.executable, "-c", LONG_UNIT + end]
    quick = os.environ | {"GAUSS_TIER": "auto", "GAUSS_CACHE": ""}
    ran = subprocess.run(command, cwd=ROOT, env=quick, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == code and ran.stdout == "last words\n" and "thread" not in ran.stderr


def test_waiting_ends_at_its_limit():
    OPTIMISER.stop()
    code = machine.load(text(11.0))
    began = time.perf_counter()
    assert not OPTIMISER.wait(0.01) and time.perf_counter() - began < PATIENCE
    OPTIMISER.go_on()
    assert OPTIMISER.wait(PATIENCE) and code.tier == tiers.OPTIMISED


@pytest.mark.parametrize("is_terminal, shown, lines", [(True, True, 1), (True, False, 0), (False, True, 0)])
def test_a_line_appears_on_a_terminal_while_code_is_made_for_long(is_terminal, shown, lines, monkeypatch):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(object_code, "UNIT_LENGTH", 1)  # a unit for each function
    notices = terminal_line
    monkeypatch.setattr(notices, "LINE_DELAY", 0.0)
    inner = write(lambda x: x * x, 1, name="inner")
    outer = write(lambda x: inner(x) + 3.0, 1, name="outer")
    with one_tier(shown=shown), notices.compile_notice(), notices.compile_notice():
        limit = time.monotonic() + (PATIENCE if lines else 0.05)
        while time.monotonic() < limit and notices.TEXT not in stream.getvalue():
            time.sleep(0.01)
        writer = Writer()
        writer.export(outer, "run")
        objects = list(object_code.optimised_objects(str(writer.module), 1))
    functions = str(writer.module).count("define ")
    assert len(objects) == functions == 3  # the entry, beside the two
    said = [notices.TEXT, notices.WRITTEN.format(1), notices.WRITTEN.format(2), notices.COMPILING.format(functions)]
    said += [notices.PARTLY_COMPILED.format(done, functions) for done in (1, 2)]
    assert stream.getvalue() == (notices.CLEARED.join([*said, ""])) * lines
    monkeypatch.setattr(notices, "LINE_DELAY", PATIENCE)
    with notices.compile_notice():
        object_code.quick_objects(str(writer.module))
    assert stream.getvalue().count(notices.TEXT) == 3 * lines  # those above: nothing is written before its time


SETTINGS = {"dop853": {"rtol": 1e-8}, "taylor": {"rtol": 1e-8}, "time_stepping": {"step": 1e-3}}
STEPPED = {
    "block_on_incline",
    "box_on_plane_4",
    "painleve_rod",
    "rolling_ball",
    "slack_rope",
}  # scenes with friction of contacts, and one rope
MOTIONS = [(name, "time_stepping" if name in STEPPED else "dop853") for name in shipped()] + [("cardan", "taylor")]


@pytest.mark.slow
@pytest.mark.parametrize("name, integrator", MOTIONS)
def test_both_tiers_give_the_same_digits(name, integrator, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", "")
    found = []
    for tier in (tiers.QUICK, tiers.OPTIMISED):
        monkeypatch.setenv(tiers.VARIABLE, tier)
        motion = gauss.simulate(gauss.load(name), 0.01, integrator=integrator, progress=False, **SETTINGS[integrator])
        found.append((motion.t.tobytes(), motion.q.tobytes(), motion.v.tobytes()))
    assert found[0] == found[1]


@pytest.mark.slow
@pytest.mark.parametrize("run", [{"step": 1e-3, "steps": 20}, {"times": [0.0, 0.01, 0.02], "integrator": "dop853"}])
def test_both_tiers_of_a_batch_give_the_same_digits(run, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", "")
    scene, found = gauss.load("double_pendulum"), []
    for tier in (tiers.QUICK, tiers.OPTIMISED):
        monkeypatch.setenv(tiers.VARIABLE, tier)
        system = gauss.compile_scene(scene)
        q = np.linspace(-1.0, 1.0, 2 * 13).reshape(13, 2)
        motions = gauss.rollout(system, q, 0.5 * q, threads=2, **run)
        found.append((motions.q.tobytes(), motions.v.tobytes()))
    assert found[0] == found[1]


def test_built_in_functions_take_optimised_code(monkeypatch):
    """Accelerations, called by Python directly: the same function object, first quick, then optimised."""
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    function, state = system.forward_dynamics, system.initial_state()
    first = function(state.q, state.v, np.zeros(2))
    assert OPTIMISER.wait(PATIENCE)
    assert (function(state.q, state.v, np.zeros(2)) == first).all()


def test_a_plan_chooses_the_tier():
    system = gauss.compile_scene(gauss.load("pendulum"))
    move = lambda tier: gauss.simulate(  # noqa: E731
        system, 0.01, plan=gauss.Plan("compiled loop", "compiled", tier=tier), progress=False
    )
    OPTIMISER.stop()
    quick = move(tiers.QUICK)
    OPTIMISER.go_on()
    optimised = move(tiers.OPTIMISED)
    assert (quick.stats.plan.tier, optimised.stats.plan.tier) == (tiers.QUICK, tiers.OPTIMISED)
    assert (quick.q == optimised.q).all() and quick.stats.plan == optimised.stats.plan
    assert gauss.Plan.from_json(quick.stats.plan.to_json()).tier == tiers.QUICK
    with pytest.raises(ArgumentError, match="quick"):
        gauss.Plan("compiled loop", "compiled", tier="quik")
