"""
Pick and place with a delta robot
=================================

Inverse kinematics of a mechanism with loops: hip angles for points of the platform, a path within limits of speed and
acceleration, and the torques of the hips that it takes.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

system = gauss.compile_scene(gauss.load("delta_robot"))
hips = ["hip1", "hip2", "hip3"]
places = [(-0.1, 0.0, -0.38), (-0.1, 0.0, -0.3), (0.1, 0.05, -0.3), (0.1, 0.05, -0.38)]
points = [gauss.PointTarget("platform", place) for place in places]

found = gauss.inverse_kinematics(system, points[0])
angles = {name: round(float(found.state.q[system.joint(name).q][0]), 4) for name in hips}
print("reached:", found.reached, "hip angles:", angles, "rad")

far = gauss.inverse_kinematics(system, gauss.PointTarget("platform", (0.6, 0.0, -0.3)), limits={"hip1": (-0.6, 1.2)})
print("too far:", far.reason)

path = gauss.plan_path(system, points, speed=0.6, acceleration=6.0, coordinates=hips, start=found.state, samples=10)
times = np.linspace(path.begin, path.end, 60)
states = path.states(system, times, start=found.state)
torques = [gauss.inverse_dynamics(system, s, path.accelerations(system, s), hips).forces for s in states]
print(f"the path takes {path.duration:.3f} s, and at most {np.abs(torques).max():.2f} N m")

motion = path.trajectory(system, times, start=found.state)
place = motion.body("platform").position
figure = Figure(figsize=(8, 3.5), layout="constrained")
left, right = figure.subplots(1, 2)
left.plot(place[:, 0], place[:, 2])
left.set(xlabel="x [m]", ylabel="z [m]", title="platform")
right.plot(times, torques, label=hips)
right.set(xlabel="t [s]", ylabel="torque [N m]")
right.legend()
for axes in (left, right):
    axes.grid(alpha=0.3)
