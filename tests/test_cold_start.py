"""What takes long to import is imported where it is used, and nowhere else."""

import subprocess
import sys
from pathlib import Path

import pytest

from gauss.simulation import progress

HEAVY = ("scipy", "pinocchio", "qpsolvers", "osqp", "matplotlib", "tqdm", "typer", "rich", "gauss.linkages", "gauss.rotors")


def _imported(code: str) -> set[str]:
    """Heavy modules that a fresh process imports."""
    script = f"{code}\nimport sys\nprint(*(name for name in {HEAVY!r} if name in sys.modules))"
    where = {"cwd": Path(__file__).parent.parent, "capture_output": True, "text": True, "check": True}
    return set(subprocess.run([sys.executable, "-c", script], **where).stdout.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    "code, expected",
    [
        ("import gauss", set()),
        ("import gauss; gauss.simulate(gauss.load('four_bar'), 0.01, progress=False)", set()),
        ("import gauss; gauss.load('robot:ur5')", {"pinocchio"}),
        ("import gauss; gauss.Linkage", {"gauss.linkages"}),
    ],
)
def test_only_what_is_used_is_imported(code, expected):
    assert _imported(code) == expected


def test_an_unknown_name_is_an_error():
    import gauss

    with pytest.raises(AttributeError, match="no attribute 'lenkage'"):
        gauss.lenkage  # noqa: B018


def test_a_bar_appears_on_slow_runs_only(monkeypatch):
    quick = progress.Progress(1.0, shown=True)
    quick.update(0.5)
    quick.close()
    assert quick.bar is None
    monkeypatch.setattr(progress, "SLOW", 0.0)
    slow, hidden = progress.Progress(2.0, shown=True), progress.Progress(2.0, shown=False)
    for bar in (slow, hidden):
        bar.update(0.5)
        bar.close()
    assert slow.bar.total == 2.0 and hidden.bar is None


@pytest.mark.slow
def test_what_is_listed_is_there_and_nothing_else():
    """In a fresh process: all public names, those that are imported later among them, and no helper."""
    code = """
import gauss
listed = {name for name in dir(gauss) if not name.startswith("__")}
print(*sorted(listed - set(gauss.__all__)))
print(*sorted(set(gauss.__all__) - listed))
print(*(name for name in dir(gauss) if not hasattr(gauss, name)))
print("__version__" in dir(gauss), gauss.__version__)
"""
    ran = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parent.parent, capture_output=True, text=True)
    beside, lacking, absent, version = ran.stdout.splitlines()
    assert set(beside.split()) <= {"errors", "linkages", "math", "rotors", "scene", "servo", "sweeps", "view"}, ran.stderr
    assert {"errors", "math"} <= set(beside.split())
    assert not lacking and not absent
    assert version.startswith("True ") and version.split()[1][0].isdigit()


@pytest.mark.slow
def test_names_whose_packages_are_missing_are_not_listed():
    """So help(gauss) and completion work without them."""
    code = "import sys; sys.modules['viser'] = None\nimport gauss, pydoc\n"
    code += "print('show' in dir(gauss), len(pydoc.render_doc(gauss)))"
    where = {"cwd": Path(__file__).parent.parent, "capture_output": True, "text": True}
    listed, length = subprocess.run([sys.executable, "-c", code], **where).stdout.split()
    assert listed == "False" and int(length) > 1000


@pytest.mark.slow
def test_the_version_is_that_of_the_package():
    import gauss

    ran = subprocess.run([sys.executable, "-m", "gauss", "--version"], capture_output=True, text=True)
    assert ran.returncode == 0 and ran.stdout.split() == ["gauss", gauss.__version__]
