"""Accelerations and motions as functions of JAX, with derivatives of our own: ``jax.custom_vjp`` about callbacks.

Machine code of gauss computes values, the adjoint equations the gradients; under ``jax.jit`` both are callbacks. For a
function of JAX alone, which accelerators run, see :func:`gauss.export.to_jax`.
"""

from collections.abc import Callable

import numpy as np

from gauss.analysis.sensitivity.differentiable import DifferentiableDynamics, DifferentiableMotion
from gauss.errors import extra
from gauss.scene import Scene
from gauss.system import System


def jax_dynamics(system: System | Scene) -> Callable:
    """Accelerations of a system as a differentiable function of JAX.

    Parameters
    ----------
    system : System or Scene
        The system.

    Returns
    -------
    callable
        (q, v, load) → accelerations, arrays (…, n_q), (…, n_v), (…, n_v) → (…, n_v), for ``jit``, ``vmap`` and ``grad``.

    Raises
    ------
    MissingPackageError
        If JAX is not installed.

    Examples
    --------
    >>> import gauss
    >>> accelerations = gauss.jax_dynamics(gauss.load("cart_pole"))
    """
    own = DifferentiableDynamics(system)
    return _function(own, lambda q, v, load: v.shape)


def jax_motion(system: System | Scene, duration: float, *, step: float, integrator: str = "rk4") -> Callable:
    """Motion of a system as a differentiable function of JAX.

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
        (q, v, inputs) → states (steps + 1, n_q + n_v); inputs (steps, n_u) are held in each step. For ``jit``, ``vmap`` and
        ``grad``.

    Raises
    ------
    MissingPackageError
        If JAX is not installed.
    SimulationError
        If the system has no smooth dynamics between events, by the names of its elements.

    Examples
    --------
    >>> import gauss
    >>> motion = gauss.jax_motion(gauss.load("cart_pole"), 1.0, step=0.01)
    """
    own = DifferentiableMotion(system, duration, step, integrator)
    return _function(own, lambda q, v, inputs: (own.steps + 1, q.shape[-1] + v.shape[-1]))


def _function(own: DifferentiableDynamics | DifferentiableMotion, shape: Callable) -> Callable:
    """Function of JAX of a value and a pullback."""
    with extra("jax"):
        import jax

    def arrays(given) -> list[np.ndarray]:
        return [np.asarray(one, dtype=float) for one in given]

    def called(function, results, *given):
        return jax.pure_callback(function, results, *given, vmap_method="sequential")

    @jax.custom_vjp
    def value(*given):
        result = jax.ShapeDtypeStruct(shape(*given), given[0].dtype)
        return called(lambda *x: own.value(*arrays(x)).astype(result.dtype), result, *given)

    def pullback(given, weights):
        results = tuple(jax.ShapeDtypeStruct(one.shape, one.dtype) for one in given)

        def found(*x):
            parts = zip(own.pullback(*arrays(x)), results, strict=True)
            return tuple(part.astype(like.dtype) for part, like in parts)

        return called(found, results, *given, weights)

    value.defvjp(lambda *given: (value(*given), given), pullback)
    return lambda *given: value(*(jax.numpy.asarray(one) for one in given))
