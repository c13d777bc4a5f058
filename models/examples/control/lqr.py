"""
LQR of a cart-pole
==================

The linear model about the upright, a Riccati equation, and the nonlinear motion under the law that comes of it.
"""

import numpy as np
from scipy.linalg import solve_continuous_are

import gauss
from gauss import view

scene = gauss.load("cart_pole")
scene.input("push", "rail", limits=30.0)
upright = gauss.compile_scene(scene).state(np.zeros(2), np.zeros(2))
model = gauss.linearise(scene, upright)
print("poles of the cart-pole:", np.linalg.eigvals(model.A).round(3))

Q, R = np.diag([1.0, 10.0, 1.0, 1.0]), np.eye(1)
K = np.linalg.solve(R, model.B.T @ solve_continuous_are(model.A, model.B, Q, R))
print("poles under the law:", np.linalg.eigvals(model.A - model.B @ K).round(3))

scene.start("pin", 0.4)
motion = gauss.simulate(scene, 5.0, control=lambda t, q, v: -K @ np.concatenate([q, v]), rate=100, rtol=1e-8, atol=1e-8)
print("state at the end", motion.q[-1], motion.v[-1])
figure = view.plot_coordinates(motion)
