"""
A hundred thousand steps
========================

Symplectic methods keep the energy error bounded; a Runge–Kutta method of the same step does not.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

system = gauss.compile_scene(gauss.load("double_pendulum"))
figure = Figure(figsize=(6.5, 4), layout="constrained")
axes = figure.subplots()
for name in ("rk4", "verlet", "gauss4", "energy_momentum"):
    motion = gauss.simulate(system, 400.0, integrator=name, step=4e-3, times=np.linspace(0, 400, 401))
    energy = gauss.energy(motion)
    error = np.maximum.accumulate(abs(energy.balance)) / energy.scale
    print(f"{name:16} {error[-1]:.1e}")
    axes.semilogy(motion.t[1:], error[1:].clip(1e-17), label=name)
axes.set(xlabel="t [s]", ylabel="largest energy error so far, relative")
axes.legend()
axes.grid(alpha=0.3)
