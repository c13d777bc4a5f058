"""Conversion and validation of arguments around a compiled function: of one state, and of batches of states (n, …)."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import prod

import numpy as np

from gauss.codegen.recurrences import LINE
from gauss.errors import ArgumentError, GaussError, StateError

CONVERTIBLE_KINDS = "biufO"  # kinds of numpy dtypes converted to float; complex would lose its imaginary part
Shape = tuple[int, ...]


@dataclass(frozen=True)
class Interface:
    """Arguments of a function (vectors, an array for the results, a number), shapes and limits of its results.

    Parameters
    ----------
    vectors : dict
        Size of each vector by name.
    number : str
        Name of the number, 0 unless given.
    limits : tuple of float
        Upper limits of the last outputs, which are error measures and no results.
    shapes : tuple of tuple of int
        Shapes of the results, several are returned as a tuple, () is a number; one vector of all outputs when empty.
    """

    vectors: dict[str, int]
    number: str
    limits: tuple[float, ...] = ()
    shapes: tuple[Shape, ...] = ()

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors."""
        return list(self.vectors.values())

    def result_shapes(self, outputs: int) -> tuple[Shape, ...]:
        """Shapes of the results of a function with this number of outputs, limited quantities included."""
        return self.shapes or ((outputs - len(self.limits),),)

    def result_sizes(self, outputs: int) -> list[int]:
        """Numbers of entries of each result, and of the limited quantities if there are any."""
        sizes = [prod(shape) for shape in self.result_shapes(outputs)]
        return [*sizes, len(self.limits)] if self.limits else sizes

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
        Arguments, results and limits.
    outputs : int
        Number of its outputs, error measures included.
    over_limit : callable or None
        Function of the same arguments, called where a limit is exceeded; None without limits.
    name, doc : str
        Name and docstring.
    batch : callable, optional
        () → function (count, inputs, outputs) of rows of arrays, as :class:`gauss.codegen.batch_code.BatchEntry`; called at
        the first batch. Without it, batches are refused.

    Attributes
    ----------
    maker : tuple of callable and tuple, optional
        What another process makes the function from: a function that pickle takes, and its arguments.
    """

    def __init__(
        self,
        compute: Callable,
        interface: Interface,
        outputs: int,
        over_limit: Callable | None,
        name: str,
        doc: str,
        batch: Callable[[], Callable] | None = None,
    ):
        self.compute, self.interface, self.over_limit = compute, interface, over_limit
        self.n_out, self.shapes = outputs - len(interface.limits), interface.result_shapes(outputs)
        self.batch = batch
        self._rows: Callable | None = None
        self.maker: tuple[Callable, tuple] | None = None
        self.__name__, self.__doc__, self.__signature__ = name, doc, interface.signature()

    def __call__(self, *args, **kwargs):
        """Results, in ``out`` if that is given.

        Raises
        ------
        ArgumentError
            If an argument is missing, or there are too many.
        StateError
            If an argument cannot be converted or has the wrong shape.
        """
        try:
            bound = self.__signature__.bind(*args, **kwargs).arguments
        except TypeError as error:
            raise ArgumentError(f"{self.__name__}{self.__signature__}: {error}.") from None
        out, number = bound.get("out"), bound.get(self.interface.number, 0.0)
        names = self.interface.vectors.items()
        if self.batch is not None:
            vectors = [_rows(name, bound[name], size) for name, size in names]
            leads = [vector.shape[:-1] for vector in vectors] + [np.shape(number)]
            if any(leads):
                return self._of_batch(vectors, _numbers(self.interface.number, number), leads, out)
        else:
            vectors = [_vector(name, bound[name], size) for name, size in names]
        number = _number(self.interface.number, number)
        targets = self._targets(out, ())
        found = self._results(vectors, number)
        return found if targets is None else self._into(out, targets, found)

    def _results(self, vectors, number: float):
        found = self.compute(np.concatenate([*vectors, [number]]))
        if self.over_limit is not None and not (found[self.n_out :] <= self.interface.limits).all():
            return self.over_limit(*vectors, None, number)
        ends = np.cumsum([0, *map(prod, self.shapes)])
        found = [found[a:b].reshape(shape).copy() for (a, b), shape in zip(pairwise(ends), self.shapes, strict=True)]
        return _unpacked([result if result.ndim else float(result) for result in found])

    def _of_batch(self, vectors, numbers: np.ndarray, leads, out):
        """Results (…, *shape) of batches of arguments, which are broadcast against each other."""
        try:
            lead = np.broadcast_shapes(*leads)
        except ValueError:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(self.interface.vectors, vectors, strict=True))
            raise StateError(f"{self.__name__}: batches of different lengths: {shapes}.") from None
        inputs = [_flat(x, (*lead, x.shape[-1]), (prod(lead), x.shape[-1])) for x in vectors]
        inputs.append(_flat(numbers, lead, (prod(lead),)))
        targets = self._targets(out, lead)
        found = [self._room(k, (prod(lead), prod(shape)), targets, inputs) for k, shape in enumerate(self.shapes)]
        self._run_rows(prod(lead), inputs, found)
        shaped = _unpacked([result.reshape(*lead, *shape) for result, shape in zip(found, self.shapes, strict=True)])
        return shaped if targets is None else self._into(out, targets, shaped)

    def _run_rows(self, count: int, inputs, found):
        """Fill the results of all rows; those of rows that exceed their limits come from the other function."""
        if self._rows is None and self.batch is not None:
            self._rows = self.batch()
        if not count or self._rows is None:
            return
        limits = self.interface.limits
        errors = np.empty((count, len(limits)))
        self._rows(count, inputs, [*found, errors] if limits else found)
        if not (errors <= limits).all():
            for row in np.flatnonzero(~(errors <= limits).all(axis=1)).tolist():
                self._one_of_batch(row, inputs, found)

    def _room(self, k: int, shape: Shape, targets, inputs) -> np.ndarray:
        """Array for a result: the given one where rows can be written to it."""
        if targets is not None and targets[k].size and targets[k].flags.c_contiguous:
            if not any(np.may_share_memory(targets[k], given) for given in inputs):
                return targets[k].reshape(shape)
        return _aligned(shape)

    def _one_of_batch(self, row: int, inputs, found):
        """Replace the results of a row that exceeds its limits by those of the other function."""
        assert self.over_limit is not None
        *vectors, numbers = inputs
        try:
            results = self.over_limit(*(np.array(x[row]) for x in vectors), None, float(numbers[row]))
        except GaussError as error:
            error.add_note(f"in row {row} of the batch")
            raise
        for target, result in zip(found, results if len(self.shapes) > 1 else (results,), strict=True):
            target[row] = np.ravel(result)

    def _targets(self, out, lead: Shape) -> list[np.ndarray] | None:
        """Arrays that the results are written to; None without ``out``.

        StateError if they do not fit.
        """
        if out is None:
            return None
        several, shapes = len(self.shapes) > 1, [(*lead, *shape) for shape in self.shapes]
        if several and not (isinstance(out, tuple | list) and len(out) == len(shapes)):
            raise StateError(f"out: expected {len(shapes)} writeable arrays of doubles, got {described(out)}.")
        found = [_target(given, shape) for given, shape in zip(out if several else (out,), shapes, strict=True)]
        if any(np.shares_memory(one, other) for one, other in combinations(found, 2)):
            raise StateError(f"out: expected {len(shapes)} arrays, one for each result, got arrays that share memory.")
        return found

    def _into(self, out, targets: list[np.ndarray], found):
        """Write results to the given arrays, where they are not there already."""
        for target, result in zip(targets, found if len(self.shapes) > 1 else (found,), strict=True):
            if not (isinstance(result, np.ndarray) and result.base is target):
                target[...] = result
        return out

    def __reduce__(self):
        if self.maker is not None:
            return self.maker
        raise TypeError(
            f"{self.__name__!r} is machine code of this process and cannot be pickled: "
            "send what it was made from, and make it again there."
        )


def _unpacked(results: list):
    return results[0] if len(results) == 1 else tuple(results)


def _aligned(shape: Shape) -> np.ndarray:
    """New array that begins at a cache line: JAX shares no memory that begins elsewhere."""
    room = np.empty(prod(shape) + LINE // 8)
    first = -room.__array_interface__["data"][0] % LINE // 8
    return room[first : first + prod(shape)].reshape(shape)


def _target(out, shape: Shape) -> np.ndarray:
    """Writeable array of doubles of a shape, each in a place of its own; memory of other libraries is shared (DLPack)."""
    array = _as_array(out)
    fits = isinstance(array, np.ndarray) and array.dtype == float and array.dtype.isnative and array.shape == shape
    if fits and array.size:
        fits = not any(length > 1 and not stride for length, stride in zip(shape, array.strides, strict=True))
    if not fits or not array.flags.writeable:
        words = f"{shape[0]}" if len(shape) == 1 else f"shape {shape} of"
        raise StateError(f"out: expected a writeable array of {words} doubles, got {described(out)}.")
    return array


def _as_array(given):
    """Array of another library as an array of numpy, without a copy where its memory can be shared; else what was given."""
    if isinstance(given, np.ndarray) or not hasattr(given, "__dlpack__"):
        return given
    if hasattr(given, "is_neg") and given.is_neg():  # torch: its memory holds the numbers with the other sign
        return given
    try:
        return np.from_dlpack(given)
    except (BufferError, RuntimeError, TypeError, ValueError):  # on another device, or part of a graph of gradients
        return given


def as_doubles(given) -> np.ndarray | None:
    """Array of doubles, the given one if it is; None if it cannot be converted, or entries are masked."""
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        return None
    try:
        array = np.asarray(_as_array(given))
        return array.astype(float, copy=False) if array.dtype.kind in CONVERTIBLE_KINDS else None
    except (OverflowError, TypeError, ValueError, RuntimeError):  # the last of torch: gradients, a negative view
        return None


def _rows(name: str, given, size: int) -> np.ndarray:
    numbers = as_doubles(given)
    if numbers is None or numbers.ndim == 0 or numbers.shape[-1] != size:
        raise StateError(f"{name}: expected {size} numbers, or rows of them (n, {size}), got {described(given)}.")
    return numbers


def _flat(array: np.ndarray, shape: Shape, flat: Shape) -> np.ndarray:
    """Rows of an array that is broadcast to a shape, without a copy where its strides are whole numbers of doubles."""
    rows = np.broadcast_to(array, shape).reshape(flat)
    return rows if all(stride % 8 == 0 for stride in rows.strides) and rows.flags.aligned else rows.copy()


def _numbers(name: str, given) -> np.ndarray:
    numbers = as_doubles(given)
    if numbers is None:
        raise StateError(f"{name}: expected a number, or one for each row, got {described(given)}.")
    return numbers


def _vector(name: str, given, size: int) -> np.ndarray:
    numbers = as_doubles(given)
    if numbers is None or numbers.shape != (size,):
        raise StateError(f"{name}: expected {size} numbers, got {described(given)}.")
    return numbers


def _number(name: str, given) -> float:
    try:
        return float(given.__float__())
    except (AttributeError, OverflowError, TypeError, ValueError):
        raise StateError(f"{name}: expected a number, got {described(given)}.") from None


def described(given) -> str:
    """What was given, for a message."""
    if not isinstance(given, np.ndarray):
        if hasattr(given, "shape") and hasattr(given, "dtype"):
            graph = ", part of a graph of gradients: detach() it" if getattr(given, "requires_grad", False) else ""
            return f"a {type(given).__name__} of shape {tuple(given.shape)} and type {given.dtype}{graph}"
        text = repr(given)
        return text if len(text) <= 60 else f"{text[:60]}…"
    locked = "" if given.flags.writeable else "read-only "
    return f"a {locked}{type(given).__name__} of shape {given.shape} and type {given.dtype}"
