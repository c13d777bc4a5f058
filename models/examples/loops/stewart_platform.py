"""
A Stewart platform
==================

Six legs, each a Cardan joint, a slider and a ball: five loops. The platform is led along a path, and the leg forces
are asked for.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

scene = gauss.load("stewart_platform", stiffness=0.001)
system = gauss.compile_scene(scene)
print(gauss.mobility(system))

state = system.initial_state()
legs = [f"leg{k}" for k in range(1, 7)]
sway = np.zeros(system.n_v)
found = gauss.inverse_dynamics(system, state, sway, legs)
weight = 9.81 * sum(body.mass for name, body in scene.bodies.items() if name == "platform" or name.startswith("rod"))
print("leg forces at rest:", found.forces.round(2), "N, unique:", found.is_unique)

for name in legs:
    scene.joint_spring(f"servo of {name}", name, stiffness=2e4, damping=400.0)
motion = gauss.simulate(scene, 0.6, rtol=1e-8, atol=1e-8, times=np.linspace(0, 0.6, 121))
figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
for name in legs:
    axes.plot(motion.t, 1e3 * motion.coordinate(name), label=name)
axes.set(xlabel="t [s]", ylabel="displacement [mm]", title=f"settling under {weight:.0f} N")
axes.legend()
axes.grid(alpha=0.3)
