"""Laws of poses are traced where their values agree with the trace, also where they vanish at the reference."""

import pytest

import gauss
from gauss.dynamics.laws.traced_laws import Laws


def _hanging(law, n: int = 140) -> gauss.System:
    """Chain that hangs at both ends, with a torque that depends on the height of its middle, 0 but for round-off."""
    scene = gauss.load("hung_chain", n=n)
    hinges = [joint.name for joint in scene.joints.values() if joint.kind == "revolute"]
    body = list(scene.bodies)[n // 2]
    scene.drive(hinges[n // 2], torque=lambda t, at: law(at.position(body)[0]))
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, traced",
    [
        (lambda x: 0.1 * x, True),
        (lambda x: 0.1 * x if isinstance(x, float) else 0.2 * x, False),  # of its type: numbers give another law
        (lambda x: 0.1 * x if isinstance(x, float) else 0.1 * x + 1e-9, False),
    ],
)
def test_laws_that_vanish_at_the_reference_are_compared_beside_it(law, traced):
    laws = Laws(_hanging(law))
    assert bool(laws.traced) == traced and bool(laws.reasons) != traced


def test_keys_of_laws_are_those_of_their_operations():
    one, same, other = (Laws(_hanging(law, 12)).key for law in (lambda x: 0.1 * x, lambda x: x * 0.1, lambda x: 0.2 * x))
    assert one == same != other
