"""
Synthesis of a coupler curve
============================

Lengths of a four-bar whose coupler point passes through eight given points, by least squares: a cycle takes so little
time that it can be called hundreds of times.
"""

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import gauss

angles = np.linspace(0.0, 2 * np.pi, 9)[:-1]
wanted = np.column_stack([0.55 + 0.22 * np.cos(angles + 0.4), 0.42 + 0.12 * np.sin(angles + 0.4)])


def curve(x, at=angles):
    """Coupler point (k, 2) of the crank angles."""
    crank, coupler, rocker, base, along, across, turned = x
    bar = gauss.Linkage("candidate")
    for name in ("crank", "coupler", "rocker"):
        bar.link(name)
    bar.revolute("A", "ground", "crank")
    bar.revolute("B", "crank", "coupler", at=(crank, 0))
    bar.revolute("C", "rocker", "coupler", at=(rocker, 0), child_at=(coupler, 0))
    bar.revolute("D", "ground", "rocker", at=(base, 0))
    bar.drive("A")
    return bar.cycle(at + turned).point("coupler", (along, across)).position


start = [0.2, 0.9, 0.7, 0.9, 0.5, 0.3, 0.0]
low, high = [0.05, 0.5, 0.4, 0.6, -1, -1, -3], [0.25, 1.5, 1.5, 1.2, 1.5, 1.5, 3]  # a crank that turns round
found = least_squares(lambda x: (curve(x) - wanted).ravel(), start, bounds=(low, high), x_scale=0.3, max_nfev=60)
print("lengths", found.x[:4].round(3), "m; distance from the points", 1e3 * np.sqrt(np.mean(found.fun**2)).round(4), "mm")

figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
axes.plot(*curve(start, np.linspace(0, 2 * np.pi, 200)).T, ":", label="start")
axes.plot(*curve(found.x, np.linspace(0, 2 * np.pi, 200)).T, label="found")
axes.plot(*wanted.T, "o", label="wanted")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
axes.legend()
