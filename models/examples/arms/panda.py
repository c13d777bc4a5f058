"""
A Panda, dropped
================

A robot of a URDF file, its joints held inside their limits by stops, let go from rest. Needs the package
example-robot-data.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.load("robot:panda", mimic=False, limits="stops")
scene.start("panda_joint2", position=0.8)
scene.start("panda_joint4", position=-1.5)
scene.start("panda_joint6", position=1.5)
motion = gauss.simulate(scene, 1.0, rtol=1e-7, atol=1e-7)

print("impacts on stops:", sum(event.kind == "impact" for event in motion.events))
for joint in scene.joints.values():
    if joint.limits is not None:
        low, high = joint.limits
        q = motion.coordinate(joint.name)
        assert low - 1e-6 <= q.min() and q.max() <= high + 1e-6, joint.name
print("all joints stay within", np.ptp(motion.q, axis=0).round(2), "rad, inside their limits")
figure = view.plot_stroboscope(motion, flashes=8, plane="xz")
