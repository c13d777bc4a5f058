"""
A hinge that closes a loop
==========================

`pinocchio#2729 <https://github.com/stack-of-tasks/pinocchio/issues/2729>`_: three rows are too loose for the four-bar
in a knee, six too stiff; five are meant. Here a hinge has five rows wherever it stands, and inverse dynamics go
through the loop.
"""

import gauss

system = gauss.compile_scene(gauss.load("four_bar"))  # the hinge D closes the loop
state = system.initial_state()
found = gauss.inverse_dynamics(system, state, system.accelerations(state), drives=["A"])
print(f"freedoms: {gauss.mobility(system).freedoms}; torque of the free motion: {abs(found.forces[0]):.1e} N m")
