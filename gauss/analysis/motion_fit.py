"""Fit of whole motions: parameters of a scene whose motion is nearest to a measured one, min Σ ((y_k − y(t_k; p)) / σ)².

Gauss–Newton steps in a trust region (scipy.optimize.least_squares) with exact derivatives of the computed steps; the
covariance is (Jᵀ J)⁻¹ in units of the noise (Bard, Nonlinear Parameter Estimation, 1974; Schittkowski, Numerical Data
Fitting in Dynamical Systems, 2002). Impacts, stops, stick and slip are events between smooth phases.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from gauss.analysis.event_fit import EventFitProblem
from gauss.analysis.fit_problem import FitProblem
from gauss.analysis.fitted_motion import MotionFit
from gauss.arguments import named_arguments
from gauss.errors import ArgumentError, require
from gauss.scene import Scene


@named_arguments
def fit_motion(
    scene: Scene,
    times,
    measured: Mapping[str, Sequence[float]],
    parameters: Mapping[str, float] | Sequence[str],
    *,
    step: float,
    inputs=None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    noise=None,
    confidence: float = 0.95,
    integrator: str = "rk4",
) -> MotionFit:
    """Parameters of a scene whose motion is nearest to a measured one.

    Parameters
    ----------
    scene : Scene
        The scene; it moves from its start. Through impacts, stops, stick and slip the parameters are masses, centres of
        mass, gravity, constants of loads, restitution ("floor.restitution"), places of stops, limits of friction, and the
        start.
    times : array_like, shape (k,)
        Increasing times of the samples [s]; the motion starts at the first.
    measured : mapping of str to array_like, shape (k,)
        Measured coordinates, as "A", and rates, as "A rate".
    parameters : mapping of str to float, or sequence of str
        Names as for :func:`gauss.sweep`, with first values, or those of the scene: "rod.mass", "rod.com.x", "B.at[0]",
        "spring.stiffness", "gravity.z"; "A.position" and "A.rate" of the start.
    step : float
        Largest step of the integrator [s]; with events the samples lie on whole multiples of it.
    inputs : array_like, shape (k − 1, n_u), optional
        Inputs held between samples, in the order of the scene; zero when not given.
    bounds : mapping of str to (float, float), optional
        Least and largest values; masses, lengths and radii stay positive without.
    noise : array_like, shape (n,), optional
        Standard deviation of each column of ``measured``; from the residual when not given.
    confidence : float
        Probability of the confidence intervals.
    integrator : str
        "rk4", "dopri5" or "dop853".

    Returns
    -------
    MotionFit
        Values, confidence intervals, residuals; ``print`` shows a table, ``plot`` a figure, ``scene`` the found scene.

    Raises
    ------
    ArgumentError
        If an argument does not fit.
    SceneError
        If a parameter is no number of the scene.
    SimulationError
        If the scene has no smooth dynamics in machine code, by the names of its elements.
    StateError
        If the motion does not identify some parameters, by their names, is not finite at the first values, or the fit does
        not converge.

    Examples
    --------
    >>> import gauss, numpy as np
    >>> true = gauss.load("pendulum")
    >>> t = np.linspace(0.0, 1.0, 51)
    >>> angle = gauss.simulate(true, 1.0, times=t).q[:, 0]
    >>> fit = gauss.fit_motion(true, t, {"A": angle}, {"gravity.y": -9.0, "A.rate": 0.1}, step=0.01)
    >>> bool(abs(fit.values["gravity.y"] + 9.81) < 1e-6)
    True
    """
    require(scene, (Scene,), "fit_motion: scene")
    if not isinstance(confidence, float) or not 0.0 < confidence < 1.0:
        raise ArgumentError(f"fit_motion: confidence: expected a number between 0 and 1, got {confidence!r}.")
    kind = EventFitProblem if scene.nonsmooth else FitProblem
    problem = kind(scene, times, measured, parameters, step, inputs, integrator)
    low, high = problem.limits(bounds)
    given = problem.noise(noise)
    sizes = np.maximum(problem.y.std(axis=0), np.abs(problem.y).max(axis=0) * 1e-3) + np.finfo(float).tiny
    sigma = sizes if given is None else given
    found = problem.solve(problem.first, sigma, low, high)
    if given is None:
        sigma = problem.spread(found, sizes)
        found = problem.solve(found, sigma, low, high)
        sigma = problem.spread(found, sizes)
    return problem.report(found, sigma, confidence)
