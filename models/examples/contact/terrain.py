"""
Terrain
=======

Balls roll over hills: a height field, two triangles a cell, with friction. What rolls does not slip, and loses energy
only where it bounces, meets another ball, or crosses an edge of the surface.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

x, y = np.meshgrid(np.linspace(-2, 2, 61), np.linspace(-1.5, 1.5, 46))
heights = 0.08 * (np.cos(3 * x) + np.cos(4 * y)) + 0.15 * x**2
scene = gauss.Scene("balls on hills")
scene.height_field("land", "ground", heights, size=(4, 3))  # [m]
for k, start in enumerate((-0.6, 0.1, 0.7)):
    ball = scene.body(f"ball{k}", mass=1.0, inertia=(0.001, 0.001, 0.001))
    scene.free(f"F{k}", "ground", ball)
    scene.sphere(f"round{k}", ball, radius=0.05)
    scene.start(f"F{k}", position=(1.5, start, 0.6, 1, 0, 0, 0))
scene.contacts_all(friction=0.6)

motion = gauss.simulate(scene, 2.0, integrator="time_stepping", step=2e-3)
print(motion)
figure = Figure(figsize=(6, 4.5), layout="constrained")
axes = figure.subplots()
figure.colorbar(axes.contourf(x, y, heights, 20, cmap="Greens_r"), label="height [m]")
for k in range(3):
    path = motion.body(f"ball{k}").com
    print(f"ball {k} ends at", path[-1].round(3), "m")
    axes.plot(path[:, 0], path[:, 1], color="black", lw=1.2)
    axes.plot(*path[-1, :2], "o", color="white", ms=5, mec="black")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="paths of three balls")
