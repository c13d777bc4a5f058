"""Degrees that were given as radians are seen, and starts beyond the limits of a joint."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import StartWarning


def scene(kind="revolute", **options):
    found = gauss.Scene("one body")
    found.body("a", 1.0, (1, 1, 1))
    found.joint("J", kind, "ground", "a", **options)
    return found


SEEN = {
    "degrees": ("revolute", {}, 90, r"start of joint 'J': 90 rad are 14.3 turns. If degrees .*np.deg2rad\(90\) = 1.5708"),
    "the other way": ("revolute", {}, -45.0, r"-45 rad are -7.16 turns.*deg2rad\(-45\) = -0.785398"),
    "beyond limits": ("revolute", {"limits": (-1, 1)}, 2.0, r"2 rad is beyond its limits, -1 to 1 rad, where it starts"),
    "degrees beyond limits": ("revolute", {"limits": (-1, 1)}, 45, r"45 rad is beyond .*deg2rad\(45\) = 0.785398"),
    "a slide beyond limits": (
        "prismatic",
        {"limits": (0, 0.1)},
        0.5,
        r"0.5 m is beyond its limits, 0 to 0.1 m, .*instead\.$",
    ),
    "one of two angles": ("universal", {}, (0.1, 30.0), r"30 rad are"),
    "the angle of a plane": ("planar", {}, (100.0, 0.0, 30.0), r"30 rad are"),
}
QUIET = {
    "two turns": ("revolute", {}, 4 * np.pi),
    "a long slide": ("prismatic", {}, 100.0),
    "within limits": ("revolute", {"limits": (-1, 1)}, 1.0),
    "a quaternion": ("ball", {}, (1, 0, 0, 0)),
    "no position": ("revolute", {"limits": (1, 2)}, None),
    "far away in a plane": ("planar", {}, (100.0, 50.0, 1.0)),
}


@pytest.mark.parametrize("name", SEEN)
def test_what_cannot_be_meant_is_warned_of(name):
    kind, options, position, words = SEEN[name]
    with pytest.warns(StartWarning, match=words) as caught:
        scene(kind, **options).start("J", position)
    assert len(caught) == 1 and caught[0].filename == __file__  # it points at the line that says so


@pytest.mark.parametrize("name", QUIET)
def test_what_may_be_meant_is_not(name):
    kind, options, position = QUIET[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene(kind, **options).start("J", position)


def test_a_given_state_beyond_limits_is_moved_with_a_warning():
    system = gauss.compile_scene(scene(limits=(-1.0, 1.0)))
    with pytest.warns(StartWarning, match="'J'"):
        assert system.projected(system.state([2.0])).q == [1.0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.SimulatorBatch(system, 1e-3, 4).reset(q=np.ones((4, 1)), seed=0)  # random changes are kept within them


@pytest.mark.parametrize("kind", [np.int64, np.float32])
def test_numbers_of_numpy_are_starts(kind):
    assert scene().start("J", kind(1)).position == 1.0


@pytest.mark.slow
def test_the_command_line_says_it():
    ran = subprocess.run(
        [sys.executable, "-m", "gauss", "run", "pendulum", "--start", "A=90", "--duration", "0.01"],
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0 and "np.deg2rad(90) = 1.5708" in ran.stderr
