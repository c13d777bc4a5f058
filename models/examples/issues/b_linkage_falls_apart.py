"""
A walking linkage that falls apart
==================================

`RigidBodyDynamics.jl#480 <https://github.com/JuliaRobotics/RigidBodyDynamics.jl/issues/480>`_: the constraints of a
walking mechanism of many loops drift apart after four seconds. Here a ladder of ten four-bars, ten loops, swings for
a hundred.
"""

import gauss

scene = gauss.load("n_four_bar", n=10)
motion = gauss.simulate(scene, 100.0, rtol=1e-8, atol=1e-8)
open_by = abs(motion.system.loop_constraints(motion.q, motion.v)[0]).max()
print(f"after 100 s the loops are closed within {open_by:.1e} m")
