"""
When does a double pendulum flip?
=================================

Sixteen hundred starts in one call, in SIMD lanes; the time of the first flip of the second arm over the starts.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

system = gauss.compile_scene(gauss.load("n_pendulum", n=2))
one, other = np.meshgrid(np.linspace(-3, 3, 40), np.linspace(-3, 3, 40))
starts = np.column_stack([one.ravel(), other.ravel()])
many = gauss.rollout(system, starts, np.zeros_like(starts), steps=2000, step=2.5e-3, every=10)
flipped = abs(many.q[:, :, 1]) > np.pi
first = np.where(flipped.any(axis=1), flipped.argmax(axis=1) * 0.025, np.nan)
print("flipped within five seconds:", int(flipped.any(axis=1).sum()), "of", len(starts))
figure = Figure(figsize=(5.5, 4.5), layout="constrained")
axes = figure.subplots()
drawn = axes.pcolormesh(one, other, first.reshape(one.shape), shading="nearest")
figure.colorbar(drawn, label="first flip [s]")
axes.set(xlabel="first angle [rad]", ylabel="second angle [rad]", aspect="equal")
