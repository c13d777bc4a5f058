"""
An environment for learning
===========================

A thousand cart-poles in one vector environment of Gymnasium, moved by random actions. Needs the extra ``gym``.
"""

import numpy as np
from matplotlib.figure import Figure

import gauss.gym

environment = gauss.gym.MechanismVectorEnv(gauss.gym.cart_pole_swing_up(), 1000)
observations, _ = environment.reset(seed=0)
rng = np.random.default_rng(0)
rewards = []
for _ in range(50):
    actions = rng.uniform(-1, 1, environment.action_space.shape).astype(np.float32)
    observations, reward, terminated, truncated, _ = environment.step(actions)
    rewards.append(reward.mean())
print("observations", observations.shape, "mean reward", np.mean(rewards))
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(rewards)
axes.set(xlabel="step", ylabel="mean reward of random actions")
