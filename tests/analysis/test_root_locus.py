import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SceneError

pytestmark = pytest.mark.slow

MASS, STIFFNESS = 2.0, 8.0


def oscillator():
    scene = gauss.Scene("oscillator", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("cart", MASS))
    scene.joint_spring("spring", "x", stiffness=STIFFNESS, damping=0.0)
    return scene


def test_branches_of_a_damped_oscillator():
    """λ² + (d/m) λ + k/m = 0: below critical damping on the circle of radius √(k/m), beyond it real."""
    damping = np.linspace(0.5, 12.0, 24)
    found = gauss.root_locus(oscillator(), "spring.damping", damping)
    for d, row in zip(damping, found.eigenvalues, strict=True):
        wanted = np.roots([MASS, d, STIFFNESS])
        np.testing.assert_allclose(np.sort_complex(row), np.sort_complex(wanted), atol=1e-6)
    assert set(found.stability) == {"stable"}
    assert np.abs(np.diff(found.eigenvalues[damping < 7.0], axis=0)).max() < 1.0  # branches do not change places


def test_a_loop_and_bad_input():
    scene = gauss.load("four_bar")
    found = gauss.root_locus(scene, "gravity.y", [-9.81, -8.0])
    np.testing.assert_allclose(found.eigenvalues[1] ** 2 / found.eigenvalues[0] ** 2, 8.0 / 9.81, rtol=1e-6)
    with pytest.raises(ArgumentError, match="numbers"):
        gauss.root_locus(scene, "gravity.y", [])
    with pytest.raises(SceneError, match="mass"):
        gauss.root_locus(scene, "coupler.mas", [1.0])
