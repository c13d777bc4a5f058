"""Parts of a function that are alike go in the lanes of a vector register: found where they are, and right."""

import numpy as np
import pytest

import gauss
from gauss.codegen import schedule, trace, write
from gauss.codegen.superword import superword_groups
from gauss.dynamics.mechanism import forward_dynamics
from tests.support import mechanisms

ROUNDING = 1e-13  # relative, of a small mechanism's accelerations
WIDTH = 8


def _several(count: int) -> gauss.Scene:
    """So many chains of different rods on one ground; the kinds of their joints are the same."""
    scene, rng = gauss.Scene("several", gravity=(0.3, -9.8, 1.0)), np.random.default_rng(1)
    for i in range(count):
        previous = "ground"
        for k in range(3):
            name, at = f"link{i}.{k}", rng.normal(size=3)
            scene.body(name, 1.0 + rng.random(), mechanisms.inertia(rng), rng.normal(size=3), on=previous, position=at)
            scene.revolute(f"joint{i}.{k}", previous, name, axis=rng.normal(size=3), frame=name)
            previous = name
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3, 5, 9])
def test_alike_mechanisms_share_their_instructions(count):
    system = gauss.compile_scene(_several(count))
    n = system.n_v
    dynamics = lambda q, v, f: forward_dynamics(system, q, v, f)  # noqa: E731
    groups = superword_groups(schedule(write(dynamics, n, n, n)), WIDTH)
    assert sum(map(len, groups)) == (count if count in (2, 3, 5) else 8 if count == 9 else 0)
    x = np.random.default_rng(count).uniform(-3, 3, 3 * n)
    expected = dynamics(*np.split(x, 3)).astype(float)
    found = trace(dynamics, n, n, n, batch=False)(x)
    assert np.abs(found - expected).max() <= ROUNDING * np.abs(expected).max()


def test_every_operation_side_by_side():
    """Two parts that differ in constants, a comparison that is an output among their operations."""

    def one(x, y, a, b):
        larger = x < a * y
        chosen = gauss.math.where(larger, a / (1.0 + x * x), b - y)
        rest = gauss.math.maximum(np.sqrt(np.abs(x)), -y) + np.arctan2(x, y) * b - np.exp(-np.abs(a * x))
        return [larger, chosen, rest + np.sin(x) * np.cos(a + y), np.log(b + x * x) - gauss.math.minimum(x, a)]

    def both(x):
        return np.array([*one(x[0], x[1], 0.7, 1.3), *one(x[2], x[3], -0.4, 2.5)])

    assert [len(group) for group in superword_groups(schedule(write(both, 4)), WIDTH)] == [2]
    kernel = trace(both, 4)
    for x in np.random.default_rng(0).uniform(-2, 2, (50, 4)):
        assert np.abs(kernel(x) - both(x).astype(float)).max() <= ROUNDING * 10
        assert np.abs(kernel(np.repeat(x[:, None], 9, axis=1)) - kernel(x)[:, None]).max() <= ROUNDING * 10


def test_parts_that_share_something_are_not_taken_apart():
    assert not superword_groups(schedule(write(lambda x: np.array([x[0] * np.sin(x[2]), x[1] * np.sin(x[2])]), 3)), WIDTH)
