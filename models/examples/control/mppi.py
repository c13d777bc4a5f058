"""
Sampling MPC
============

MPPI (Williams, Aldrich, Theodorou, J. Guidance 40, 2017) swings up a cart-pole; ``panda`` after it: a Panda reaches.
"""

import sys
from dataclasses import replace

import numpy as np

import gauss
from gauss import view


class Mppi:
    def __init__(self, scene, cost, rows=50, samples=4096, rate=50.0, substeps=4, temperature=0.05, device=None):
        self.system, self.cost, self.shape = gauss.compile_scene(scene), cost, (samples, rows, len(scene.inputs))
        self.run = {"steps": rows * substeps, "step": 1.0 / (rate * substeps), "every": substeps, "threads": None}
        self.run["device"] = device
        self.high = np.array([given.bounds[1] for given in scene.inputs.values()])
        self.plan, self.temperature, self.rng = np.zeros(self.shape[1:]), temperature, np.random.default_rng(0)

    def __call__(self, t, q, v):
        noise = 0.5 * self.high * self.rng.standard_normal(self.shape)
        control = np.clip(self.plan + noise, -self.high, self.high)
        starts = np.tile(q, (len(noise), 1)), np.tile(v, (len(noise), 1))
        found = gauss.rollout(self.system, *starts, control=control, **self.run)
        cost = self.cost(found.q, found.v).mean(axis=1) + 0.01 * np.mean((control / self.high) ** 2, axis=(1, 2))
        cost[list(found.diverged)] = np.inf
        weights = np.exp(-(cost - cost.min()) / (self.temperature * np.median(cost - cost.min())))
        self.plan = np.tensordot(weights / weights.sum(), control, axes=1)
        first, self.plan = self.plan[0], np.concatenate([self.plan[1:], self.plan[-1:]])
        return first


def cart_pole():  # scene, cost, duration [s]: swing up in the middle of the rail
    scene = gauss.load("cart_pole")
    scene.start("pin", np.pi)
    scene.input("push", "rail", limits=20.0)
    return scene, lambda q, v: 1.0 - np.cos(q[..., 1]) + 0.2 * q[..., 0] ** 2 + 0.01 * v[..., 1] ** 2, 4.0


def panda():
    """Scene, cost, and duration [s]: reach a pose of the joints, with gravity compensated."""
    scene = replace(gauss.load("robot:panda", mimic=False), gravity=(0.0, 0.0, 0.0))
    moving = (joint for joint in scene.joints.values() if joint.pair.n_v)
    for joint, limit in zip(moving, [30.0] * 4 + [4.0] * 3 + [0.5] * 2, strict=True):
        scene.input(f"motor of {joint.name}", joint, limits=limit)
    goal = np.array([0.4, -0.6, 0.3, -2.0, 0.2, 1.6, 0.5, 0.02, 0.02])
    return scene, lambda q, v: ((q - goal) ** 2).sum(axis=-1) + 0.02 * (v**2).sum(axis=-1), 2.0


if __name__ == "__main__":
    scene, cost, duration = panda() if "panda" in sys.argv else cart_pole()
    law = Mppi(scene, cost, samples=256)
    motion = gauss.simulate(law.system, duration, control=law, rate=50, integrator="rk4", step=5e-3)
    print("cost", cost(motion.q, motion.v)[[0, -1]])
    figure = view.plot_coordinates(motion)
