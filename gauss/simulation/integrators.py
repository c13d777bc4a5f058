"""Integrators of :func:`gauss.simulate` by their names: methods of gauss, time stepping, and other libraries."""

from gauss.integrators.methods import LIBRARY_ORIGINS, ORIGINS, methods

NONSMOOTH_ORIGINS = {("gauss.simulation.moreau.moreau_jean", "NONSMOOTH"): ("time_stepping",)}
INTEGRATORS = methods(ORIGINS | LIBRARY_ORIGINS | NONSMOOTH_ORIGINS)
