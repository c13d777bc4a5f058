"""What takes long to import is imported where it is used, and nowhere else."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import pytest

import gauss
from gauss.codegen.linking import LAPACK
from gauss.integrators.methods import LIBRARY_ORIGINS, ORIGINS
from gauss.lazy import LazyTable
from gauss.simulation import progress
from gauss.simulation.integrators import NONSMOOTH_ORIGINS

ROOT = Path(gauss.__file__).parent
STUBBED = [".".join(path.parent.relative_to(ROOT.parent).parts) for path in sorted(ROOT.rglob("__init__.pyi"))]

OPTIONAL = (
    *("scipy", "pinocchio", "qpsolvers", "osqp", "matplotlib", "pandas", "xarray", "mujoco", "tqdm", "typer", "rich"),
    *("numpy.ma", "importlib.metadata", "xml.etree", "gauss.linkages", "gauss.rotors", "gauss.servo"),
)
HEAVY = (*OPTIONAL, "numpy", "llvmlite", "gauss.scene.scene", "gauss.dynamics.plan", "gauss.simulation.simulate")
UNUSED = (  # drivers, integrators and elements of scenes that a four-bar does not use
    *("gauss.simulation.moreau.moreau_jean", "gauss.simulation.phases.phase", "gauss.simulation.library_run"),
    *("gauss.integrators.symplectic", "gauss.integrators.radau", "gauss.scene.gears", "gauss.scene.rolling"),
)
SIMULATE = "import gauss; gauss.simulate(gauss.load('four_bar'), 0.01, progress=False)"
STEPPED = (  # by machine code that calls LAPACK
    "import gauss; gauss.simulate(gauss.load('rolling_ball'), 0.01, integrator='time_stepping', step=1e-3, progress=False)"
)
HELP = (
    "import sys, runpy; sys.argv = ['gauss', {}'--help']\n"
    "try: runpy.run_module('gauss', run_name='__main__')\n"
    "except SystemExit: pass"
)


def _imported(code: str, names: tuple[str, ...]) -> set[str]:
    """Which of these modules a fresh process imports."""
    script = f"{code}\nimport sys\nprint('modules:', *(name for name in {names!r} if name in sys.modules))"
    where = {"cwd": Path(__file__).parent.parent, "capture_output": True, "text": True, "check": True}
    return set(subprocess.run([sys.executable, "-c", script], **where).stdout.rpartition("modules:")[2].split())


@pytest.mark.slow
@pytest.mark.parametrize(
    "code, names, expected",
    [
        ("import gauss", HEAVY, set()),
        ("from gauss import GaussError", HEAVY, set()),
        (HELP.format(""), HEAVY, {"typer"}),
        (HELP.format("'run', "), ("rich", "numpy", "llvmlite", "scipy", "gauss.scene.scene"), set()),
        (SIMULATE, OPTIONAL + UNUSED, set()),
        (STEPPED, ("scipy.linalg", "scipy.sparse", "qpsolvers"), set()),
        (STEPPED + "\nfrom scipy.linalg import cython_lapack, inv; inv([[1.0]])", (LAPACK,), {LAPACK}),
        ("import gauss; gauss.load('robot:ur5')", ("pinocchio", "scipy"), {"pinocchio"}),
        ("import gauss; gauss.Linkage", ("gauss.linkages", "gauss.rotors"), {"gauss.linkages"}),
    ],
)
def test_only_what_is_used_is_imported(code, names, expected):
    assert _imported(code, names) == expected


@pytest.mark.parametrize("origin", [*ORIGINS, *LIBRARY_ORIGINS, *NONSMOOTH_ORIGINS])
def test_the_table_of_methods_names_each_of_them(origin):
    module, several = origin
    names = (ORIGINS | LIBRARY_ORIGINS | NONSMOOTH_ORIGINS)[origin]
    assert tuple(method.name for method in getattr(import_module(module), several)) == names


@pytest.mark.parametrize("package", STUBBED)
def test_public_names_take_precedence_over_modules_of_the_same_name(package):
    """Also where the module was imported before the name was asked for."""
    found = import_module(package)
    for module in iter_modules(found.__path__, f"{package}."):
        if module.name.rpartition(".")[2] in found.__all__:
            import_module(module.name)
    modules = {name for name in found.__all__ if isinstance(getattr(found, name), ModuleType)}
    assert modules == ({"actuators", "profiles"} if package == "gauss.scene" else set())
    assert set(found.__all__) <= set(dir(found))


def test_a_lazy_table_finds_a_value_when_it_is_asked_for():
    asked = []
    table = LazyTable({"one": 1, "two": 2}, lambda source: asked.append(source) or -source)
    assert (list(table), len(table), "two" in table, asked) == (["one", "two"], 2, True, [])
    assert (table["two"], table.get("three"), asked) == (-2, None, [2])


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
