"""
Swing-up with the least effort
==============================

The cart and pole of Kelly (An introduction to trajectory optimization, SIAM Review 59, 2017): upright, and a metre to the
side, within two seconds. Needs the extra ``export`` (CasADi with IPOPT).
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

scene = gauss.Scene("cart-pole of Kelly")
cart, pole = scene.body("cart", 1.0, (0.1, 0.1, 0.1)), scene.body("pole", 0.3, (0, 0, 0), com=(0, 0, -0.5))
scene.prismatic("rail", "ground", cart, axis=(1, 0, 0))
scene.revolute("pin", cart, pole, axis=(0, -1, 0))
scene.input("push", "rail", limits=20.0)
system = gauss.compile_scene(scene)

start, end = system.state([0, 0], [0, 0]), system.state([1.0, np.pi], [0, 0])
swing = gauss.optimal_motion(system, 2.0, start=start, end=end, limits={"rail": 2.0})
print(swing)
print("intervals and errors of the meshes:", swing.meshes)
motion = swing.simulate(rtol=1e-9, atol=1e-9)
print("simulated with these inputs, it ends at", motion.q[-1].round(5))

times = np.linspace(0.0, 2.0, 401)
figure = Figure(figsize=(6, 4), layout="constrained")
upper, lower = figure.subplots(2, 1, sharex=True)
upper.plot(swing.t, swing.q, ".-", label=["rail [m]", "pin [rad]"])
upper.legend()
lower.plot(times, swing.law(times))
lower.set(xlabel="t [s]", ylabel="push [N]")
