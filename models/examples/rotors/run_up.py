"""
Run-up of a mill
================

An induction motor, a gear with losses and a belt that slips by its characteristic. Every change is located and
reported.
"""

from gauss import rotors, view

mill = rotors.Network("mill")
motor, shaft, drum = mill.shaft("motor", 0.25), mill.shaft("shaft", 0.6), mill.shaft("drum", 4.0)
mill.gear("gear", driven=shaft, driver=motor, ratio=1.5, efficiency=0.97)
mill.friction_drive("belt", driven=drum, driver=shaft, ratio=2.0, curve=(300.0, 6.0, 0.02), efficiency=0.98)
mill.torque(motor, rotors.Kloss(M_k=180.0, s_k=0.15, omega_0=157.0))
mill.torque(drum, rotors.Dry(60.0))

print(rotors.explain(mill))
run = rotors.simulate(mill, duration=6.0)
print("run-up time", rotors.run_up_time(run, "drum"), "s; energy balance", abs(run.energy().balance).max(), "J")
print([(point.speed("drum"), point.stable) for point in rotors.operating_points(mill)])
drawing = view.draw_network(mill)
figure = view.plot_rotors(run)
