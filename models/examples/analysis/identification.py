"""
Identification
==============

Masses of a double pendulum from a recorded motion and torques with noise: inverse dynamics are linear in the masses, and
a least-squares problem is left.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

arm = gauss.load("double_pendulum")
system = gauss.compile_scene(arm)
motion = gauss.simulate(system, 3.0, times=np.linspace(0, 3, 301))
names = list(arm.bodies)
regressors = [system.function(f"inverse_dynamics_by:mass:{name}") for name in names]
accelerations = np.array([system.accelerations(motion.state(k)) for k in range(len(motion))])

rng = np.random.default_rng(0)
measured = system.inverse_dynamics(motion.q, motion.v, accelerations) + 0.02 * rng.normal(size=motion.v.shape)
columns = [np.asarray(f(motion.q, motion.v, accelerations)).reshape(len(motion), -1).ravel() for f in regressors]
offset = system.inverse_dynamics(motion.q, motion.v, accelerations).ravel()
true = np.array([arm.bodies[name].mass for name in names])
change, *_ = np.linalg.lstsq(np.column_stack(columns), measured.ravel() - offset, rcond=None)
print("masses", dict(zip(names, (true + change).round(4), strict=True)), "kg; those of the scene", true)
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(motion.t, measured[:, 0], ".", markersize=2, label="measured")
axes.plot(motion.t, offset.reshape(len(motion), -1)[:, 0], label="model")
axes.set(xlabel="t [s]", ylabel="torque of the first joint [N m]")
axes.legend()
