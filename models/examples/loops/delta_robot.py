"""
A delta robot
=============

Three arms, three parallelograms, a platform that does not turn. It is held by torques at the hips, found by statics.
"""

import numpy as np

import gauss
from gauss import view

scene = gauss.load("delta_robot")
system = gauss.compile_scene(scene)
mobility = gauss.mobility(system)
print("freedoms by rank:", mobility.freedoms)

held = gauss.equilibrium(scene, keep=["hip1", "hip2", "hip3"])
print("torques that hold it:", {name: round(torque, 4) for name, torque in held.forces.items()}, "N m")

for k in (1, 2, 3):
    scene.joint_spring(f"servo{k}", f"hip{k}", stiffness=3.0, damping=0.02)
scene.start("hip1", rate=4.0)
motion = gauss.simulate(scene, 0.6, rtol=1e-8, atol=1e-8)
turned = motion.body("platform").rotation[-1]
print("the platform turned by", abs(turned - np.eye(3)).max())
figure = view.plot_stroboscope(motion, flashes=6, plane="xz")
