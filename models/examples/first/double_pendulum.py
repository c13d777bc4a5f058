"""
A double pendulum, twice
========================

Two starts that differ by a millionth of a radian part after some seconds. Each of the motions is right to many more
digits than that.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

times = np.linspace(0.0, 15.0, 1501)
motions = []
for offset in (0.0, 1e-6):
    scene = gauss.Scene("double pendulum", gravity=(0, -9.81, 0))
    for k, parent in enumerate(("ground", "rod1"), 1):
        scene.body(f"rod{k}", 1.0, (1e-3, 1 / 12, 1 / 12), com=(0.5, 0, 0), position=(k - 1.0, 0, 0))
        scene.revolute(f"J{k}", parent, f"rod{k}", at=(k - 1.0, 0, 0))
    scene.start("J1", position=1.2 + offset)
    motions.append(gauss.simulate(scene, 15.0, times=times))

apart = abs(motions[0].coordinate("J2") - motions[1].coordinate("J2"))
print("apart by one radian after", times[np.argmax(apart > 1.0)], "s")
figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
axes.semilogy(times, apart)
axes.set(xlabel="t [s]", ylabel="difference of the second angle [rad]", title="chaos, not error")
axes.grid(alpha=0.3)
