"""Accelerations and motions as functions of PyTorch, with derivatives of our own: ``torch.autograd.Function``.

Machine code of gauss computes values, the adjoint equations the gradients; tensors are copied to numpy and back, in double
precision on the CPU.
"""

from collections.abc import Callable

import numpy as np

from gauss.analysis.sensitivity.differentiable import DifferentiableDynamics, DifferentiableMotion
from gauss.errors import MissingPackageError
from gauss.scene import Scene
from gauss.system import System


def torch_dynamics(system: System | Scene) -> Callable:
    """Accelerations of a system as a differentiable function of PyTorch.

    Parameters
    ----------
    system : System or Scene
        The system.

    Returns
    -------
    callable
        (q, v, load) → accelerations, tensors (…, n_q), (…, n_v), (…, n_v) → (…, n_v).

    Raises
    ------
    MissingPackageError
        If PyTorch is not installed.

    Examples
    --------
    >>> import gauss
    >>> accelerations = gauss.torch_dynamics(gauss.load("cart_pole"))
    """
    return _function(DifferentiableDynamics(system))


def torch_motion(system: System | Scene, duration: float, *, step: float, integrator: str = "rk4") -> Callable:
    """Motion of a system as a differentiable function of PyTorch.

    Parameters
    ----------
    system : System or Scene
        The system; impacts, stick and slip are events, see :func:`gauss.sensitivities`.
    duration, step : float
        Duration, a whole number of steps, and step [s].
    integrator : str
        "rk4", "dopri5" or "dop853".

    Returns
    -------
    callable
        (q, v, inputs) → states (steps + 1, n_q + n_v); inputs (steps, n_u) are held in each step.

    Raises
    ------
    MissingPackageError
        If PyTorch is not installed.
    SimulationError
        If the system has no smooth dynamics between events, by the names of its elements.

    Examples
    --------
    >>> import gauss
    >>> motion = gauss.torch_motion(gauss.load("cart_pole"), 1.0, step=0.01)
    """
    return _function(DifferentiableMotion(system, duration, step, integrator))


def _function(own: DifferentiableDynamics | DifferentiableMotion) -> Callable:
    """Function of PyTorch of a value and a pullback."""
    try:
        import torch
    except ImportError:
        raise MissingPackageError("torch_dynamics and torch_motion need PyTorch: pip install torch") from None

    def arrays(tensors) -> list[np.ndarray]:
        return [tensor.detach().cpu().to(torch.float64).numpy() for tensor in tensors]

    class Own(torch.autograd.Function):
        @staticmethod
        def forward(context, *given):
            context.save_for_backward(*given)
            return torch.from_numpy(own.value(*arrays(given))).to(given[0])

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(context, weights):
            given = context.saved_tensors
            found = own.pullback(*arrays(given), *arrays([weights]))
            return tuple(
                torch.from_numpy(np.ascontiguousarray(part)).to(one) for part, one in zip(found, given, strict=True)
            )

    return Own.apply
