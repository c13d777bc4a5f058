"""
Computed torque
===============

A control law of the whole arm, sampled at 500 Hz: inverse dynamics cancel what the arm does by itself, and a damped
oscillator is left.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.load("robot:ur5")
for joint in [joint for joint in scene.joints.values() if joint.pair.n_v]:
    scene.input(f"motor of {joint.name}", joint, limits=150.0)  # [N m]
model = gauss.compile_scene(scene)
goal = np.array([0.5, -1.2, 1.0, -0.8, 0.6, 0.3])


def law(t, q, v):
    """Efforts (6,) [N m]."""
    return model.inverse_dynamics(q, v, 36.0 * (goal - q) - 12.0 * v)


motion = gauss.simulate(model, 2.0, control=law, rate=500, rtol=1e-7, atol=1e-7)
print("distance from the goal:", abs(motion.q[-1] - goal).max(), "rad")
figure = view.plot_coordinates(motion)
