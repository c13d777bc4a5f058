"""
Stiction of a joint
===================

`drake#18932 <https://github.com/RobotLocomotion/drake/issues/18932>`_: dry friction in joints, asked for since 2023;
regularised models creep under a load below the limit. Here an arm that friction can hold moves
by no more than rounding.
"""

import gauss

scene = gauss.Scene("arm with friction")
scene.revolute("A", "ground", scene.body("arm", 1.0, (0.1, 0.1, 0.1), com=(0.5, 0, 0)), axis=(0, 1, 0))
scene.joint_friction("A", limit=5.0)  # its weight asks for 4.905 N m
motion = gauss.simulate(scene, 60.0)
print(f"moved by {abs(motion.coordinate('A')).max()} rad in a minute")
print(f"friction {gauss.set_valued_forces(motion, 'friction of A')[-1]} N m")
