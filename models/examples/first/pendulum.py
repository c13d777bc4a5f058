"""
A pendulum
==========

One body on one hinge, its motion and the force in the hinge, which grows to nearly three times the weight.
"""

import gauss
from gauss import view

scene = gauss.Scene("pendulum")
bob = scene.body("bob", mass=2.0, inertia=(0.01, 0.01, 0.01), com=(0, 0, -1.0))
scene.revolute("hinge", "ground", bob, axis=(0, 1, 0))
scene.start("hinge", position=1.5)  # [rad]

trajectory = gauss.simulate(scene, duration=3.0)
force, moment = gauss.reactions(trajectory, "hinge")
print("greatest force over weight:", abs(force[:, 2]).max() / (2.0 * 9.81))
print("energy balance within", abs(gauss.energy(trajectory).balance).max(), "J")
figure = view.plot_motion(trajectory)
