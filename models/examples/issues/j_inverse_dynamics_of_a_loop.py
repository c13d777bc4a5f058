"""
Inverse dynamics of a closed chain
==================================

`pinocchio#2356 <https://github.com/stack-of-tasks/pinocchio/issues/2356>`_, `rbdl-orb#31
<https://github.com/ORB-HD/rbdl-orb/issues/31>`_, `EXUDYN#10 <https://github.com/jgerstmayr/EXUDYN/issues/10>`_: the
torque at the input that a motion of the output takes. Here the rocker is led, and the crank pays.
"""

import gauss

led = gauss.load("four_bar")
led.starts.clear()
system = gauss.compile_scene(led)
state = system.initial_state()
free = system.accelerations(state)
crank = system.coordinates.index("A")
pushed = system.accelerations(state, load=[7.0 if k == crank else 0.0 for k in range(system.n_v)])
found = gauss.inverse_dynamics(system, state, pushed, drives=["A"])
print(f"torque found {found.forces[0]:.15f} N m, of 7 that made the motion")
