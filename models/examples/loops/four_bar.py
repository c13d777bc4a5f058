"""
A four-bar
==========

Four hinges, one freedom. The three rows that repeat others are named, the loop stays closed to rounding, and forces
in the pins come with the motion.
"""

import gauss
from gauss import view

scene = gauss.load("four_bar")
system = gauss.compile_scene(scene)
print(gauss.mobility(system))

motion = gauss.simulate(system, 2.0)
residual = system.loop_constraints(motion.q[-1], motion.v[-1])[0]
print("the loop is closed within", abs(residual).max(), "m")
print("ways to assemble it:", len(gauss.assembly_modes(system, keep=["A"])))
force, moment = gauss.reactions(motion, "B")
print("greatest force in pin B:", abs(force).max(), "N")
figure = view.plot_stroboscope(motion, flashes=10)
