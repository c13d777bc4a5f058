from gauss.gym.environment import MechanismEnv
from gauss.gym.task import Task
from gauss.gym.tasks import acrobot, cart_pole_swing_up, four_bar_press
from gauss.gym.vector_environment import MechanismVectorEnv

__all__ = [
    "MechanismEnv",
    "MechanismVectorEnv",
    "Task",
    "acrobot",
    "cart_pole_swing_up",
    "four_bar_press",
]
