"""The documentation builds without a warning; so does its gallery, whose scripts other tests run."""

import warnings

import pytest
from typer.testing import CliRunner

from gauss import cli
from gauss.docs.groups import GROUPS


@pytest.mark.slow
def test_the_documentation_builds_without_a_warning(tmp_path):
    pytest.importorskip("furo")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of extensions
        result = CliRunner().invoke(cli.app, ["docs", "--output", str(tmp_path), "--no-gallery", "--strict"])
    assert result.exit_code == 0, result.output
    for page in ("index", "gallery/index", "benchmarks/index", *(f"reference/{group.key}" for group in GROUPS)):
        assert (tmp_path / f"{page}.html").exists(), page
    assert (tmp_path / "reference" / "names" / "gauss.simulate.html").exists()
