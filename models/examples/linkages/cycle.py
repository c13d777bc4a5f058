"""
A cycle of a four-bar
=====================

Positions in closed form, the driving torque and all pin forces over a turn, in one call.
"""

import numpy as np

import gauss
from gauss import view

bar = gauss.Linkage("four-bar", gravity=(0, -9.8))
bar.link("crank", mass=1.2, inertia=0.016, com=(0.2, 0))
bar.link("coupler", mass=3.0, inertia=0.25, com=(0.5, 0))
bar.link("rocker", mass=2.2, inertia=0.09, com=(0.35, 0))
bar.revolute("A", "ground", "crank")
bar.revolute("B", "crank", "coupler", at=(0.4, 0))
bar.revolute("C", "rocker", "coupler", at=(0.7, 0), child_at=(1.0, 0))
bar.revolute("D", "ground", "rocker", at=(1.2, 0))
bar.drive("A", speed=10.0)
bar.load("rocker", moment=-100.0)

print(bar.chain, bar.grashof(), bar.least_transmission())
cycle = bar.cycle(np.linspace(0, 2 * np.pi, 721))
print(
    "greatest torque", cycle.torque.max(), "N m; work of a turn", bar.work()[-1], "J; flywheel", bar.flywheel(0.02).inertia
)
figure = view.plot_linkage(cycle)
