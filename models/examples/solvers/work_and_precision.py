"""
Work and precision
==================

What a digit costs: the double pendulum by each method at several tolerances or steps, beside a reference with
tolerances a thousand times finer.
"""

from matplotlib.figure import Figure

import gauss

pendulum = gauss.compile_scene(gauss.load("double_pendulum"))
reference = gauss.simulate(pendulum, 2.0, rtol=1e-14, atol=1e-14, times=[0.0, 2.0]).q[-1]
settings = {
    "dop853": [{"rtol": 10.0**-k, "atol": 10.0**-k} for k in (4, 6, 8, 10, 12)],
    "dopri5": [{"rtol": 10.0**-k, "atol": 10.0**-k} for k in (4, 6, 8, 10)],
    "rk4": [{"step": step} for step in (1e-2, 3e-3, 1e-3, 3e-4)],
    "gauss6": [{"step": step} for step in (2e-2, 1e-2, 5e-3)],
}
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
for name, all_settings in settings.items():
    runs = [gauss.simulate(pendulum, 2.0, integrator=name, times=[0.0, 2.0], **chosen) for chosen in all_settings]
    errors = [abs(run.q[-1] - reference).max() for run in runs]
    axes.loglog([run.stats.evaluations for run in runs], errors, "o-", label=name)
    print(name, errors)
axes.set(xlabel="evaluations of the accelerations", ylabel="error after 2 s [rad]")
axes.grid(alpha=0.3)
axes.legend()
