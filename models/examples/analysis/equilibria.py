"""
Equilibria of a four-bar
========================

All states of rest, which of them are stable, and how the linkage swings about the stable ones.
"""

import gauss
from gauss import view

bar = gauss.load("four_bar")
bar.starts.clear()
resting = gauss.equilibria(bar)
for rest in resting:
    modes = rest.model.modes()
    print(f"crank at {rest.state.q[0]:7.4f} rad, {rest.energy:8.4f} J, {rest.stability:8}", modes.frequencies.round(4), "Hz")

bar.start("A", position=float(min(resting, key=lambda rest: rest.energy).state.q[0]) + 0.2)
motion = gauss.simulate(bar, 2.0, rtol=1e-9, atol=1e-9)
figure = view.plot_phase(motion, joints=["A"])
