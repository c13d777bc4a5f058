"""The documentation builds without a warning; so does its gallery, whose scripts other tests run."""

import subprocess
import sys

import pytest

from gauss.cli.docs.groups import GROUPS
from tests.support.extras import others

pytestmark = pytest.mark.slow

COLLECTED = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[2:]))  # as if they were not installed
from pathlib import Path
from typer.main import get_command
from gauss.cli import app
from gauss.cli.docs.build import collect
collect(Path(sys.argv[1]), get_command(app))
"""


def test_the_documentation_builds_without_a_warning(tmp_path):
    pytest.importorskip("furo")
    command = [sys.executable, "-m", "gauss", "docs", "--output", str(tmp_path), "--no-gallery", "--strict"]
    # in a process of its own: Sphinx forks, which threads of other libraries do not survive
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    for page in ("index", "gallery/index", "benchmarks/index", *(f"reference/{group.key}" for group in GROUPS)):
        assert (tmp_path / f"{page}.html").exists(), page
    assert (tmp_path / "reference" / "names" / "gauss.simulate.html").exists()


def test_the_extra_has_what_the_reference_needs(tmp_path):
    pytest.importorskip("gymnasium")
    run = subprocess.run([sys.executable, "-c", COLLECTED, str(tmp_path), *others("docs")], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "reference" / "names" / "gauss.gym.Task.rst").exists()
