"""Call recorder: repeated computations are traced once per specialisation, and executed from a call table.

Straight-line code of a scene with a thousand loops would be as long as the scene. Here the computation is a list of calls,
each a function and the addresses of its inputs and outputs in one memory, executed by a loop in machine code. A function is
specialised to the constants among its arguments (partial evaluation): a structural zero costs nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.codegen import Function, Graph, as_number
from gauss.codegen.kernels.call_table import CallTable


class Slot:
    """Memory slot of a number, or of its negative."""

    __slots__ = ("address", "negative")

    def __init__(self, address: int, negative: bool = False):
        self.address, self.negative = address, negative


class Pattern(NamedTuple):
    """Structure of an array: arrays of equal pattern share specialised code."""

    shape: tuple  # their shape
    codes: tuple  # code of each entry: k for the k-th distinct slot, −k for its negative, 0 for a number
    numbers: tuple  # the numbers among the entries

    def filled(self, slots) -> np.ndarray:
        """Object array with an entry for each slot, negated by the pattern."""
        numbers = iter(self.numbers)
        entries = [slots[k - 1] if k > 0 else -slots[-k - 1] if k else next(numbers) for k in self.codes]
        return _array(entries).reshape(self.shape)


class Operand:
    """Array of numbers and slots, an argument or a result of a recorded call."""

    __slots__ = ("pattern", "addresses", "shape")

    def __init__(self, pattern: int, addresses: list, shape: tuple):
        self.pattern = pattern  # its index
        self.addresses = addresses  # of its distinct slots
        self.shape = shape


@dataclass(frozen=True)
class Specialisation:
    """A function traced for arguments of given patterns.

    Parameters
    ----------
    number : int
        Index of the function.
    used : list of int
        Indices of the argument slots that it reads.
    results : list of (int, list, tuple)
        Pattern, slots and shape of each result: slot k of the arguments, or −1 − k for computed number k.
    size : int
        Count of the computed numbers.
    """

    number: int
    used: list
    results: list
    size: int


class CallRecorder:
    """Recorder of calls on operands; an object array of numbers and :class:`Slot` is converted to one."""

    def __init__(self):
        self.start: list[float] = []  # initial content of the memory
        self.kept: list[int] = []  # addresses of parameters and inputs; the other slots are results
        self.sections: dict[str, list[int]] = {}
        self.functions: list[Function] = []
        self._specialisations: dict[tuple, Specialisation] = {}
        self._patterns: list[Pattern] = []
        self._numbers: dict[Pattern, int] = {}
        self._section: list[int] = []

    def section(self, name: str):
        """Begin a section; the following calls belong to it."""
        self._section = self.sections.setdefault(name, [])

    def keep(self, values) -> np.ndarray:
        """Allocate slots with initial values: parameters, or inputs written before a run."""
        first = len(self.start)
        self.start.extend(float(value) for value in values)
        self.kept.extend(range(first, len(self.start)))
        return _array([Slot(k) for k in range(first, len(self.start))])

    def operand(self, array: np.ndarray) -> Operand:
        """Operand of an array of numbers and slots."""
        codes: list[int] = []
        numbers: list[float] = []
        seen: dict[int, int] = {}
        for entry in array.ravel().tolist():
            if entry.__class__ is Slot:
                k = seen.setdefault(entry.address, len(seen) + 1)
                codes.append(-k if entry.negative else k)
            else:
                codes.append(0)
                numbers.append(entry)
        pattern = self._number(Pattern(array.shape, tuple(codes), tuple(numbers)))
        return Operand(pattern, list(seen), array.shape)

    def array(self, operand: Operand) -> np.ndarray:
        """Object array of the numbers and slots of an operand."""
        pattern, addresses = self._patterns[operand.pattern], operand.addresses
        numbers = iter(pattern.numbers)
        entries = [Slot(addresses[abs(k) - 1], k < 0) if k else next(numbers) for k in pattern.codes]
        return _array(entries).reshape(pattern.shape)

    def call(self, name, function: Callable, *arguments: Operand | np.ndarray) -> list[Operand]:
        """Record a call of a function of object arrays; returns its results.

        Parameters
        ----------
        name : hashable
            Identifies the function: calls of equal name must compute the same.
        function : callable
            Takes object arrays of the shapes of the arguments, returns a tuple of arrays.
        *arguments : Operand or ndarray
            Numbers and slots.
        """
        operands = [given if isinstance(given, Operand) else self.operand(given) for given in arguments]
        key = name, tuple([operand.pattern for operand in operands])
        found = self._specialisations.get(key)
        if found is None:
            patterns = [self._patterns[operand.pattern] for operand in operands]
            found = self._specialisations[key] = self._traced(function, patterns)
        given = [address for operand in operands for address in operand.addresses]
        first = self._record(found, given)
        return [
            Operand(pattern, [given[k] if k >= 0 else first - 1 - k for k in places], shape)
            for pattern, places, shape in found.results
        ]

    def _record(self, called: Specialisation, given: list[int]) -> int:
        """Append a call to the section, for argument slots at some addresses; address of its first result."""
        first = len(self.start)
        if called.size:
            self.start.extend([0.0] * called.size)
            self._section.append(called.number)
            self._section.extend([given[k] for k in called.used])
            self._section.extend(range(first, first + called.size))
        return first

    def _number(self, pattern: Pattern) -> int:
        known = self._numbers.get(pattern)
        if known is None:
            known = self._numbers[pattern] = len(self._patterns)
            self._patterns.append(pattern)
        return known

    def _traced(self, function, patterns) -> Specialisation:
        sizes = [max(map(abs, pattern.codes), default=0) for pattern in patterns]
        symbols = Graph().symbols("x", sum(sizes))
        own = np.split(symbols, np.cumsum(sizes)[:-1]) if sizes else []
        index = {symbol.index: k for k, symbol in enumerate(symbols)}
        outputs: list = []
        arguments = [pattern.filled(some) for pattern, some in zip(patterns, own, strict=True)]
        results = [self._result(np.asarray(found, dtype=object), index, outputs) for found in function(*arguments)]
        needed = set(Function("specialised", list(symbols), outputs).nodes)
        used = [k for k, symbol in enumerate(symbols) if symbol in needed]
        if outputs:
            self.functions.append(Function("specialised", [symbols[k] for k in used], outputs))
        return Specialisation(len(self.functions) - 1, used, results, len(outputs))

    def _result(self, found: np.ndarray, index: dict, outputs: list) -> tuple:
        """Pattern, slots and shape of an array of expressions; new expressions are appended to the outputs."""
        codes: list[int] = []
        numbers: list[float] = []
        seen: dict[int, int] = {}
        for entry in found.ravel().tolist():
            number = as_number(entry)
            if number is not None:
                codes.append(0)
                numbers.append(number)
                continue
            root, negative = (entry.operands[0], True) if entry.op == "neg" else (entry, False)
            if root.index not in index:
                outputs.append(root)
                index[root.index] = -len(outputs)
            k = seen.setdefault(index[root.index], len(seen) + 1)
            codes.append(-k if negative else k)
        return self._number(Pattern(found.shape, tuple(codes), tuple(numbers))), list(seen), found.shape

    def compiled(self) -> "RecordedCalls":
        """Machine code of all sections, with the memory."""
        return RecordedCalls(np.array(self.start), np.array(self.kept, dtype=int), CallTable(self.functions), self.sections)


class RecordedCalls:
    """Memory, and sections of calls on it, ready to run."""

    def __init__(self, values: np.ndarray, kept: np.ndarray, calls: CallTable, sections):
        self.values, self.calls = values, calls  # the memory, and the functions
        self.kept = kept  # addresses of parameters and inputs
        self.tables = {name: np.array(table, dtype=np.int32) for name, table in sections.items()}

    def run(self, section: str):
        """Execute all calls of a section."""
        self.calls.run(self.values, self.tables[section])


class Vector:
    """View of an array of numbers and slots in memory as one vector."""

    def __init__(self, entries: np.ndarray):
        flat = entries.ravel().tolist()
        self.here = np.array([k for k, entry in enumerate(flat) if isinstance(entry, Slot)], dtype=int)
        self.addresses = np.array([flat[k].address for k in self.here], dtype=int)
        self.signs = np.array([-1.0 if flat[k].negative else 1.0 for k in self.here])
        self.constants = np.array([0.0 if isinstance(entry, Slot) else float(entry) for entry in flat])

    @property
    def is_contiguous(self) -> bool:
        """Whether the entries are slots one after the other."""
        whole = self.addresses.size == self.constants.size > 0
        return whole and bool((self.signs > 0).all() and (np.diff(self.addresses) == 1).all())

    def read(self, memory: RecordedCalls) -> np.ndarray:
        """Values of the entries."""
        found = self.constants.copy()
        found[self.here] = self.signs * memory.values[self.addresses]
        return found

    def write(self, memory: RecordedCalls, numbers):
        """Set the slots; all entries must be slots."""
        memory.values[self.addresses] = numbers


def _array(entries: list) -> np.ndarray:
    """Object array (n,) of any objects."""
    found = np.empty(len(entries), dtype=object)
    found[:] = entries
    return found
