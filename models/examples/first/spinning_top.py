"""
A heavy top
===========

A symmetric top on its tip, spun at 60 rad/s: it nods and precesses. A symplectic method keeps its energy for as long
as one likes.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

scene = gauss.Scene("heavy top")
scene.body("top", mass=1.0, inertia=(0.05, 0.05, 0.05), com=(0, 0, 0.5))
scene.ball("tip", "ground", "top")
scene.frame("crown", "top", position=(0, 0, 1.0))
tilt = np.pi / 3
scene.start("tip", position=(np.cos(tilt / 2), 0, np.sin(tilt / 2), 0), rate=(0, 0, 60.0))

motion = gauss.simulate(scene, 5.0, integrator="gauss6", step=1e-3)
crown = motion.body("crown").position
energy = gauss.energy(motion)
print("energy balance within", abs(energy.balance).max() / energy.scale, "of the energy")

figure = Figure(figsize=(5, 5), layout="constrained")
axes = figure.subplots(subplot_kw={"projection": "3d"})
axes.plot(*crown.T, linewidth=0.8)
axes.plot([0, crown[-1, 0]], [0, crown[-1, 1]], [0, crown[-1, 2]], linewidth=3)
axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="path of the crown")
