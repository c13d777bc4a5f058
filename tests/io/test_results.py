"""Motions as labelled arrays, tables and files: what is in them is the motion, and no gauss is needed to read them."""

import hashlib
import subprocess
import sys

import numpy as np
import pytest
import xarray
import zarr

import gauss
from gauss import rotations, rotors, servo
from gauss.errors import ArgumentError, MissingPackageError, SimulationError
from gauss.simulation.trajectory import LEAST_COMPILED_SAMPLES

ROUNDING = 1e-14  # of a rotation that is turned into a quaternion and back

READER = """
import hashlib, sys
import h5py
with h5py.File(sys.argv[1]) as file:
    text = file.attrs["scene_toml"]
    assert hashlib.sha256(text.encode()).hexdigest() == file.attrs["scene_sha256"]
    names = [name.decode() for name in file["coordinate"][:]]
    print(names, file["time"].attrs["units"], file["q"].shape, *file.attrs["setting_rtol"])
assert not {"gauss", "xarray"} & set(sys.modules)
"""


@pytest.fixture(scope="module")
def motion():
    return gauss.simulate(gauss.load("four_bar"), 0.1, times=np.linspace(0, 0.1, 7), rtol=1e-9)


def _all_pairs():
    scene = gauss.Scene("pairs")
    for name, kind in (("U", "universal"), ("C", "cylindrical"), ("P", "planar"), ("B", "ball"), ("F", "free")):
        body = scene.body(f"body {name}", mass=1.0, inertia=(0.1, 0.1, 0.1))
        scene.joint(name, kind, "ground", body)
    return scene


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.NonUniqueReactionWarning")  # a planar loop is redundant in space
def test_a_dataset_holds_the_motion_under_names(motion):
    found = gauss.to_dataset(motion, joints=["B"])
    assert dict(found.sizes) == {
        "time": 7, "coordinate": 4, "rate": 4, "body": 3, "axis": 3, "component": 4, "event": 0, "joint": 1
    }  # fmt: skip
    assert found.q.sel(coordinate="B").values == pytest.approx(motion.coordinate("B"), abs=0)
    assert found.v.sel(rate="B").values == pytest.approx(motion.rate("B"), abs=0)
    assert found.position.sel(body="rocker").values == pytest.approx(motion.body("rocker").position, abs=ROUNDING)
    assert found.reaction_force.sel(joint="B").values == pytest.approx(gauss.reactions(motion, "B").force, abs=0)
    assert found.balance.values == pytest.approx(gauss.energy(motion).balance, abs=0)
    units = {name: variable.attrs.get("units") for name, variable in found.variables.items()}
    assert (units["time"], units["position"], units["kinetic"]) == ("s", "m", "J")
    assert (units["reaction_force"], units["reaction_moment"]) == ("N", "N m")


@pytest.mark.slow
def test_orientations_are_the_rotations_of_the_bodies(motion):
    orientation = gauss.to_dataset(motion).orientation.sel(body="coupler").values
    turned = np.array([rotations.from_quaternion(row) for row in orientation])
    assert turned == pytest.approx(motion.body("coupler").rotation, abs=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, LEAST_COMPILED_SAMPLES + 1])  # few samples by numpy, many by machine code
def test_poses_are_those_of_the_bodies(count):
    motion = gauss.simulate(_all_pairs(), 0.1, times=np.linspace(0, 0.1, count))
    positions, turned = motion.poses()
    for i, name in enumerate(motion.system.structure.bodies):
        assert positions[:, i] == pytest.approx(motion.body(name).position, abs=ROUNDING)
        assert turned[:, i] == pytest.approx(motion.body(name).rotation, abs=ROUNDING)


@pytest.mark.slow
def test_every_coordinate_and_rate_has_its_unit():
    found = gauss.to_dataset(gauss.simulate(_all_pairs(), 1e-3, times=[0.0]))
    units = dict(zip(found.coordinate.values.tolist(), found.coordinate_unit.values.tolist(), strict=True))
    assert [units[name] for name in ("U.angle2", "C.angle", "C.slide", "P.x", "P.angle")] == ["rad", "rad", "m", "m", "rad"]
    assert [units[name] for name in ("B.qw", "F.x", "F.qz")] == ["1", "m", "1"]
    rates = dict(zip(found.rate.values.tolist(), found.rate_unit.values.tolist(), strict=True))
    assert [rates[name] for name in ("B.wx", "F.z", "F.wz", "C.slide")] == ["rad/s", "m/s", "rad/s", "m/s"]


@pytest.mark.slow
def test_netcdf_is_read_without_gauss(motion, tmp_path):
    path = gauss.save(motion, tmp_path / "motion.nc")
    ran = subprocess.run([sys.executable, "-c", READER, str(path)], capture_output=True, text=True, cwd=tmp_path)
    assert ran.stdout.split() == ["['A',", "'B',", "'C',", "'D']", "s", "(7,", "4)", "1e-09"], ran.stderr


@pytest.mark.slow
@pytest.mark.parametrize("atol", [None, (1e-6, 1e-5), {"A": 1e-6, "B": (1e-6, 1e-5)}], ids=str)
def test_the_scene_and_settings_in_a_file_make_the_same_motion_again(atol, tmp_path):
    """Whatever the settings were: one that is lost, or another than it was, makes other steps."""
    motion = gauss.simulate(gauss.load("double_pendulum"), 0.1, times=np.linspace(0, 0.1, 7), rtol=1e-9, atol=atol)
    path = gauss.save(motion, tmp_path / "motion.nc")
    with xarray.open_dataset(path) as found:
        assert found.time.dtype == float  # seconds stay numbers
        (tmp_path / "scene.toml").write_text(found.attrs["scene_toml"])
        q, times = found.q.values, found.time.values
        kept = {name: found.attrs[f"setting_{name}"] for name in ("duration", "integrator", "rtol")}
        assert ("setting_atol" in found.attrs) == (atol is not None)
    settings = gauss.load_motion(path).settings
    assert settings["atol"] == atol if atol is not None else "atol" not in settings
    kept |= {} if atol is None else {"atol": settings["atol"]}
    again = gauss.simulate(gauss.load(tmp_path / "scene.toml"), times=times, **kept)
    assert again.q == pytest.approx(q, abs=0) and again.stats.steps == motion.stats.steps


def test_a_scene_that_no_file_can_hold_says_so():
    scene = gauss.load("pendulum")
    scene.drive("A", torque=lambda t: 0.0)
    about = gauss.to_dataset(gauss.simulate(scene, 1e-3)).attrs
    assert "Python function" in about["scene_remark"]
    assert about["scene_toml"] == about["scene_sha256"] == ""


@pytest.mark.slow
def test_a_changed_scene_has_another_hash(motion):
    hashes = {gauss.to_dataset(motion).attrs["scene_sha256"]}
    scene = gauss.load("four_bar")
    scene.start("A", rate=10.000001)
    hashes.add(gauss.to_dataset(gauss.simulate(scene, 1e-3)).attrs["scene_sha256"])
    assert len(hashes) == 2
    assert hashes >= {hashlib.sha256(gauss.to_dataset(motion).attrs["scene_toml"].encode()).hexdigest()}


@pytest.mark.slow
def test_events_are_rows():
    found = gauss.to_dataset(gauss.simulate(gauss.load("double_pendulum_stops"), 1.0))
    assert found.sizes["event"] > 0
    assert found.event_loss.values[found.event_kind.values == "impact"].max() > 0


def test_settings_are_kept_even_of_a_motion_that_fails():
    scene = gauss.load("pendulum")
    scene.drive("A", torque=lambda t: 0.0 if t < 0.05 else float("nan"))
    with pytest.raises(SimulationError) as failure:
        gauss.simulate(scene, 0.1, rtol=1e-7)
    assert failure.value.trajectory.settings["rtol"] == 1e-7


def test_tables_have_units_in_their_names(motion, tmp_path):
    table = gauss.to_table(motion)
    assert table.index.name == "t [s]"
    assert table["v A [rad/s]"].to_numpy() == pytest.approx(motion.rate("A"), abs=0)
    written = np.genfromtxt(gauss.save(motion, tmp_path / "motion.csv"), delimiter=",", names=True)
    assert written["q_A_rad"] == pytest.approx(motion.coordinate("A"), abs=0)


def test_a_missing_library_is_named(motion, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingPackageError, match="xarray is not installed: pip install xarray"):
        gauss.to_dataset(motion)


@pytest.mark.slow
def test_a_motion_comes_back_from_zarr(motion, tmp_path):
    path = gauss.save(motion, tmp_path / "motion.zarr")
    again = gauss.load_motion(path)
    assert np.array_equal(again.q, motion.q) and np.array_equal(again.v, motion.v) and np.array_equal(again.t, motion.t)
    assert again.settings["rtol"] == motion.settings["rtol"] and again.system.scene.name == "four-bar"
    folder = zarr.open_group(path, mode="r")
    assert np.array_equal(folder["position"][:], gauss.to_dataset(motion).position.values)


@pytest.mark.slow
def test_a_motion_under_servos_is_labelled():
    tracking = servo.simulate(gauss.load("servo/crane"), 0.05, times=[0.0, 0.025, 0.05])
    found = gauss.to_dataset(tracking)
    name = tracking.servo.efforts[0]
    assert found.effort.sel(effort_name=name).values == pytest.approx(tracking.effort(name), abs=0)
    assert found.gap.dims == ("time", "relation") and found.effort_work.attrs["units"] == "J"
    assert found.q.values == pytest.approx(tracking.motion.q, abs=0)


@pytest.mark.slow
def test_a_motion_of_rotors_is_labelled(tmp_path):
    network = gauss.load_rotors("gear_runup")
    run = rotors.simulate(network, 0.2)
    found = gauss.to_dataset(run)
    shaft, link = found.shaft.values[0], found.link.values[0]
    assert found.speed.sel(shaft=shaft).values == pytest.approx(run.speed(shaft), abs=0)
    assert found.torque.sel(link=link).values == pytest.approx(run.torque(link), abs=0)
    assert found.energy_balance.values == pytest.approx(run.energy().balance, abs=0)
    assert found.attrs["network_sha256"] == hashlib.sha256(found.attrs["network_toml"].encode()).hexdigest()
    path = gauss.save(run, tmp_path / "run.nc")
    with xarray.open_dataset(path, engine="h5netcdf") as there:
        assert np.array_equal(there.speed.values, run.speeds)


@pytest.mark.slow
def test_many_motions_are_labelled(tmp_path):
    arm = gauss.compile_scene(gauss.load("double_pendulum"))
    many = gauss.rollout(arm, [[0.1, 0.0], [0.2, 0.0]], np.zeros((2, 2)), steps=4, step=1e-3, every=2)
    found = gauss.to_dataset(many)
    assert found.q.dims == ("motion", "time", "coordinate") and np.array_equal(found.q.values, many.q)
    assert list(found.coordinate.values) == list(arm.coordinates) and found.steps.values.tolist() == [4, 4]
    with xarray.open_zarr(gauss.save(many, tmp_path / "many.zarr")) as there:
        assert np.array_equal(there.v.values, many.v)
    with pytest.raises(ArgumentError, match="joints="):
        gauss.to_dataset(many, joints=["A"])


@pytest.mark.parametrize("thing", [np.zeros(3), "motion", None])
def test_what_is_no_result_is_not_saved(thing, tmp_path):
    with pytest.raises(ArgumentError, match=type(thing).__name__):
        gauss.save(thing, tmp_path / "thing.nc")
