from gauss.io.gym.environment import MechanismEnv
from gauss.io.gym.task import Task
from gauss.io.gym.tasks import acrobot, cart_pole_swing_up, four_bar_press
from gauss.io.gym.vector_environment import MechanismVectorEnv

__all__ = [
    "MechanismEnv",
    "MechanismVectorEnv",
    "Task",
    "acrobot",
    "cart_pole_swing_up",
    "four_bar_press",
]
