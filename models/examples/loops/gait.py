"""
A gait with the least effort
============================

Hoeken's four-bar as a leg: one turn of the crank is a step. When should the motor push, so that a step of one second takes
the least ∫ u² dt? The loop is closed at every point of the mesh. Needs the extra ``export`` (CasADi with IPOPT).
"""

import numpy as np
from matplotlib.figure import Figure

import gauss

A, B, D = np.zeros(3), np.array([0.1, 0.0, 0.0]), np.array([-0.2, 0.0, 0.0])
half = np.linalg.norm(B - D) / 2.0
C = (B + D) / 2.0 + [0.0, 0.0, -np.sqrt(0.25**2 - half**2)]  # 0.25 m from both
foot = 2.0 * C - B
scene = gauss.Scene("Hoeken's leg")
for name, ends, mass in (("crank", (A, B), 0.3), ("leg", (B, foot), 1.0), ("rocker", (D, C), 0.5)):
    length = np.linalg.norm(ends[1] - ends[0])
    scene.body(name, mass, (mass * length**2 / 12,) * 3, com=(ends[1] - ends[0]) / 2.0, position=ends[0])
for name, parent, child, at in (
    ("A", "ground", "crank", A),
    ("B", "crank", "leg", B),
    ("C", "leg", "rocker", C),
    ("D", "ground", "rocker", D),
):
    scene.revolute(name, parent, child, at=at, axis=(0, 1, 0))
scene.frame("foot", "leg", position=foot - B)
scene.joint_spring("bearing", "A", damping=0.05)
scene.input("motor", "A", limits=5.0)

gait = gauss.optimal_motion(scene, 1.0, start={"A": 0.0}, periodic={"A": 2 * np.pi}, intervals=24, tolerance=1e-5)
print(gait)
turn = (gait.q[-1] - gait.q[0]) / (2 * np.pi)
print("turns of the joints", turn.round(6), "; the rates end as they began:", np.allclose(gait.v[-1], gait.v[0], atol=1e-5))
motion = gait.simulate(rtol=1e-8, atol=1e-8, times=np.linspace(0, 1, 201))
path = motion.body("foot").position
print("step length", np.ptp(path[:, 0]).round(3), "m; work of the motor", motion.work[-1, 0].round(4), "J")

figure = Figure(figsize=(7, 3.5), layout="constrained")
left, right = figure.subplots(1, 2)
left.plot(motion.t, gait.law(motion.t), label="motor [N m]")
left.plot(gait.t, gait.v[:, 0] / 10, ".-", label="crank [10 rad/s]")
left.set(xlabel="t [s]")
left.legend()
right.plot(path[:, 0], path[:, 2])
right.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="path of the foot")
