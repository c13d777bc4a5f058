"""All methods of gauss by their names."""

from gauss.integrators.energy_momentum import CONSERVING
from gauss.integrators.explicit import EXPLICIT
from gauss.integrators.fixed import EXPLICIT_FIXED
from gauss.integrators.generalised_alpha import generalised_alpha
from gauss.integrators.method import Integrator
from gauss.integrators.radau import RADAU
from gauss.integrators.symplectic import SYMPLECTIC
from gauss.integrators.taylor import Taylor

_ALL: tuple[Integrator, ...] = (*EXPLICIT, Taylor(), *EXPLICIT_FIXED, *SYMPLECTIC, *CONSERVING, *RADAU, generalised_alpha())
METHODS: dict[str, Integrator] = {method.name: method for method in _ALL}
