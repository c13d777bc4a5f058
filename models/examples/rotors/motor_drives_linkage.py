"""
A motor that drives a linkage
=============================

A rotor network put into a scene: an induction motor with its gear turns the crank of a four-bar. How even does it
run?
"""

import numpy as np

import gauss
from gauss import rotors, view

train = rotors.Network("train")
motor, crank = train.shaft("motor", 0.02), train.shaft("crank shaft", 0.3)
train.gear("gear", driven=crank, driver=motor, ratio=12.0)
train.torque(motor, rotors.Kloss(M_k=20.0, s_k=0.2, omega_0=105.0))

scene = gauss.load("four_bar")
scene.starts.clear()
rotors.to_scene(train, scene, on={"crank shaft": "A"})
motion = gauss.simulate(scene, 4.0, rtol=1e-8, atol=1e-8, times=np.linspace(0, 4, 801))
late = motion.rate("A")[motion.t > 3.0]
print("crank at", late.mean(), "rad/s, uneven by", np.ptp(late) / late.mean())
figure = view.plot_speeds(motion)
