"""
A bouncing ball
===============

Impacts by Newton's law, located within the steps: after infinitely many of them in a finite time the ball lies still.
"""

import gauss
from gauss import view

scene = gauss.Scene("bouncing ball")
ball = scene.body("ball", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(0, 0, 1.0))
scene.free("F", "ground", ball, at=(0, 0, 1.0))
scene.sphere("round", ball, radius=0.25)
scene.half_space("floor")
scene.contact("bounce", "round", "floor", restitution=0.7)

motion = gauss.simulate(scene, 3.0, rtol=1e-10, atol=1e-12)
impacts = [event.t for event in motion.events if event.kind == "impact"]
first = (2 * 0.75 / 9.81) ** 0.5
print(len(impacts), "impacts; the first", abs(impacts[0] - first), "s from √(2 h / g)")
print("rests with", gauss.contact_forces(motion, "bounce")[-1], "N")
figure = view.plot_energy(motion)
