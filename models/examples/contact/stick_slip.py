"""
Stick and slip
==============

A mass on a spring that is pulled to and fro over a rough surface: at each turn it sticks, and slips again, exactly.
"""

import numpy as np

import gauss
from gauss import math, view

scene = gauss.Scene("stick-slip", gravity=(0, 0, 0))
sled = scene.body("sled", mass=0.1, inertia=(0.01, 0.01, 0.01))
mass = scene.body("mass", mass=1.0, inertia=(0.01, 0.01, 0.01), position=(-0.5, 0, 0))
scene.prismatic("pull", "ground", sled)
scene.prismatic("rail", "ground", mass)
scene.drive("pull", displacement=lambda t: 0.2 * math.sin(2.0 * t))
scene.spring("spring", mass, sled, stiffness=30.0, damping=0.5, length=0.5)
scene.joint_friction("rail", limit=1.5)

motion = gauss.simulate(scene, 6.0, rtol=1e-9, atol=1e-9)
changes = [(event.kind, round(event.t, 4)) for event in motion.events]
print(changes[:6])
resting = abs(motion.rate("rail")) == 0.0
print("at rest, to the last bit, in", int(np.count_nonzero(resting)), "of", len(motion), "samples")
figure = view.plot_coordinates(motion)
