"""
A pole that leans as it is told
===============================

The angle of a pole on a cart follows a law of time. The motor pushes the cart, not the pole: a servo-constraint.
"""

import numpy as np

import gauss
from gauss import servo, view

lean = servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin") - 0.3 * np.sin(2 * t), unit="rad")
held = servo.Servo(gauss.load("cart_pole"), [lean], [servo.Motor("motor", "rail")])
run = servo.simulate(held, duration=3.0)
print("force at the end", run.effort("motor")[-1], "N; the relation is kept within", abs(run.residual("lean")).max(), "rad")
print("work of the servo", servo.energy(run).servos[-1], "J")
figure = view.plot_tracking(run)
