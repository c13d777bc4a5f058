"""
A sampled controller with a state
=================================

A PI law in plain Python, called a hundred times a second; its value is held in between. It keeps its integral by
itself.
"""

import numpy as np

import gauss
from gauss import view


class PI:
    """Proportional and integral feedback of an angle."""

    def __init__(self, goal, k_p, k_i, period):
        self.goal, self.k_p, self.k_i, self.period, self.integral = goal, k_p, k_i, period, 0.0

    def __call__(self, t, q, v):
        """Torque (1,) [N m]."""
        error = self.goal - q[0]
        self.integral += self.period * error
        return [self.k_p * error + self.k_i * self.integral - 2.0 * v[0]]


scene = gauss.Scene("arm with a load")
arm = scene.body("arm", mass=2.0, inertia=(0.05, 0.05, 0.01), com=(0.4, 0, 0))
scene.revolute("hinge", "ground", arm, axis=(0, -1, 0))
scene.input("motor", "hinge", limits=30.0)
motion = gauss.simulate(scene, 6.0, control=PI(0.7, 20.0, 30.0, 0.01), rate=100, rtol=1e-7, atol=1e-7)
print("angle at the end", motion.coordinate("hinge")[-1], "rad; 0.7 was asked for")
assert np.isclose(motion.coordinate("hinge")[-1], 0.7, atol=1e-2)
figure = view.plot_motion(motion)
