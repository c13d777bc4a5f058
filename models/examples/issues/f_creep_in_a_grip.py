"""
Creep in a grip
===============

`mujoco#3328 <https://github.com/google-deepmind/mujoco/issues/3328>`_: a capsule between two pads sinks by 50 to 2300
µm/s, though friction could carry twenty times its weight. Here it sticks.
"""

import gauss

scene = gauss.Scene("grip")
scene.body("capsule", 0.045, (1e-5, 1e-5, 1e-6))
scene.free("F", "ground", "capsule")
scene.capsule("hull", "capsule", radius=0.004, length=0.06, axis=(0, 1, 0))
for side in (1.0, -1.0):
    pad = scene.body(f"pad {side}", 0.1, (1e-4, 1e-4, 1e-4), position=(0.014 * side, 0, 0))
    scene.prismatic(f"slide {side}", "ground", pad, at=(0.014 * side, 0, 0), axis=(side, 0, 0))
    scene.box(f"face {side}", pad, size=(0.02, 0.08, 0.04))
    scene.drive(f"slide {side}", force=-30.0)
    scene.contact(f"grip {side}", "hull", f"face {side}", friction=0.7)
motion = gauss.simulate(scene, 1.0, integrator="time_stepping", step=1e-3)
print(f"sinks by {1e6 * abs(motion.body('capsule').position[-1, 2]):.1e} µm in a second")
