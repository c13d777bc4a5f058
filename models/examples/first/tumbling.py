"""
A tumbling body
===============

Rotation about the middle axis of inertia is unstable: a free body flips over again and again. Its angular momentum in
space stays.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.Scene("wing nut", gravity=(0, 0, 0))
scene.body("nut", mass=1.0, inertia=(0.010, 0.022, 0.028))
scene.free("F", "ground", "nut")
scene.start("F", rate=(0, 0, 0, 1e-3, 6.0, 0))

motion = gauss.simulate(scene, 20.0, rtol=1e-10, atol=1e-10, times=np.linspace(0, 20, 801))
system = motion.system
momentum = system.momentum(motion.q, motion.v)[:, :3]
print("angular momentum changes by", abs(momentum - momentum[0]).max(), "of", np.linalg.norm(momentum[0]))
turns = [state.t for state in gauss.crossings(motion, lambda at: at.rotation("nut")[1, 1])]
print("it lies across at", np.round(turns, 3), "s")
figure = view.plot_speeds(motion)
