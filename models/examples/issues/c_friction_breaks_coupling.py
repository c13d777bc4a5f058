"""
Friction that breaks a coupling
===============================

`mujoco#2430 <https://github.com/google-deepmind/mujoco/issues/2430>`_: friction in one of two coupled joints lets the
other move on alone. Here friction and coupling are decided together: both stand, or both move.
"""

import gauss

scene = gauss.Scene("coupled joints", gravity=(0, 0, 0))
for name in ("A", "B"):
    scene.revolute(name, "ground", scene.body(f"wheel {name}", mass=1.0, inertia=(0.1, 0.1, 0.1)))
scene.couple("belt", driven="B", driver="A", ratio=1.0)
scene.joint_friction("B", limit=5.0)
scene.drive("A", torque=lambda t: 4.0 * t)  # exceeds the friction after 1.25 s
motion = gauss.simulate(scene, 2.0)
apart = abs(motion.coordinate("A") - motion.coordinate("B")).max()
print(f"apart by {apart:.1e} rad; they start at {motion.events[-1].t:.6f} s")
