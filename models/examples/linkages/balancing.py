"""
Balancing
=========

Counterweights on crank and rocker take away the shaking force of a four-bar altogether.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss
from gauss.linkages import shaking

bar = gauss.load_linkage("four_bar")
weights = bar.counterweights("crank", "rocker")
print(weights)
balanced = bar
for name, moment in weights.moments.items():
    balanced = balanced.with_counterweight(name, moment, radius=0.2)

angles = np.linspace(0, 2 * np.pi, 361)
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
for label, linkage in (("as it is", bar), ("balanced", balanced)):
    force = np.linalg.norm(shaking(linkage.cycle(angles)).force, axis=1)
    print(f"{label:10} {np.ptp(force):10.3g} N")
    axes.plot(np.rad2deg(angles), force, label=label)
axes.set(xlabel="crank angle [°]", ylabel="shaking force [N]")
axes.legend()
axes.grid(alpha=0.3)
