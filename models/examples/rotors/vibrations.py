"""
Torsional vibrations
====================

An elastic shaft between a motor and a fan: eigenfrequencies of the drive train.
"""

import numpy as np
from matplotlib.figure import Figure

from gauss import rotors

train = rotors.Network("train")
motor, gear, fan = train.shaft("motor", 0.05), train.shaft("gear", 0.02), train.shaft("fan", 1.2)
train.spring("coupling", driven=gear, driver=motor, stiffness=4e3, damping=0.5)
train.spring("shaft", driven=fan, driver=gear, ratio=3.0, stiffness=9e3, damping=1.0)
modes = rotors.eigenmodes(train)
print(rotors.mode_table(modes))
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
frequencies = np.sort(np.asarray(modes.frequencies))
axes.bar(range(len(frequencies)), frequencies)
axes.set(xlabel="mode", ylabel="frequency [Hz]")
