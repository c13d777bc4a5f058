"""Integrators of :func:`gauss.simulate` by their names: methods of gauss, time stepping, and other libraries."""

from typing import TYPE_CHECKING

from gauss.integrators.methods import LIBRARY_ORIGINS, ORIGINS, methods

if TYPE_CHECKING:
    from gauss.scene import Scene

NONSMOOTH_ORIGINS = {("gauss.simulation.moreau.moreau_jean", "NONSMOOTH"): ("time_stepping",)}
INTEGRATORS = methods(ORIGINS | LIBRARY_ORIGINS | NONSMOOTH_ORIGINS)


def usual_fixed_step(scene: "Scene") -> str:
    """Method that steps a scene where none is named: time stepping of contacts and friction, Runge–Kutta's of others."""
    return "time_stepping" if scene.nonsmooth else "rk4"
