"""Conversion and validation of arguments around a compiled function of one vector."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss.errors import StateError

CONVERTIBLE_KINDS = "biufO"  # kinds of numpy dtypes converted to float; complex would lose its imaginary part


@dataclass(frozen=True)
class Interface:
    """Arguments of a function (vectors, an array for the results, a number) and the limits of its results.

    Parameters
    ----------
    vectors : dict
        Size of each vector by name.
    number : str
        Name of the number, 0 unless given.
    limits : tuple of float
        Upper limits of the last outputs, which are error measures and no results.
    """

    vectors: dict[str, int]
    number: str
    limits: tuple[float, ...] = ()

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors."""
        return list(self.vectors.values())

    def split(self, joined: np.ndarray) -> list:
        """Split the concatenated arguments into the vectors and the number."""
        *vectors, (number,) = np.split(joined, np.cumsum(self.sizes))
        return [*vectors, number]

    def signature(self) -> inspect.Signature:
        """``(*vectors, out=None, number=0.0)``."""
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
        parameters = [inspect.Parameter(name, kind) for name in self.vectors]
        parameters += [inspect.Parameter(name, kind, default=d) for name, d in (("out", None), (self.number, 0.0))]
        return inspect.Signature(parameters)


class PythonWrapper:
    """Python function ``name(*vectors, out=None, number=0.0)`` around a function of one vector.

    Parameters
    ----------
    compute : callable
        Function of the vectors and the number, concatenated; returns the outputs.
    interface : Interface
        Arguments and limits.
    outputs : int
        Number of its outputs, error measures included.
    over_limit : callable
        Function of the same arguments, called where a limit is exceeded.
    name, doc : str
        Name and docstring.
    """

    def __init__(
        self, compute: Callable, interface: Interface, outputs: int, over_limit: Callable | None, name: str, doc: str
    ):
        self.compute, self.interface, self.over_limit = compute, interface, over_limit
        self.n_out = outputs - len(interface.limits)
        self.__name__, self.__doc__, self.__signature__ = name, doc, interface.signature()

    def __call__(self, *args, **kwargs):
        """Results (n_out,), in ``out`` if that is given.

        Raises
        ------
        StateError
            If an argument cannot be converted or has the wrong shape.
        """
        try:
            bound = self.__signature__.bind(*args, **kwargs).arguments
        except TypeError as error:
            raise TypeError(f"{self.__name__}{self.__signature__}: {error}.") from None
        out = bound.get("out")
        self._check(out)
        vectors = [_vector(name, bound[name], size) for name, size in self.interface.vectors.items()]
        found = self._results(vectors, _number(self.interface.number, bound.get(self.interface.number, 0.0)))
        if out is None:
            return found
        out[:] = found
        return out

    def _results(self, vectors, number: float) -> np.ndarray:
        found = self.compute(np.concatenate([*vectors, [number]]))
        if (found[self.n_out :] <= self.interface.limits).all():
            return found[: self.n_out].copy()
        return self.over_limit(*vectors, None, number)

    def __reduce__(self):
        raise TypeError(
            f"{self.__name__!r} is machine code of this process and cannot be pickled: "
            "send what it was made from, and make it again there."
        )

    def _check(self, out):
        if out is None:
            return
        if not isinstance(out, np.ndarray) or out.dtype != float or out.shape != (self.n_out,) or not out.flags.writeable:
            raise StateError(f"out: expected a writeable array of {self.n_out} doubles, got {_describe(out)}.")


def _vector(name: str, given, size: int) -> np.ndarray:
    try:
        array = np.asarray(given)
        numbers = array.astype(float) if array.dtype.kind in CONVERTIBLE_KINDS else None
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.shape != (size,):
        raise StateError(f"{name}: expected {size} numbers, got {_describe(given)}.")
    return numbers


def _number(name: str, given) -> float:
    try:
        return float(given.__float__())
    except (AttributeError, TypeError, ValueError):
        raise StateError(f"{name}: expected a number, got {_describe(given)}.") from None


def _describe(given) -> str:
    if not isinstance(given, np.ndarray):
        text = repr(given)
        return text if len(text) <= 60 else f"{text[:60]}…"
    locked = "" if given.flags.writeable else "read-only "
    return f"a {locked}{type(given).__name__} of shape {given.shape} and type {given.dtype}"
