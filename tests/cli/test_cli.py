"""The command line as a user meets it: it runs, it explains, it fails with one line."""

import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import gauss
import gauss.__main__
from gauss.cli import as_options
from gauss.cli.common import tolerances
from gauss.errors import FileError, MissingPackageError
from tests.support.files import call

ROOT = Path(__file__).parents[2]


def _shell(*arguments):
    return subprocess.run([sys.executable, "-m", "gauss", *map(str, arguments)], capture_output=True, text=True, cwd=ROOT)


@pytest.mark.slow
def test_run_writes_what_it_is_asked_for(tmp_path):
    motion, figure = tmp_path / "motion.npz", tmp_path / "figure.png"
    arguments = ("run", "four_bar", "--duration", 0.1, "--samples", 11, "--output", motion, "--plot", figure, "--check")
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert "agreement" in result.output and "energy" in result.output
    assert np.load(motion)["t"] == pytest.approx(np.linspace(0, 0.1, 11))
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_events_are_counted_by_their_kind():
    result = call("run", "friction_oscillator", "--duration", 3)
    assert "4 × slips, 1 × holds" in result.output  # at the half swings of 0.1 π s, until it sticks


def test_a_scene_in_which_nothing_moves_is_explained(tmp_path):
    scene = gauss.Scene("still")
    scene.fixed("base", "ground", scene.body("post", mass=1.0))
    gauss.save(scene, tmp_path / "still.toml")
    said = call("explain", tmp_path / "still.toml")
    assert said.exit_code == 0 and "post" in said.output


def test_starts_from_the_command_line(tmp_path):
    motion = tmp_path / "motion.npz"
    arguments = ("--start", "A=0.3", "--speed", "A=-2", "--speed", "B=1", "--duration", 0.01, "--output", motion)
    assert call("run", "double_pendulum", *arguments).exit_code == 0
    archive = np.load(motion)
    assert archive["q"][0] == pytest.approx([0.3, 0.0])
    assert archive["v"][0] == pytest.approx([-2.0, 1.0])


@pytest.mark.parametrize(
    "entries, atol",
    [
        ([], None),
        (["1e-9"], 1e-9),
        (["1e-9,1e-7"], (1e-9, 1e-7)),
        (["angle=1e-7", "wrist=1e-8,1e-6"], {"angle": 1e-7, "wrist": (1e-8, 1e-6)}),
        (["1e-9", "length=1e-6"], {"angle": 1e-9, "length": 1e-6}),
    ],
)
def test_tolerances_from_the_command_line(entries, atol):
    assert tolerances(entries) == atol


@pytest.mark.slow
def test_a_coarse_joint_saves_steps():
    steps = []
    for atol in (("1e-12",), ("1e-12", "--atol", "rail=1e-3", "--atol", "pin=1e-3")):
        result = call("run", "cart_pole", "--duration", 1, "--rtol", 1e-14, "--atol", *atol)
        steps.append(int(re.search(r"steps +(\d+)", result.output)[1]))
    assert steps[1] < steps[0] / 2


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["spatial_tree", "four_bar", "gear_pair", "robot:ur5"])
def test_check_agrees(scene):
    result = call("check", scene, "--states", 3)
    assert result.exit_code == 0, result.output
    assert "joint accelerations" in result.output


@pytest.mark.slow
def test_check_fails_with_an_exit_code():
    result = call("check", "spatial_tree", "--states", 2, "--tolerance", 1e-30)
    assert result.exit_code == 1
    assert "DISAGREEMENT" in result.output and "FAILED" in result.output


@pytest.mark.slow
def test_explain_and_models():
    explained = call("explain", "four_bar").output
    assert "constraints" in explained and "distance to singularity" in explained and "recommended" in explained
    listed = call("models").output
    assert "four_bar" in listed and "n_pendulum" in listed


@pytest.mark.parametrize("command", ["run", "show", "check", "explain", "models", "doctor"])
def test_help_is_there(command):
    result = call(command, "--help")
    assert result.exit_code == 0
    assert "Usage" in result.output


@pytest.mark.parametrize("group", [(), ("bench",), ("problems",)])
def test_help_of_a_group_lists_whole_summaries(group):
    assert "..." not in call(*group, "--help").output.partition("Commands:")[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments, words",
    [
        (("run", "four_baar"), "Did you mean 'four_bar'"),
        (("run", "pendulum", "--start", "B=1"), "no joint 'B'"),
        (("run", "pendulum", "--start", "A"), "expected NAME=VALUE"),
        (("run", "pendulum", "--backend", "clarabell"), "Did you mean 'clarabel'"),
        (("run", "pendulum", "--integrator", "rk4"), "fixed step"),
        (("run", "pendulum", "--figure", "phaze"), "Did you mean 'phase'"),
        (("run", "pendulum", "--atol", "A=small"), "--atol A=small: expected a number, or NAME=NUMBER"),
        (("run", "pendulum", "--atol", "1,2,3"), "--atol 1,2,3: expected a number"),
        (("run", "pendulum", "--atol", "A=1e-8", "--atol", "A=1e-9"), "--atol A=1e-9: 'A' is given twice"),
        (("run", "pendulum", "--atol", "rist=1e-8"), "atol: no joint 'rist', and no kind of coordinates of this name"),
        (("run", "pendulum", "--atol", "A=-1"), "atol of 'A': expected a positive number"),
        (("run", "pendulum", "--duration", "1e9", "--plot", "figure.txt"), "saved as one of"),
        (
            ("run", "pendulum", "--duration", "1e9", "--output", "motion.txt"),
            "written as .npz or .csv or .json or .nc or .h5 or .zarr",
        ),
        (("run", "pendulum", "--duration", "1e9", "--output", "none/motion.csv"), "there is no folder 'none'"),
        (("run", "pendulum", "--duration", "1e9", "--plot", "none/motion.png"), "there is no folder 'none'"),
        (("check", "pendulum", "--states", "0"), "states: expected a positive number"),
        (("show", "motion.npz"), "motion.npz: no such file"),
        (("show", "pendulum", "--read", "stopps"), "--read: no 'stopps'. Did you mean 'stops'?"),
    ],
)
def test_errors_are_one_line_and_an_exit_code(arguments, words):
    result = _shell(*arguments)
    assert result.returncode == 2
    assert words in result.stderr
    assert "Traceback" not in result.stderr


def _snippets():
    text = (ROOT / "README.md").read_text()
    return re.findall(r"```python\n(.*?)```", text, re.S)


@pytest.mark.slow
def test_the_code_of_the_readme_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    for snippet in _snippets():
        exec(snippet, scope)
    assert "agreement" in capsys.readouterr().out
    assert str(scope["solution"].status) == "solved"
    assert "<html" in (tmp_path / "door.html").read_text()[:1000].lower()


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("rotors", "gear_runup", "--duration", 0.01, "--samples", 3),
        ("linkage", "four_bar", "--steps", 12, "--coupler", "coupler=0.5,0.2"),
        ("sweep", "pendulum", "--vary", "A.position=0.1:0.2:2", "--duration", 0.01, "--samples", 2),
        ("run", "pendulum", "--duration", 0.01),
    ],
)
@pytest.mark.parametrize("ending", [".csv", ".json", ".npz", ".nc"])
def test_output_is_written_as_its_ending_says(arguments, ending, tmp_path):
    path = tmp_path / f"output{ending}"
    result = call(*arguments, "--output", path)
    assert result.exit_code == 0, result.output
    assert path.stat().st_size > 0 and f"written to {path}" in result.output


@pytest.mark.slow
@pytest.mark.parametrize("command", [("rotors", "gear_runup"), ("linkage", "four_bar"), ("run", "pendulum")])
@pytest.mark.parametrize("ending, remedy", [(".png", "--plot"), (".gif", "--video"), (".html", "--html"), (".txt", ".csv")])
def test_output_of_another_kind_is_refused_at_once(command, ending, remedy, tmp_path):
    path = tmp_path / f"output{ending}"
    result = call(*command, "--run" if command[0] == "linkage" else "--duration", 1e9, "--output", path)
    assert isinstance(result.exception, FileError) and remedy in str(result.exception)
    assert not path.exists()


@pytest.mark.parametrize("ending, library", [(".nc", "h5netcdf"), (".h5", "h5netcdf"), (".zarr", "zarr")])
def test_output_whose_library_is_missing_is_refused_before_the_motion(ending, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    result = call("run", "pendulum", "--duration", 1e9, "--output", tmp_path / f"motion{ending}")
    assert isinstance(result.exception, MissingPackageError) and f"{library} is not installed" in str(result.exception)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the device that is full is one of Linux")
def test_a_full_disk_is_one_line():
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "gauss", "models"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert result.returncode == 2
    assert result.stderr.splitlines() == ["error: the output cannot be written: No space left on device."]


def test_an_interrupt_while_the_command_line_is_imported_leaves_no_traceback(monkeypatch):
    monkeypatch.setitem(sys.modules, "gauss.cli", Interrupted("gauss.cli"))
    assert gauss.__main__.main() == gauss.__main__.INTERRUPTED


class Interrupted(ModuleType):
    """Module that is interrupted when something is imported from it."""

    def __getattr__(self, name: str):
        if name == "main":
            raise KeyboardInterrupt
        raise AttributeError(name)


@pytest.mark.slow
def test_a_folder_of_the_name_of_a_model_hides_nothing(tmp_path, monkeypatch):
    (tmp_path / "four_bar").mkdir()
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path)
    assert call("explain", "four_bar").exit_code == 0
    for name in ("mine", "."):
        with pytest.raises(FileError, match="it is a folder; expected .toml"):
            gauss.load(name)


def test_errors_name_options_not_arguments():
    named = as_options("step= [s], as step=1e-3, or integrator='rk4'.")
    assert named == "--step [s], as --step 1e-3, or --integrator rk4."
