"""Units of efforts: those whose product with the rate of their direction is a power."""

import gauss
from gauss import servo
from gauss.servo.effort_units import effort_units


def test_units_of_the_shipped_servos():
    assert effort_units(gauss.load("servo/crane")) == ("N", "N")
    assert effort_units(gauss.load("servo/inverted_pendulum")) == ("N",)
    assert effort_units(gauss.load("servo/line_arm")) == ("N m",)
    assert set(effort_units(gauss.load("servo/cable_robot"))) == {"N"}


def test_a_thruster_multiplies_its_force():
    lean = servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin"), unit="rad")
    jet = servo.Thruster("jet", "cart", force=(1.0, 0.0, 0.0))
    assert effort_units(servo.Servo(gauss.load("cart_pole"), [lean], [jet])) == ("1",)
