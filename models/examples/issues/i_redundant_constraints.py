"""
Redundant constraints
=====================

`EXUDYN#39 <https://github.com/jgerstmayr/EXUDYN/issues/39>`_: a planar mechanism built of spatial joints stops the
solver with a singular Jacobian. Here redundant rows are solved with, and named.
"""

import gauss

scene = gauss.load("parallelogram")
scene.starts.clear()
scene.start("A1", position=0.5, rate=3.0)
system = gauss.compile_scene(scene)
print(gauss.mobility(system))
energy = gauss.energy(gauss.simulate(system, 5.0))
print(f"energy balance within {abs(energy.balance).max() / energy.scale:.1e}")
