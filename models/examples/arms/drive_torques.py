"""
Torques of a prescribed motion
==============================

Joints are driven along given angles, exactly, and gauss tells the torques that this takes: inverse dynamics along a
motion.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss
from gauss import math

scene = gauss.load("robot:ur5")
joints = [joint.name for joint in scene.joints.values() if joint.pair.n_v]
for k, name in enumerate(joints):
    scene.drive(name, angle=lambda t, k=k: (0.3 + 0.1 * k) * (1.0 - math.cos((1.0 + 0.2 * k) * t)))

motion = gauss.simulate(scene, 4.0, times=np.linspace(0, 4, 201))
figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
for name in joints:
    torque = gauss.drive_forces(motion, name)
    axes.plot(motion.t, torque, label=name)
    print(f"{name:22} {abs(torque).max():7.2f} N m")
axes.set(xlabel="t [s]", ylabel="torque [N m]")
axes.legend()
axes.grid(alpha=0.3)
