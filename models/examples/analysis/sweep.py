"""
A sweep
=======

A hundred four-bars that differ in mass and speed, moved together; the result is one labelled array. Needs the extra
``sweep``.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

swept = gauss.sweep(
    gauss.load("four_bar"),
    {"rocker.mass": np.linspace(1.0, 6.0, 10), "A.rate": np.linspace(4.0, 12.0, 10)},
    duration=1.0,
    samples=51,
    progress=False,
)
turned = swept.q.sel(coordinate="A").isel(time=-1)
print(turned.dims, float(turned.min()), float(turned.max()))
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
drawn = axes.pcolormesh(swept["A.rate"], swept["rocker.mass"], turned.transpose("rocker.mass", "A.rate").values)
figure.colorbar(drawn, label="crank after one second [rad]")
axes.set(xlabel="speed at the start [rad/s]", ylabel="mass of the rocker [kg]")
