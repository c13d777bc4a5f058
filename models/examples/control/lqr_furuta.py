"""
LQR of a Furuta pendulum
========================

A pendulum on a driven arm, balanced upright: linear model, Riccati equation, nonlinear motion.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.Scene("furuta", gravity=(0, 0, -9.81))
arm = scene.body("arm", 0.3, (1e-4, 2e-3, 2e-3), com=(0.1, 0, 0))
rod = scene.body("rod", 0.1, (7e-4, 7e-4, 1e-6), com=(0, 0, 0.15), position=(0.2, 0, 0))
scene.revolute("turn", "ground", arm, axis=(0, 0, 1))
scene.revolute("tilt", arm, rod, at=(0.2, 0, 0), axis=(1, 0, 0))
scene.input("torque", "turn", limits=2.0)

upright = gauss.linearise(scene)
print("poles of the pendulum:", upright.eigenvalues.round(3))
Q, R = np.diag([1.0, 10.0, 0.1, 0.1]), np.eye(1)
K = upright.lqr(Q, R)
print("poles under the law:", np.linalg.eigvals(upright.A - upright.B @ K).round(3))

scene.start("tilt", 0.2)
motion = gauss.simulate(scene, 5.0, control=lambda t, q, v: -K @ np.concatenate([q, v]), rate=200, rtol=1e-8, atol=1e-8)
print("state at the end", motion.q[-1], motion.v[-1])
figure = view.plot_coordinates(motion)
