"""
Bouncing equality constraints
=============================

`mujoco#278 <https://github.com/google-deepmind/mujoco/issues/278>`_: a linkage closed by an equality constraint
bounces open when it is moved quickly. Here a hinge closes the loop, and stays closed to rounding at any speed.
"""

import gauss

scene = gauss.load("four_bar")
scene.start("A", rate=200.0)  # thirty turns a second
motion = gauss.simulate(scene, 1.0)
open_by = abs(motion.system.loop_constraints(motion.q, motion.v)[0]).max()
print(f"the loop opens by {open_by:.1e} m")
