"""
Backlash
========

`mujoco#995 <https://github.com/google-deepmind/mujoco/issues/995>`_ and `#3468
<https://github.com/google-deepmind/mujoco/issues/3468>`_: play in a gear by two hinges and a limit costs a body and a
stiff constraint, and is hard to see. Here it is a link of two joints, whose contacts are located.
"""

import gauss

scene = gauss.Scene("play", gravity=(0, 0, 0))
for name, inertia in (("motor", 0.01), ("load", 0.1)):
    scene.revolute(name, "ground", scene.body(f"rotor of {name}", 1.0, (inertia,) * 3))
scene.elastic_link("teeth", driven="load", driver="motor", stiffness=2e3, damping=1.0, backlash=0.04)
scene.drive("motor", torque=lambda t: 1.0 if t < 0.2 else -1.0)
motion = gauss.simulate(scene, 0.5)
touches = [event.t for event in motion.events if event.kind == "contact"]
print(f"first contact at {touches[0]:.12f} s; by hand √(2 · 0.02 · 0.01 / 1) = {0.0004**0.5:.12f} s")
