"""
A crane that carries its load along a path
==========================================

Two forces, on the trolley and on the hoist, move the load; the rope must be pulled aside before the load can be
accelerated. The relation is of relative degree 4, and is held exactly.
"""

import gauss
from gauss import servo, view

crane = gauss.load("servo/crane")
print(servo.realisable(crane))
tracking = servo.simulate(crane, duration=8.0)
print("the path is kept within", abs(tracking.residuals).max(), "m")
figure = view.plot_tracking(tracking)
