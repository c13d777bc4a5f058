"""State, rates → State: steps on the configuration manifold, and their control."""

from gauss.integrators.control import SLOWEST, Tolerance, TrialStep, first_step, next_factor
from gauss.integrators.energy_momentum import CONSERVING
from gauss.integrators.explicit import EXPLICIT, ExplicitPair
from gauss.integrators.fixed import EXPLICIT_FIXED
from gauss.integrators.generalised_alpha import generalised_alpha
from gauss.integrators.ggl import RadauGGL
from gauss.integrators.libraries import IMPLICIT, LIBRARIES, Library, LibrarySolution
from gauss.integrators.method import Controlled, FixedStep, Integrator
from gauss.integrators.radau import RADAU, RadauIIA
from gauss.integrators.step import Chart, Cost, Equations, Impulses, Point, Rates, Reached, advance, carried, lost
from gauss.integrators.symplectic import SYMPLECTIC
from gauss.integrators.taylor import WATCHED, Taylor, reach

METHODS: dict[str, Integrator] = {
    method.name: method
    for method in (*EXPLICIT, Taylor(), *EXPLICIT_FIXED, *SYMPLECTIC, *CONSERVING, *RADAU, generalised_alpha())
}

__all__ = [
    "EXPLICIT",
    "EXPLICIT_FIXED",
    "METHODS",
    "SLOWEST",
    "WATCHED",
    "Chart",
    "Controlled",
    "Cost",
    "Equations",
    "LibrarySolution",
    "IMPLICIT",
    "LIBRARIES",
    "ExplicitPair",
    "FixedStep",
    "Impulses",
    "Integrator",
    "Library",
    "Point",
    "RadauGGL",
    "RadauIIA",
    "Rates",
    "Reached",
    "Taylor",
    "Tolerance",
    "TrialStep",
    "advance",
    "carried",
    "first_step",
    "generalised_alpha",
    "lost",
    "next_factor",
    "reach",
]
