"""
Functions of a state
====================

Mass matrix, bias forces, Jacobian: machine code, for one state and for batches. The manipulability of an arm over its
workspace.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

system = gauss.compile_scene(gauss.load("robot:ur5"))
rng = np.random.default_rng(0)
q = rng.uniform(-np.pi, np.pi, (20_000, system.n_q))
v, load = rng.normal(size=(2, *q.shape))

M, h = system.mass_matrix(q), system.bias_forces(q, v)
qdd = system.forward_dynamics(q, v, load)
print("M q̈ + h − τ within", abs(np.einsum("kij,kj->ki", M, qdd) + h - load).max(), "N m")

J = system.jacobian(q, "tool0")
rotation, position = system.forward_kinematics(q, "tool0")
measure = np.sqrt(np.linalg.det(J @ J.transpose(0, 2, 1)).clip(0))
figure = Figure(figsize=(6, 4.5), layout="constrained")
axes = figure.subplots()
drawn = axes.scatter(np.hypot(*position[:, :2].T), position[:, 2], c=measure, s=2)
figure.colorbar(drawn, label="manipulability √det J Jᵀ")
axes.set(xlabel="distance from the axis [m]", ylabel="height [m]", aspect="equal")
