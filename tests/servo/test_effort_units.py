"""Units of efforts: those whose product with the rate of their direction is a power."""

import gauss
from gauss import servo


def test_units_of_the_shipped_servos():
    assert gauss.load("servo/crane").effort_units == ("N", "N")
    assert gauss.load("servo/inverted_pendulum").effort_units == ("N",)
    assert gauss.load("servo/line_arm").effort_units == ("N m",)
    assert set(gauss.load("servo/cable_robot").effort_units) == {"N"}


def test_a_thruster_multiplies_its_force():
    lean = servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin"), unit="rad")
    jet = servo.Thruster("jet", "cart", force=(1.0, 0.0, 0.0))
    assert servo.Servo(gauss.load("cart_pole"), [lean], [jet]).effort_units == ("1",)


def test_units_of_a_support_follow_the_order_of_its_joints():
    scene, lean = gauss.load("cart_pole"), servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin"))
    held = servo.Servo(scene, [lean], [servo.AuxiliarySupport("support", ("pin", "rail"))])
    assert dict(zip(held.efforts, held.effort_units, strict=True)) == {"support.pin": "N m", "support.rail": "N"}
