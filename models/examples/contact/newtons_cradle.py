"""
Newton's cradle
===============

Five balls with gaps of a tenth of a millimetre, without loss: the shock runs from ball to ball, impact by impact.
"""

import gauss
from gauss import view

motion = gauss.simulate(gauss.load("newtons_cradle"), 2.0, rtol=1e-9, atol=1e-9)
energy = gauss.energy(motion)
print(len(motion.events), "events; energy balance within", abs(energy.balance).max() / energy.scale, "of the energy")
figure = view.plot_coordinates(motion)
