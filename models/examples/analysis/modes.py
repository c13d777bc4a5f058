"""
Modes of a platform on springs
==============================

Six frequencies of a Stewart platform, loops and all: a linear model in independent coordinates.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

scene = gauss.load("stewart_platform", stiffness=2e5)
rest = gauss.equilibrium(scene)
modes = rest.model.modes()
frequencies = np.sort(modes.frequencies[modes.frequencies > 1e-3])
print("frequencies", frequencies.round(3), "Hz;", rest.stability)
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
axes.bar(range(1, 1 + len(frequencies)), frequencies)
axes.set(xlabel="mode", ylabel="frequency [Hz]")
