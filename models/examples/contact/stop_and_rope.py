"""
A rope that goes slack
======================

A bob on a rope swings past the horizontal, flies on a parabola, and is caught again; events tell when.
"""

import gauss
from gauss import view

motion = gauss.simulate(gauss.load("slack_rope"), 3.0, rtol=1e-9, atol=1e-9)
print([(event.kind, round(event.t, 5), round(event.loss, 4)) for event in motion.events][:5])
figure = view.plot_stroboscope(motion, flashes=24, plane="xy")
