"""Root locus of a parameter: eigenvalues of linear models about the states of rest, or another state, as a number varies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from gauss.analysis.equilibrium import equilibrium
from gauss.analysis.linear_model import linearise
from gauss.arguments import named_arguments, real_array
from gauss.dynamics import compile_scene
from gauss.errors import ArgumentError, require
from gauss.scene import Scene
from gauss.scene.named_numbers import scene_of


@dataclass(frozen=True)
class RootLocus:
    """Eigenvalues along values of a parameter.

    Parameters
    ----------
    parameter : str
        Its name.
    values : ndarray, shape (k,)
        Its values.
    eigenvalues : ndarray of complex, shape (k, n)
        Eigenvalues [1/s]; each column is a branch.
    stability : tuple of str
        "stable", "marginal" or "unstable", for each value.
    """

    parameter: str
    values: np.ndarray
    eigenvalues: np.ndarray
    stability: tuple[str, ...]


@named_arguments
def root_locus(scene: Scene, parameter: str, values: Sequence[float], *, at_rest: bool = True) -> RootLocus:
    """Eigenvalues of the linear model of a scene as one of its numbers varies.

    Parameters
    ----------
    scene : Scene
        The scene.
    parameter : str
        Name as for :func:`gauss.sweep`: "spring.stiffness", "pole.mass", "gravity.y".
    values : sequence of float
        Values, in an order in which branches are followed.
    at_rest : bool
        Whether the model is about the state of rest near the start; else about the start with its rates.

    Returns
    -------
    RootLocus
        Branches of eigenvalues.

    Raises
    ------
    ArgumentError
        If there are no values.
    SceneError
        If the scene has no such number.
    SimulationError
        If there is no state of rest, or no linear model.

    Examples
    --------
    >>> import gauss
    >>> locus = gauss.root_locus(gauss.load("pendulum"), "gravity.y", [-9.81, -5.0])
    >>> locus.stability
    ('marginal', 'marginal')
    """
    require(scene, (Scene,), "root_locus")
    given = real_array(values, "root_locus: values", "finite numbers")
    if not isinstance(at_rest, bool):
        raise ArgumentError(f"root_locus: at_rest: expected True or False, got {at_rest!r:.80}.")
    if not isinstance(parameter, str):
        raise ArgumentError(f"root_locus: parameter: expected a name, got {parameter!r:.80}.")
    if given.ndim != 1 or not given.size or not np.isfinite(given).all():
        raise ArgumentError(f"root_locus: values: expected finite numbers, got {values!r:.80}.")
    models = [_model(scene_of(scene, {parameter: float(value)}), at_rest) for value in given]
    branches = [models[0].eigenvalues]
    for model in models[1:]:
        found = model.eigenvalues
        _, order = linear_sum_assignment(np.abs(branches[-1][:, None] - found[None, :]))
        branches.append(found[order])
    return RootLocus(parameter, given, np.array(branches), tuple(model.stability for model in models))


def _model(scene: Scene, at_rest: bool):
    """Linear model about the state of rest, or the start."""
    system = compile_scene(scene)
    return linearise(system, equilibrium(system).state if at_rest else system.initial_state())
