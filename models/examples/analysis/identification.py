"""
Identification
==============

Masses, inertias and friction of a crank-slider from torques of its crank with noise: the base parameters that forces
determine, with confidence intervals, and a scene with the found values.
"""

import numpy as np

import gauss

engine = gauss.load("slider_crank")
print(gauss.base_parameters(engine, friction=["A"]))
system = gauss.compile_scene(engine)
motion = gauss.simulate(system, 1.0, times=np.linspace(0, 1, 401))

rng = np.random.default_rng(0)
turns = rng.uniform(-1.0, 1.0, (401, 1)) * motion.v  # other rates in the same positions
loads = np.zeros_like(motion.v)
loads[:, 0] = 20.0 * rng.standard_normal(401)
accelerations = system.forward_dynamics(motion.q, turns, loads)
friction = 0.3 * turns[:, 0] + 0.5 * np.sign(turns[:, 0])
torque = loads[:, 0] + friction + 0.1 * rng.standard_normal(401)

found = gauss.identify(engine, motion.q, turns, accelerations, {"A": torque}, independent=["A"], friction=["A"])
print(found)
print("friction", found.parameters["viscous:A"], "N m s,", found.parameters["coulomb:A"], "N m; true: 0.3, 0.5")
other = gauss.compile_scene(found.scene)  # with the found masses, inertias and friction
figure = found.plot()
