"""Sweeps: every member is the motion of its own scene, what fails says why, and nothing that was made is lost."""

import os
import signal
from functools import partial

import numpy as np
import pytest
import xarray
import zarr
from typer.testing import CliRunner

import gauss
from gauss import cli
from gauss.errors import ArgumentError, FileError, SceneError, SimulationError
from gauss.scene.named_numbers import changed
from gauss.simulation.sweeps import ranges
from gauss.simulation.sweeps import storage as store
from gauss.simulation.sweeps.parameters import Members
from tests.support import mechanisms

ROUNDING = 1e-11  # of some steps, of two pieces of machine code
FIXED = {"integrator": "rk4", "step": 1e-3, "samples": 3, "progress": False}
SCENES = {
    "masses and starts": ("double_pendulum", {"upper.mass": [0.5, 2.0], "A.position": [0.1, 2.0]}),
    "loops": ("four_bar", {"crank.mass": [1.0, 2.0], "A.rate": [-8.0, 3.0]}),
    "poses of loops": ("four_bar", {"A.position": [0.0, 0.6], "A.rate": [1.0]}),
    "lengths in loops": ("four_bar", {"D.at.x": [1.15, 1.25], "rocker.com[0]": [0.4]}),
    "gravity": ("heavy_top", {"gravity.z": [-9.81, -1.6]}),
}


ADAPTIVE = [("loops", "dop853"), ("gravity", "dopri5")]


@pytest.mark.slow
@pytest.mark.parametrize("name, integrator", [*((name, "rk4") for name in SCENES), *ADAPTIVE])
def test_every_member_is_the_motion_of_its_own_scene(name, integrator):
    scene, vary = gauss.load(SCENES[name][0]), SCENES[name][1]
    vary = {key.replace("upper", next(iter(scene.bodies))): values for key, values in vary.items()}
    run = {"integrator": integrator, "rtol": 1e-9, "atol": 1e-9, "step": FIXED["step"] if integrator == "rk4" else None}
    found = gauss.sweep(scene, vary, 0.05, **FIXED | run)
    assert found.q.dims == (*vary, "time", "coordinate") and (found.status == 1).all()
    for chosen in np.ndindex(*(len(values) for values in vary.values())):
        values = {key: vary[key][k] for key, k in zip(vary, chosen, strict=True)}
        own = scene
        for key, value in values.items():
            own = changed(own, key, value)
        alone = gauss.simulate(own, 0.05, times=found.time.values, **run)
        member = found.sel(values)
        assert np.abs(member.q.values - alone.q).max() <= ROUNDING
        assert np.abs(member.v.values - alone.v).max() <= ROUNDING * max(1.0, np.abs(alone.v).max())
        assert gauss.compile_scene(own).initial_state().q == pytest.approx(member.q.values[0], abs=0)


def two_links(length, mass=1.0):
    if length < 0:
        raise ValueError("a length below zero")
    return mechanisms.chain([mass, length])


@pytest.mark.slow
def test_a_function_makes_the_scene_and_numbers_are_measured():
    made = {"length": [0.5, -1.0, 2.0], "mass": [1.0, 2.0, 3.0]}
    measure = {"highest": lambda motion: np.abs(motion.q).max()}
    found = gauss.sweep(two_links, made, 0.05, together=True, measure=measure, **FIXED)
    assert found.q.dims == ("member", "time", "coordinate") and list(found.length.values) == made["length"]
    assert found.status.values.tolist() == [1, 2, 1]
    assert found.reason.values[1] == "ValueError: a length below zero" and np.isnan(found.q.values[1]).all()
    assert found.highest.values[[0, 2]] == pytest.approx(np.abs(found.q.values[[0, 2]]).max(axis=(1, 2)), abs=0)


@pytest.mark.slow
def test_what_fails_says_why_and_the_others_go_on():
    found = gauss.sweep(gauss.load("four_bar"), {"crank.mass": [-1.0, 1.0], "crank.inertia[2]": [0.016, 9.0]}, 0.05, **FIXED)
    assert found.status.values.tolist() == [[2, 2], [1, 2]]
    assert "mass" in str(found.reason.values[0, 0]) and "triangle inequality" in str(found.reason.values[1, 1])
    assert np.isnan(found.q.values[1, 1]).all() and np.isfinite(found.q.values[1, 0]).all()


def test_what_cannot_be_compiled_together_is_simulated_alone():
    scene = gauss.load("double_pendulum")
    scene.drive("A", torque=lambda t: 0.1 if float(t) < 0.02 else 0.0)
    body = next(iter(scene.bodies))
    found = gauss.sweep(scene, {f"{body}.mass": [1.0, 2.0]}, 0.05, **FIXED)
    alone = gauss.simulate(changed(scene, f"{body}.mass", 2.0), 0.05, integrator="rk4", step=1e-3, times=found.time.values)
    assert np.abs(found.q.values[1] - alone.q).max() <= ROUNDING


def pushed(torque, law):
    scene = two_links(1.0)
    scene.drive(next(iter(scene.joints)), torque=law(torque))
    return scene


@pytest.mark.slow
def test_laws_of_members_are_their_own():
    scene = partial(pushed, law=lambda torque: lambda t: torque * gauss.math.cos(t))
    found = gauss.sweep(scene, {"torque": [0.0, 1.0, -1.0]}, 0.05, **FIXED)
    for torque, member in zip((0.0, 1.0, -1.0), found.q.values, strict=True):
        alone = gauss.simulate(scene(torque), 0.05, integrator="rk4", step=1e-3, times=found.time.values)
        assert np.abs(member - alone.q).max() <= ROUNDING


def test_laws_that_change_behind_the_back_of_a_member_are_refused():
    held = {}

    def law(torque):
        held["torque"] = torque
        return lambda t: held["torque"] * gauss.math.cos(t)

    found = gauss.sweep(partial(pushed, law=law), {"torque": [1.0, 2.0]}, 0.05, **FIXED)
    assert found.status.values.tolist() == [2, 1] and "has changed since" in str(found.reason.values[0])


def killed_once(path, **values):
    """Scene; the first process that makes it from some value on dies as if it were killed."""
    if values["mass"] > 1.5:
        try:
            path.touch(exist_ok=False)
            os.kill(os.getpid(), signal.SIGKILL)
        except FileExistsError:
            pass
    return two_links(1.0, **values)


@pytest.fixture
def small_pieces(monkeypatch):
    monkeypatch.setattr(store, "PIECE_MEMBERS", 2)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["processes", "dask"])
def test_a_worker_that_is_killed_loses_nothing(kind, tmp_path, small_pieces):
    masses = {"mass": np.linspace(1.0, 2.0, 8)}
    path, expected = tmp_path / "sweep.zarr", gauss.sweep(partial(two_links, 1.0), masses, 0.02, **FIXED)
    scene = partial(killed_once, tmp_path / "killed")
    if kind == "processes":
        found = gauss.sweep(scene, masses, 0.02, workers=2, path=path, **FIXED)
    else:
        distributed = pytest.importorskip("distributed", reason="Dask is optional")
        settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
        with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
            found = gauss.sweep(scene, masses, 0.02, workers=client, path=path, **FIXED)
    assert (tmp_path / "killed").exists() and (found.status == 1).all()
    assert np.abs(found.q.values - expected.q.values).max() <= ROUNDING


def stops(values):
    def scene(mass):
        if mass > values["until"]:
            raise KeyboardInterrupt
        values["made"].append(mass)
        return two_links(1.0, mass)

    return scene


@pytest.mark.slow
def test_an_interrupted_sweep_goes_on_from_its_folder(tmp_path, small_pieces):
    path, masses = tmp_path / "sweep.zarr", {"mass": np.linspace(1.0, 2.0, 8)}
    values = {"until": 1.6, "made": []}
    with pytest.raises(KeyboardInterrupt):
        gauss.sweep(stops(values), masses, 0.02, path=path, **FIXED)
    assert gauss.load_sweep(path).status.values.tolist() == [1, 1, 1, 1, 0, 0, 0, 0]
    values |= {"until": 3.0, "made": []}
    found = gauss.sweep(stops(values), masses, 0.02, path=path, **FIXED)
    assert values["made"] == pytest.approx([1.0, *masses["mass"][4:]])  # the first says what the arrays are like
    expected = gauss.sweep(partial(two_links, 1.0), masses, 0.02, **FIXED)
    assert np.abs(found.q.values - expected.q.values).max() <= ROUNDING and (found.status == 1).all()
    for other in ({"duration": 0.03}, {"scene": partial(two_links, 1.0)}, {"vary": {"mass": np.linspace(1.0, 3.0, 8)}}):
        with pytest.raises(FileError, match="another sweep"):
            given = {"scene": stops(values), "vary": masses, "duration": 0.02, "path": path, **FIXED} | other
            gauss.sweep(**given)


@pytest.mark.slow
def test_a_folder_is_read_without_gauss_and_says_what_it_holds(tmp_path):
    path, scene = tmp_path / "sweep.zarr", gauss.load("double_pendulum")
    body = next(iter(scene.bodies))
    made = gauss.sweep(scene, {f"{body}.mass": [1.0, 2.0], "A.rate": [0.0]}, 0.05, path=path, **FIXED)
    folder = zarr.open_group(path, mode="r")
    assert np.array_equal(folder["q"][:], made.q.values) and folder.attrs["setting_integrator"] == "rk4"
    with xarray.open_zarr(path) as found:
        assert found[f"{body}.mass"].attrs["units"] == "kg" and found["A.rate"].attrs["units"] == "rad/s"
        assert found.time.attrs["units"] == "s"
        assert found.attrs["scene_sha256"] == gauss.to_dataset(gauss.simulate(scene, 0.01)).attrs["scene_sha256"]


WRONG = {
    "crnk.mass": "Did you mean 'crank'",
    "crank.mas": "Did you mean 'mass'",
    "mass": "no 'mass' in scene",
    "crank.com": r"name one of them: crank.com\[0\] to \[2\]",
    "crank.com[7]": "has 3 entries",
    "crank.mass.x": "one number, without an index",
    "crank.on": "no number",
    "A.rates": "Did you mean 'rate'",
}


@pytest.mark.parametrize("name", WRONG)
def test_names_that_are_not_there_are_refused(name):
    with pytest.raises(SceneError, match=WRONG[name]):
        gauss.sweep(gauss.load("four_bar"), {name: [1.0]}, 0.1, **FIXED)


@pytest.mark.parametrize(
    "text", ["crank.mass", "=1", "crank.mass=1:2", "crank.mass=a,b", "crank.mass=1:2:x", "crank.mass=1:2:3:4"]
)
def test_texts_that_are_no_values_are_refused(text):
    with pytest.raises(SceneError, match="crank.mass=0.5:2:50"):
        ranges([text])


def test_texts_say_names_and_values():
    found = ranges(["crank.mass=0.5:2:4", "A.rate=5,-1"])
    assert found["crank.mass"] == pytest.approx([0.5, 1.0, 1.5, 2.0]) and found["A.rate"] == pytest.approx([5.0, -1.0])
    with pytest.raises(SceneError, match="given twice"):
        ranges(["a.b=1", "a.b=2"])


MISTAKES = [
    ({"vary": {}}, SceneError, "expected names with their values"),
    ({"vary": ["crank.mass"]}, SceneError, "expected names with their values"),
    ({"vary": {"crank.mass": "heavy"}}, SceneError, "expected finite numbers"),
    ({"vary": {"crank.mass": [1.0, np.nan]}}, SceneError, "expected finite numbers"),
    ({"vary": {"crank.mass": [1.0], "A.rate": [1.0, 2.0]}, "together": True}, SceneError, "the same number of each"),
    ({"scene": "four_bar"}, ArgumentError, r"gauss.load\(name\)"),
    ({"duration": -1.0}, SimulationError, "duration"),
    ({"samples": 1}, SimulationError, "samples"),
    ({"integrator": "rk5"}, SimulationError, "rk4"),
    ({"step": None}, SimulationError, "fixed step"),
    ({"rtol": -1.0}, SimulationError, "rtol"),
    ({"atol": (1.0, 2.0, 3.0)}, SimulationError, "a pair"),
    ({"integrator": 4}, SimulationError, "expected a name"),
    ({"workers": 0}, SimulationError, "workers"),
    ({"workers": "two"}, SimulationError, "concurrent.futures"),
    *(({"measure": {name: abs}}, SimulationError, "a name of its own") for name in ("q", "rate", "crank.mass", "status")),
    ({"measure": {"highest": 1.0}}, SimulationError, "a function of a trajectory"),
    ({"path": "sweep.nc"}, FileError, "to_netcdf"),
    ({"vary": {"crank.mass": [-1.0, -2.0]}}, SimulationError, "no member of the sweep could be built"),
]


@pytest.mark.parametrize("wrong, kind, words", MISTAKES)
def test_mistakes_are_told(wrong, kind, words):
    given = {"scene": gauss.load("four_bar"), "vary": {"crank.mass": [1.0]}, "duration": 0.1, **FIXED} | wrong
    with pytest.raises(kind, match=words):
        gauss.sweep(**given)


def test_members_of_other_sizes_are_no_members():
    def scene(n):
        return mechanisms.chain([1.0] * int(n))

    found = gauss.sweep(scene, {"n": [2, 3]}, 0.02, **FIXED)
    assert found.status.values.tolist() == [1, 2] and "coordinates" in str(found.reason.values[1])


@pytest.mark.parametrize("shape", [(5,), (3, 4), (2, 700), (2, 3, 5), (600, 2)])
def test_pieces_are_blocks_that_cover_all_members(shape):
    members = Members(tuple("abc"[: len(shape)]), tuple(map(np.zeros, shape)))
    seen = np.zeros(shape, dtype=int)
    for begin, end in store.pieces(members):
        room = seen[tuple(store.block(members, begin, end).values())]
        assert room.size == end - begin <= store.PIECE_MEMBERS
        room += 1
        assert seen.ravel()[begin:end].all()
    assert (seen == 1).all()


@pytest.mark.slow
def test_the_command_sweeps_and_says_what_came_of_it(tmp_path):
    path = tmp_path / "sweep.zarr"
    chosen = "--vary crank.mass=-1,1,2 --vary A.rate=5:6:2 --duration 0.05 --integrator rk4 --step 1e-3".split()
    result = CliRunner().invoke(cli.app, ["sweep", "four_bar", *chosen, "--output", str(path)])
    assert result.exit_code == 0, result.output
    assert "4 of 6" in result.output and "2: body 'crank': mass" in result.output and "q A at the end" in result.output
    assert gauss.load_sweep(path).sizes["crank.mass"] == 3


def test_measures_find_the_start_of_their_own_member():
    """Systems of members that differ in their starts alone share machine code."""
    again = lambda motion: gauss.simulate(motion.system, 0.05, rtol=1e-9, atol=1e-9).q[0, 0]  # noqa: E731
    starts = [0.1, 0.4]
    found = gauss.sweep(gauss.load("pendulum"), {"A.position": starts}, 0.05, measure={"first": again}, **FIXED)
    assert found.first.values == pytest.approx(starts, abs=0)
