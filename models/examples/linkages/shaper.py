"""
A shaper
========

A quick-return mechanism from a file: slow stroke, fast return, and the torque that cutting takes.
"""

import gauss
from gauss import view

shaper = gauss.load_linkage("shaper")
print(shaper.chain)
cycle = shaper.cycle(shaper.sweep(720))
print("torque from", cycle.torque.min().round(1), "to", cycle.torque.max().round(1), "N m")
figure = view.plot_linkage(cycle)
