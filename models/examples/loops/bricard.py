"""
Bricard's linkage
=================

Six bars and six hinges along the edges of a cube: by counting it cannot move, in fact it can. Redundant rows are
named, and do no harm.
"""

import gauss
from gauss import view

scene = gauss.load("bricard")
system = gauss.compile_scene(scene)
mobility = gauss.mobility(system)
print("freedoms by counting:", mobility.counted, " by rank:", mobility.freedoms)

motion = gauss.simulate(system, 10.0)  # the IFToMM benchmark A04
energy = gauss.energy(motion)
print("energy balance within", abs(energy.balance).max(), "J of", energy.scale, "J")
figure = view.plot_stroboscope(motion, flashes=9)
