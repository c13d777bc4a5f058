"""
Dominoes
========

Boxes with friction, in time steps: the first is tipped, the others follow.
"""

import gauss
from gauss import view

scene = gauss.Scene("dominoes")
scene.half_space("floor")
size = (0.02, 0.06, 0.12)
for k in range(6):
    stone = scene.body(f"stone{k}", 0.1, (1.5e-4, 1.2e-4, 3e-5), position=(0.05 * k, 0, 0.06))
    scene.free(f"F{k}", "ground", stone, at=(0.05 * k, 0, 0.06))
    scene.box(f"box{k}", stone, size=size)
scene.contacts_all(friction=0.4)
scene.start("F0", rate=(0, 0, 0, 0, 6.0, 0))

motion = gauss.simulate(scene, 1.0, integrator="time_stepping", step=1e-3)
tilt = [motion.body(f"stone{k}").rotation[-1, 2, 2] for k in range(6)]
print("fallen:", sum(cosine < 0.9 for cosine in tilt), "of 6;", motion.stats.plan.dynamics)
figure = view.plot_stroboscope(motion, flashes=6, plane="xz")
