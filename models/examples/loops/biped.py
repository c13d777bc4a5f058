"""
A biped on both feet
====================

A humanoid of a URDF file that stands with both feet on the ground has a loop through the ground. It crouches under
gravity, joints damped. Needs the package example-robot-data.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.load("robot:simple_humanoid", root="free")
for link in ("l_ankle", "r_ankle"):
    scene.fixed(f"ground {link}", "ground", link)
for joint in [joint for joint in scene.joints.values() if joint.pair.n_v == 1]:
    scene.joint_spring(f"muscle of {joint.name}", joint, stiffness=150.0, damping=15.0)

system = gauss.compile_scene(scene)
print(gauss.mobility(system))
motion = gauss.simulate(system, 0.5, rtol=1e-6, atol=1e-6, times=np.linspace(0, 0.5, 51))
for foot in ("l_ankle", "r_ankle"):
    force, moment = gauss.reactions(motion, f"ground {foot}")
    print(foot, "carries", abs(force[-1, 2]).round(1), "N")
figure = view.plot_stroboscope(motion, flashes=5, plane="xz")
