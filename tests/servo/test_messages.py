"""What a servo says when it loses its hold during a motion: which relations, which efforts, which rank, and when."""

import numpy as np
import pytest

import gauss
from gauss import servo
from gauss.errors import SimulationError
from gauss.servo import Cable, Motor, Servo, ServoRelation, Thruster, UnrealisableError
from tests.support import servos

pytestmark = pytest.mark.slow

START, OUTWARDS, SPEED = np.array([1.2, -0.6]), np.array([2.0, -1.0]) / np.sqrt(5.0), 0.3  # of the tip [m, 1, m/s]
REACH = 1.8  # of the arm [m]
LOCATED = 1e-6  # of the time at which the hold is lost by adaptive steps [s]


def _arm_out_of_reach() -> Servo:
    def off(t, motion):
        tip = motion.position("lower", (0.8, 0, 0))
        return [tip[k] - START[k] - SPEED * OUTWARDS[k] * t for k in range(2)]

    return Servo(servos.arm(), [ServoRelation("tip", off)], [Motor("hip", "shoulder"), Motor("knee", "elbow")])


@pytest.mark.parametrize("options", [{}, {"times": np.linspace(0.0, 3.0, 7)}, {"times": [2.9]}, {"integrator": "radau5"}])
def test_an_arm_drawn_out_of_reach(options):
    """Whatever samples are asked for, the loss of rank is named, not the step that it shortens."""
    with pytest.raises(UnrealisableError, match="rank 1 of 2") as caught:
        servo.simulate(_arm_out_of_reach(), 3.0, progress=False, **options)
    message, verdict = str(caught.value), caught.value.verdict
    assert all(name in message for name in ("'tip[0]'", "'tip[1]'", "'hip'", "'knee'"))
    assert verdict.outcome == "rank lost" and verdict.rank == 1 and not verdict
    said = float(message.split("t = ")[1].split(" s")[0])
    assert said == pytest.approx((REACH - np.linalg.norm(START)) / SPEED, abs=LOCATED)


def test_an_arm_stretched_along_a_relation():
    """The row of that relation vanishes, and its direction is no guide: it is named all the same."""

    def off(t, motion):
        tip = motion.position("lower", (0.8, 0, 0))
        return [tip[0] - 1.35 - SPEED * t, tip[1]]

    held = Servo(servos.arm(), [ServoRelation("tip", off)], [Motor("hip", "shoulder"), Motor("knee", "elbow")])
    with pytest.raises(UnrealisableError, match=r"'tip\[0\]'.*rank 1 of 2") as caught:
        servo.simulate(held, 3.0, progress=False)
    assert caught.value.verdict.outcome == "rank lost" and caught.value.verdict.rank == 1


def test_an_effort_that_turns_round():
    """A thruster on a disk that turns loses its hold at π/2, where its singular value is one on either side."""
    scene = gauss.Scene("turning", gravity=(0, 0, 0))
    for name in ("carriage", "disk"):
        scene.body(name, 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("rail", "ground", "carriage", axis=(1, 0, 0))
    scene.revolute("turn", "carriage", "disk", axis=(0, 0, 1))
    scene.start("turn", 0.0, 1.0)
    place = ServoRelation("place", lambda t, motion: motion.position("carriage")[0] - 0.5 * t * t)
    held = Servo(scene, [place], [Thruster("jet", "disk", force=(1, 0, 0), axes="body")])
    with pytest.raises(UnrealisableError, match="t = 1.5707963.*'place'.*'jet'") as caught:
        servo.simulate(held, 3.0, progress=False)
    assert "singular value" not in str(caught.value)  # none is small
    assert caught.value.verdict.outcome == "rank lost"


def test_a_cable_that_would_push_is_said_with_the_time():
    held = servos.crane_servo(lambda t: 0.0 * t, lambda t: -3.0 - 2.0 * t**3)
    with pytest.raises(SimulationError, match="t = 0.8175 s: .*'rope'"):
        servo.simulate(held, 3.0, progress=False)


def _hung(fall):
    scene = gauss.Scene("hung", gravity=(0, 0, -servos.G))
    scene.body("load", 5.0)
    scene.prismatic("z", "ground", "load", axis=(0, 0, 1))
    height = ServoRelation("height", lambda t, motion: motion.position("load")[2] + 1.0 + 0.5 * fall * t * t)
    return Servo(scene, [height], [Cable("rope", "load", "ground", other_at=(0, 0, 3))])


def test_a_tension_of_rounding_is_none():
    """A load let down as it falls needs no tension: what rounding leaves of m (g − g) is no push, whatever its sign."""
    state = servo.initial_state(_hung(servos.G), None)
    for share in (0.0, 1e-14, -1e-14, 1e-12):
        found = servo.solve(_hung(servos.G * (1.0 + share)), state)
        assert abs(found.effort("rope")) <= 1e-9 * 5.0 * servos.G
    with pytest.raises(SimulationError, match="t = 0 s: .*'rope'"):
        servo.solve(_hung(servos.G * (1.0 + 1e-6)), state)
