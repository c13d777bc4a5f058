"""
LQR of a four-bar press
=======================

A loop of one freedom on its crank: the linear model has two states, whatever the number of joints, and the law holds the
press in the pose in which it would fall.
"""

import numpy as np
from scipy.linalg import solve_continuous_are

import gauss
from gauss import view

scene = gauss.load("four_bar")
scene.input("torque", "A")
rest = next(one for one in gauss.equilibria(scene) if one.stability == "unstable")
model = gauss.linearise(scene, rest.state, independent=["A"])
print(f"states {model.states}; poles of the press: {model.eigenvalues.round(3)}")
Q, R = np.diag([100.0, 1.0]), np.eye(1) * 1e-3
K = np.linalg.solve(R, model.B.T @ solve_continuous_are(model.A, model.B, Q, R))
print("poles under the law:", np.linalg.eigvals(model.A - model.B @ K).round(3))

system = gauss.compile_scene(scene)
crank = system.column("A")
start = system.projected(system.state(rest.state.q + 0.1 * model.displacements[:, 0], np.zeros(system.n_v)))


def law(t, q, v):
    """Torque of the crank."""
    return -K @ [q[crank] - rest.state.q[crank], v[crank]]


motion = gauss.simulate(system, 3.0, state=start, control=law, rate=200, rtol=1e-8, atol=1e-8)
print("distance from the pose at the end", np.abs(motion.q[-1] - rest.state.q).max())
figure = view.plot_coordinates(motion)
