"""Results of every kind are written with every ending, and hold the columns, with their units."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss import rotors, servo
from gauss.errors import FileError
from gauss.io.columns import UNIT, columns
from gauss.io.load import RESULTS, WRITERS

SAME = 1e-8  # rad, of motions of relative tolerance 1e-9
FIRST = {"rollout": "motion [1]", "cycle": "crank angle [rad]", "rotormotion": "time [s]"}


def _sweep(**kind):
    pytest.importorskip("xarray")
    return gauss.sweep(
        gauss.load("pendulum"), {"A.position": [0.1, 0.2, 0.3], "rod.mass": [1.0, 2.0, 3.0]}, 0.02, samples=3, **kind
    )


def _pendulum(angle, mass):
    scene = gauss.load("pendulum")
    scene.start("A", position=angle)
    scene.bodies["rod"] = replace(scene.bodies["rod"], mass=mass)
    return scene


def _motor_run():
    linkage = gauss.load_linkage("four_bar")
    linkage.motor(speed=[0, 20], torque=[120, 0])
    return linkage.run(0.05)


MAKERS = {
    "trajectory": lambda: gauss.simulate(gauss.load("pendulum"), 0.05),
    "tracking": lambda: servo.simulate(gauss.load("servo/crane"), 0.05),
    "rotormotion": lambda: rotors.simulate(gauss.load_rotors("gear_runup"), 0.01, times=np.linspace(0, 0.01, 4)),
    "rollout": lambda: gauss.rollout(
        gauss.compile_scene(gauss.load("pendulum")), [[0.1], [0.2]], [[0.0], [0.0]], step=0.01, steps=2
    ),
    "cycle": lambda: gauss.load_linkage("shaper").cycle(np.linspace(0.1, 0.4, 5)),
    "crankrun": _motor_run,
    "dataset": lambda: _sweep(),
}


@pytest.fixture(scope="module")
def results():
    """Results by their kind, each made once."""
    return {}


def _result(results, kind):
    if kind not in results:
        results[kind] = MAKERS[kind]()
    return results[kind]


def _read(path):
    """Columns of a file by reading libraries of others."""
    if path.suffix == ".csv":
        with open(path, newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        return {name: list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    return dict(np.load(path))


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".csv", ".json", ".npz"])
@pytest.mark.parametrize("kind", MAKERS)
def test_tables_hold_the_columns(results, kind, ending, tmp_path):
    if WRITERS[kind][ending] is not RESULTS[ending]:
        pytest.skip("an archive with a layout of its own")
    result = _result(results, kind)
    expected, found = columns(result), _read(gauss.save(result, tmp_path / f"result{ending}"))
    assert list(found) == list(expected)
    for name, values in expected.items():
        if np.asarray(values).dtype.kind == "f":
            read = np.array([math.nan if value is None else float(value) for value in found[name]])
            np.testing.assert_array_equal(read, values, name)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".nc", ".h5", ".zarr"])
@pytest.mark.parametrize("kind", MAKERS)
def test_labelled_files_say_units(results, kind, ending, tmp_path):
    xarray = pytest.importorskip("xarray")
    path = gauss.save(_result(results, kind), tmp_path / f"result{ending}")
    with xarray.open_dataset(path, engine="zarr" if ending == ".zarr" else "h5netcdf") as found:
        numbers = [name for name, values in found.data_vars.items() if values.dtype.kind == "f"]
        assert numbers and all("units" in found[name].attrs for name in numbers)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAKERS)
def test_every_column_of_numbers_has_a_unit_and_none_is_empty(results, kind):
    for name, values in columns(_result(results, kind)).items():
        if np.asarray(values).dtype.kind == "f":
            assert UNIT.fullmatch(name), name
            assert np.isfinite(values).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind != "dataset"])
def test_tables_of_pandas_hold_the_columns(results, kind):
    pytest.importorskip("pandas")
    result = _result(results, kind)
    table = gauss.to_table(result)
    assert [*table.index.names, *table.columns] == list(columns(result))
    assert table.index.names[0] == FIRST.get(kind, "t [s]")


@pytest.mark.slow
@pytest.mark.parametrize("together", [False, True])
def test_sweeps_have_a_row_for_each_member(together):
    found = columns(_sweep(together=together))
    assert len(found["status"]) == (3 if together else 9)
    pairs = list(zip(found["A.position [rad]"], found["rod.mass [kg]"], strict=True))
    assert len(set(pairs)) == len(pairs)
    place = pairs.index((0.3, 3.0))
    alone = gauss.simulate(_pendulum(0.3, 3.0), 0.02, rtol=1e-9).q[-1, 0]
    assert found["q A at the end [rad]"][place] == pytest.approx(alone, abs=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".nc", ".h5"])
def test_a_sweep_comes_back_from_its_file(results, ending, tmp_path):
    sweep = _result(results, "dataset")
    again = gauss.load_sweep(gauss.save(sweep, tmp_path / f"sweep{ending}"))
    assert again.load().equals(sweep) and again.attrs["sweep_sha256"] == sweep.attrs["sweep_sha256"]


@pytest.mark.parametrize("ending", [".png", ".gif", ".html", ".txt"])
def test_other_endings_are_refused_with_those_that_work(ending, tmp_path):
    path = tmp_path / f"result{ending}"
    with pytest.raises(FileError, match="is written as .npz or .csv or .json or .nc or .h5 or .zarr"):
        gauss.save({"t [s]": np.zeros(2)}, path)
    assert not path.exists()
