"""Members of a sweep: names of numbers in a scene, and their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from gauss.arguments import real_numbers
from gauss.errors import SceneError
from gauss.simulation.memory_limit import refuse_beyond_memory


@dataclass(frozen=True)
class Members:
    """Members of a sweep: every combination of the parameter values, or the i-th value of each parameter."""

    names: tuple[str, ...]  # of the parameters
    values: tuple[np.ndarray, ...]  # of each parameter
    together: bool = False  # whether the i-th values of all parameters, which are equally many, make one member

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return ("member",) if self.together else self.names

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions."""
        return self.values[0].shape if self.together else tuple(len(values) for values in self.values)

    @property
    def size(self) -> int:
        """Number of members."""
        return prod(self.shape)

    def of(self, begin: int, end: int) -> list[dict[str, float]]:
        """Values of some members by name."""
        if self.together:
            columns = [values[begin:end] for values in self.values]
        else:
            places = np.unravel_index(np.arange(begin, end), self.shape)
            columns = [values[place] for values, place in zip(self.values, places, strict=True)]
        return [dict(zip(self.names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def members(vary: Mapping[str, Sequence[float] | np.ndarray], together: bool) -> Members:
    """Members of a sweep, checked; SceneError if there are no parameters, or values are not finite numbers."""
    if not isinstance(vary, Mapping) or not vary:
        raise SceneError(f"vary: expected names with their values, e.g. {{'crank.mass': [1.0, 1.5, 2.0]}}, got {vary!r}.")
    found = []
    for name, given in vary.items():
        numbers = real_numbers(given)
        values = np.zeros((0, 0)) if numbers is None else np.atleast_1d(numbers)
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            raise SceneError(f"vary: {name!r}: expected finite numbers, e.g. np.linspace(0.5, 2.0, 50), got {given!r:.80}.")
        found.append(values)
    lengths = {name: len(values) for name, values in zip(vary, found, strict=True)}
    if together and len(set(lengths.values())) > 1:
        raise SceneError(f"vary: values that are varied together need the same number of each, got {lengths}.")
    return Members(tuple(vary), tuple(found), together)


def ranges(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Values of texts such as "crank.mass=0.5:2:50" (from, to, how many) or "A.rate=5,10,15".

    Parameters
    ----------
    texts : sequence of str
        One for each name.

    Returns
    -------
    dict
        Values (n,) by name.

    Raises
    ------
    SceneError
        If a text is neither.
    SimulationError
        If the values do not fit into memory.
    """
    found = {}
    for text in texts:
        name, _, values = text.rpartition("=")
        try:
            if not name or name in found:
                raise ValueError
            if ":" in values:
                first, last, count = values.split(":")
                refuse_beyond_memory(int(count), f"vary: {text!r}: {int(count):.3g} values", "give fewer")
                found[name] = np.linspace(float(first), float(last), int(count))
            else:
                found[name] = np.array([float(value) for value in values.split(",")])
        except ValueError:
            why = "is given twice" if name in found else "expected NAME=FROM:TO:COUNT or NAME=VALUE,VALUE,…"
            raise SceneError(f"vary: {text!r}: {why}, e.g. crank.mass=0.5:2:50.") from None
    return found
