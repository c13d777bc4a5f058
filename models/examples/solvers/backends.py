"""
QP backends side by side
========================

The compulsion of an instant, solved by a dozen methods. The certificate says what each answer is worth; the error is
beside the recursion.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

system = gauss.compile_scene(gauss.load("four_bar"))
compulsion = gauss.assemble(system, system.initial_state())
exact = gauss.solve(compulsion, backend="recursion")
names, errors, certified = ("kkt", "schur", "nullspace", "sparse", "proximal", "osqp", "clarabel", "piqp", "daqp"), [], []
for name in names:
    found = gauss.solve(compulsion, backend=name)
    certified.append(found.certificate.error)
    errors.append(max(abs(found.qdd - exact.qdd).max() / abs(exact.qdd).max(), 1e-17))
    print(f"{name:10} {str(found.status)[:30]:30} certificate {certified[-1]:8.1e}  error {errors[-1]:8.1e}")
figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
axes.bar(np.arange(len(names)) - 0.2, errors, 0.4, label="error")
axes.bar(np.arange(len(names)) + 0.2, certified, 0.4, label="certificate")
axes.set_yscale("log")
axes.set_xticks(range(len(names)), names, rotation=30)
axes.legend()
