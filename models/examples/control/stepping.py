"""
Steps from Python
=================

A loop of your own: a simulator is stepped, looked at, put back to a snapshot, and stepped again, to the last bit.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

scene = gauss.load("cart_pole")
scene.input("push", "rail", limits=20.0)
scene.output("angle", "coordinate", "pin")
simulator = gauss.Simulator(scene, step=1e-3)
angles, before = [], None
for k in range(200):
    q, v = simulator.state.q, simulator.state.v
    simulator.step([1.0 * q[0] + 31.7 * q[1] + 2.35 * v[0] + 6.14 * v[1]], n=10)
    angles.append(float(simulator.outputs["angle"]))
    before = simulator.snapshot() if k == 99 else before
end = simulator.state.q.copy()
simulator.restore(before)
for _ in range(100):
    q, v = simulator.state.q, simulator.state.v
    simulator.step([1.0 * q[0] + 31.7 * q[1] + 2.35 * v[0] + 6.14 * v[1]], n=10)
print("the same again:", np.array_equal(end, simulator.state.q))
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(np.arange(1, 201) * 0.01, angles)
axes.set(xlabel="t [s]", ylabel="angle of the pole [rad]")
