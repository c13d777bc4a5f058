"""Parameters of a unit: numbers of a scene that stay open in its equations.

The numbers of the equations (masses, frames, inertias about joints, constants of loads) are polynomials of most numbers of
a scene, m c² being of the third degree: they are found from samples, and checked at others. The equations hold them as
symbols.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from gauss.dynamics import compile_scene
from gauss.dynamics.parameters import numbers, parametrised
from gauss.errors import ArgumentError
from gauss.scene.named_numbers import is_start, scene_of, value_of
from gauss.system import System

CHANGE = 0.3  # of a parameter, relative to it or to 1, within which the numbers are sampled
DEGREE = 3  # of the polynomials
EXACT = 1e-11  # error of a polynomial, and coefficients that are round-off, relative to the largest number
CHECKS = 5  # samples beside those that determine the polynomials


class UnitParameters:
    """Parameters of one system.

    SceneError if a name is no number of the scene.
    ArgumentError if the numbers of the equations are no polynomials of the parameters.

    Parameters
    ----------
    names : sequence of str
        Numbers of its scene.

    Attributes
    ----------
    values : dict of str to float
        Values of the parameters.
    system : System
        The system; its numbers that depend on them are the parameters ``symbols`` of traced code.
    symbols : tuple of str
        Their names.
    """

    def __init__(self, system: System, names: Sequence[str]):
        names = (names,) if isinstance(names, str) else tuple(names)
        self.pattern, scene = system, system.scene
        self.values = {name: value_of(scene, name) for name in names}
        self.system, self.symbols = system, tuple[str, ...]()
        if not names:
            return
        for name in names:
            if is_start(scene, name):
                raise ArgumentError(f"to_fmu: {name!r}: start values are those of the states, not parameters.")
        self._centre = np.array([*self.values.values()])
        self._units = CHANGE * np.where(self._centre == 0.0, 1.0, np.abs(self._centre))
        base, kind = numbers(system)
        self._powers = np.array(
            [one for one in product(range(DEGREE + 1), repeat=len(names)) if sum(one) <= DEGREE], dtype=int
        )
        rng = np.random.default_rng(0)
        given = self._centre + self._units * rng.uniform(-1.0, 1.0, (2 * len(self._powers) + CHECKS, len(names)))
        members = np.array([base, *(self._numbers(values, kind) for values in given)])
        family = parametrised(system, members)
        self.system, self.symbols = family.system, family.parameters
        wanted = members[1:, family.varied]
        V = np.array([self._monomials(values) for values in given], dtype=float)
        found = np.linalg.lstsq(V[CHECKS:], wanted[CHECKS:], rcond=None)[0]
        size = EXACT * max(1.0, np.abs(wanted).max(initial=0.0))
        found[np.abs(found) < size] = 0.0
        self._coefficients = found.T
        if np.abs(V @ found - wanted).max(initial=0.0) > len(found) * size:
            raise ArgumentError(
                f"to_fmu: the equations are no polynomials of {', '.join(names)}, as of a mass where bodies are welded: "
                "leave out those, and write a unit for each of their values."
            )

    def of(self, values) -> np.ndarray:
        """Numbers of the equations for values of the parameters, numbers or expressions."""
        terms = self._monomials(values)
        return np.array([sum(c * x for c, x in zip(row, terms, strict=True) if c) for row in self._coefficients])

    def _monomials(self, values) -> list:
        """Products of powers of the changes of the parameters."""
        z = (np.asarray(values) - self._centre) / self._units
        return [np.prod([x for x, k in zip(z, powers, strict=True) for _ in range(k)] or [1.0]) for powers in self._powers]

    def _numbers(self, values: np.ndarray, kind: tuple) -> np.ndarray:
        """Numbers of the scene with other values."""
        scene = scene_of(self.pattern.scene, dict(zip(self.values, values.tolist(), strict=True)))
        found, other = numbers(compile_scene(scene))
        if other != kind:
            raise ArgumentError(f"to_fmu: the kind of mechanism changes with {', '.join(self.values)}; leave some out.")
        return found
