"""
A rolling disk
==============

A thin disk rolls without slipping: a nonholonomic constraint, without friction law and without loss.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

motion = gauss.simulate(gauss.load("rolling_disk"), 6.0, rtol=1e-10, atol=1e-10, times=np.linspace(0, 6, 601))
energy = gauss.energy(motion)
print("energy balance within", abs(energy.balance).max(), "J of", energy.scale, "J")
name = next(iter(motion.system.scene.bodies))
path = motion.body(name).com
figure = Figure(figsize=(5, 4.5), layout="constrained")
axes = figure.subplots()
drawn = axes.scatter(path[:, 0], path[:, 1], c=motion.t, s=4)
figure.colorbar(drawn, label="t [s]")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="path of the centre")
