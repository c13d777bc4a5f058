from gauss.integrators.control import (
    SMALLEST_FACTOR,
    Tolerance,
    TrialStep,
    first_length,
    first_step,
    next_factor,
    trial_length,
)
from gauss.integrators.explicit import EXPLICIT, ExplicitPair
from gauss.integrators.fixed import EXPLICIT_FIXED
from gauss.integrators.generalised_alpha import generalised_alpha
from gauss.integrators.ggl import RadauGGL
from gauss.integrators.libraries import IMPLICIT, LIBRARIES, Library, LibrarySolution
from gauss.integrators.method import Controlled, FixedStep, Integrator
from gauss.integrators.methods import METHODS
from gauss.integrators.radau import RadauIIA
from gauss.integrators.step import (
    Chart,
    Cost,
    Equations,
    Impulses,
    Point,
    Rates,
    Reached,
    advance,
    crossed_time,
    method_state_of,
)
from gauss.integrators.taylor import WATCHED, Taylor, reach

__all__ = [
    "EXPLICIT",
    "EXPLICIT_FIXED",
    "METHODS",
    "SMALLEST_FACTOR",
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
    "crossed_time",
    "first_length",
    "first_step",
    "generalised_alpha",
    "method_state_of",
    "trial_length",
    "next_factor",
    "reach",
]
