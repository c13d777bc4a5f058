"""
A cable robot
=============

A platform on cables, which can only pull: tensions are chosen among many, and stay positive or are refused.
"""

import gauss
from gauss import servo, view

robot = gauss.load("servo/cable_robot")
print(servo.realisable(robot))
run = servo.simulate(robot, duration=2.0)
print("least tension", run.efforts.min(), "N")
figure = view.plot_tracking(run)
