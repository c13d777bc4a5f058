"""All methods of gauss by their names."""

from importlib import import_module
from typing import TYPE_CHECKING

from gauss.lazy import LazyTable

if TYPE_CHECKING:
    from gauss.integrators.method import Integrator

# Tuples of methods, by the module that defines them, and the names of these methods.
ORIGINS = {
    ("gauss.integrators.explicit", "EXPLICIT"): ("dop853", "dopri5"),
    ("gauss.integrators.taylor", "TAYLOR"): ("taylor",),
    ("gauss.integrators.fixed", "EXPLICIT_FIXED"): ("rk4", "semi_implicit_euler"),
    ("gauss.integrators.symplectic", "SYMPLECTIC"): ("verlet", "variational_midpoint", "gauss4", "gauss6"),
    ("gauss.integrators.energy_momentum", "CONSERVING"): ("energy_momentum",),
    ("gauss.integrators.radau", "RADAU"): ("radau5",),
    ("gauss.integrators.generalised_alpha", "GENERALISED_ALPHA"): ("generalised_alpha",),
}
LIBRARY_ORIGINS = {
    ("gauss.integrators.libraries", "LIBRARIES"): (
        "scipy_dop853",
        "scipy_radau",
        "scipy_lsoda",
        "cvode_adams",
        "cvode_bdf",
    ),
    ("gauss.integrators.libraries", "IMPLICIT"): ("ida",),
}


def methods(origins: dict[tuple[str, str], tuple[str, ...]]) -> "LazyTable[Integrator]":
    """Methods by name.

    Parameters
    ----------
    origins : dict
        Names of methods, by module and name of the tuple that holds them.
    """
    return LazyTable({name: (*origin, name) for origin, names in origins.items() for name in names}, _found)


def _found(source: tuple[str, str, str]) -> "Integrator":
    module, several, name = source
    return next(method for method in getattr(import_module(module), several) if method.name == name)


METHODS = methods(ORIGINS)
