"""Motion subspaces of kinematic pairs in the axes of the child, and their rates, against those in the axes of the parent."""

import numpy as np
import pytest

from gauss import rotations
from gauss.scene import PAIRS

ROUNDING = 1e-14
DIFFERENCED, STEP = 1e-9, 1e-5  # central differences


def _random(pair, rng) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and rates."""
    q = rng.normal(size=pair.n_q)
    if pair.quaternion is not None:
        q[pair.quaternion :] /= np.linalg.norm(q[pair.quaternion :])
    return q, rng.normal(size=pair.n_v)


def _moved(pair, q, change) -> np.ndarray:
    if pair.quaternion is None:
        return q + change
    k = pair.quaternion
    turned = rotations.multiply(q[k:], rotations.exponential(change[k:]))
    return np.concatenate([q[:k] + change[:k], turned])


@pytest.mark.parametrize("kind", PAIRS)
def test_the_subspace_on_the_child_is_that_on_the_parent_turned(kind):
    pair, rng = PAIRS[kind], np.random.default_rng(0)
    for _ in range(5):
        q, _ = _random(pair, rng)
        R, _ = pair.pose(q)
        for own, other in zip(pair.subspace_on_child(q), pair.subspace(q), strict=True):
            np.testing.assert_allclose(own, R.T @ other, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("kind", PAIRS)
def test_the_bias_is_the_rate_of_the_subspace(kind):
    pair, rng = PAIRS[kind], np.random.default_rng(1)
    for _ in range(5):
        q, v = _random(pair, rng)
        after, before = (pair.subspace(_moved(pair, q, sign * STEP * v)) for sign in (1.0, -1.0))
        for bias, one, other in zip(pair.subspace_bias(q, v), after, before, strict=True):
            np.testing.assert_allclose(bias, (one - other) @ v / (2 * STEP), rtol=0.0, atol=DIFFERENCED)
