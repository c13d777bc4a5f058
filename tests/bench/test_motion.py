"""What a backend's tolerance does to a motion: exact solvers change nothing, loose ones are reported."""

import numpy as np
import pytest

from gauss.bench import motion
from gauss.bench.motion import compare_motions, drive, markdown
from gauss.bench.table import header_of
from gauss.errors import BackendError


@pytest.fixture
def short(monkeypatch):
    """A fifth of a second in place of ten."""
    monkeypatch.setattr(motion, "DURATION", 0.2)
    monkeypatch.setattr(motion, "SAMPLES", 3)


@pytest.mark.slow
@pytest.mark.parametrize("scene", motion.SCENES)
def test_only_the_solver_is_to_blame(short, scene):
    expected = motion._certified(scene).q
    own, exact, loose = (drive(scene, *how, expected) for how in (("recursion", "own"), ("daqp", "high"), ("piqp", "low")))
    assert own["reached"] == exact["reached"] == loose["reached"] == 0.2
    assert own["error"] == 0.0 and exact["error"] <= 1e-10 < loose["error"]
    assert exact["energy"] == pytest.approx(own["energy"], rel=1e-3)


@pytest.mark.slow
def test_a_solver_that_gives_up_ends_its_motion(short):
    """CVXOPT refuses the redundant rows of a planar loop of spatial hinges."""
    found = drive("four_bar", "cvxopt", "high", motion._certified("four_bar").q)
    assert found["reached"] == 0.0 and "cvxopt" in found["words"]


def test_report(short, tmp_path):
    """In workers the motion lasts ten seconds: only what needs none is asked for here."""
    with pytest.raises(BackendError, match="no scene 'door'"):
        compare_motions(tmp_path, scenes=["door"])
    rows = [
        {"scene": "four_bar", "backend": name, "level": "high", "reached": 10.0, "error": error, "words": ""}
        | {"energy": 1e-3, "gap": np.nan, "seconds": 1.0}
        for name, error in (("a", 1e-10), ("b", 1e-6), ("c", 1e-3), ("d", 1.0))
    ]
    (tmp_path / "t").write_text("# date\n# machine\nscene\n")
    text = markdown(rows, header_of(tmp_path / "t"))
    assert "Not measured yet: double_pendulum, clarabel, high;" in text
    assert "* reference solutions (error up to 1e-09): a high." in text and "nothing in one of them: d high." in text
    for purpose in ("reference solutions", "engineering", "animation", "nothing: another motion"):
        assert purpose in text
