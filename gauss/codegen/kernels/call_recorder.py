"""Computations that repeat: each piece is traced once for every form it takes, and a table says where it is done again.

A scene of a thousand loops asks the same of each of them. Written down as one function it would be as long as the scene.
Here it is a list of calls that a loop in machine code walks through: each is a function, and the addresses of its inputs and
outputs in one memory. What is constant wherever a piece is called is folded into it: a zero costs nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.codegen import Function, Graph, as_number
from gauss.codegen.kernels.call_table import Calls


class Slot:
    """Where a number is kept, or its negative.

    Parameters
    ----------
    address : int
        Number of the place in memory.
    negative : bool
        Whether the number is minus what is kept there.
    """

    __slots__ = ("address", "negative")

    def __init__(self, address: int, negative: bool = False):
        self.address, self.negative = address, negative


class Pattern(NamedTuple):
    """What arrays have in common for which the same code serves.

    Attributes
    ----------
    shape : tuple of int
        Their shape.
    codes : tuple of int
        Of each entry: k if it is the k-th of the distinct places, −k if it is its negative, 0 if it is a number.
    numbers : tuple of float
        The numbers among the entries.
    """

    shape: tuple
    codes: tuple
    numbers: tuple

    def filled(self, places) -> np.ndarray:
        """Object array with something in each place, of which there may be a negative."""
        numbers = iter(self.numbers)
        entries = [places[k - 1] if k > 0 else -places[-k - 1] if k else next(numbers) for k in self.codes]
        return _array(entries).reshape(self.shape)


class Operand:
    """Array of numbers and places, as :class:`CallRecorder` hands it on.

    Parameters
    ----------
    pattern : int
        Number of its pattern.
    addresses : list of int
        Its distinct places.
    shape : tuple of int
        Its shape.
    """

    __slots__ = ("pattern", "addresses", "shape")

    def __init__(self, pattern: int, addresses: list, shape: tuple):
        self.pattern, self.addresses, self.shape = pattern, addresses, shape


@dataclass(frozen=True)
class Specialisation:
    """A piece of computation, traced for arguments of some patterns.

    Parameters
    ----------
    number : int
        Its number among all.
    used : list of int
        Which of the places among the arguments it reads.
    results : list of (int, list, tuple)
        Pattern, places and shape of each array that it returns: place k of the arguments, or −1 − k of what is computed.
    size : int
        How many numbers it computes.
    """

    number: int
    used: list
    results: list
    size: int


class CallRecorder:
    """Recorder of calls on blocks; an object array of numbers and :class:`Slot` becomes one."""

    def __init__(self):
        self.start: list[float] = []  # what memory holds before anything is computed
        self.sections: dict[str, list[int]] = {}
        self.functions: list[Function] = []
        self._forms: dict[tuple, Specialisation] = {}
        self._patterns: list[Pattern] = []
        self._numbers: dict[Pattern, int] = {}
        self._section: list[int] = []

    def section(self, name: str):
        """Begin a list of calls; those that follow belong to it."""
        self._section = self.sections.setdefault(name, [])

    def keep(self, values) -> np.ndarray:
        """Places of numbers that memory holds from the start: parameters, or inputs that are written there later."""
        first = len(self.start)
        self.start.extend(float(value) for value in values)
        return _array([Slot(k) for k in range(first, len(self.start))])

    def block(self, array: np.ndarray) -> Operand:
        """Block of an array of numbers and places."""
        codes, numbers, seen = [], [], {}
        for entry in array.ravel().tolist():
            if entry.__class__ is Slot:
                k = seen.setdefault(entry.address, len(seen) + 1)
                codes.append(-k if entry.negative else k)
            else:
                codes.append(0)
                numbers.append(entry)
        pattern = self._number(Pattern(array.shape, tuple(codes), tuple(numbers)))
        return Operand(pattern, list(seen), array.shape)

    def array(self, block: Operand) -> np.ndarray:
        """Object array of the numbers and places in a block."""
        pattern, addresses = self._patterns[block.pattern], block.addresses
        numbers = iter(pattern.numbers)
        entries = [Slot(addresses[abs(k) - 1], k < 0) if k else next(numbers) for k in pattern.codes]
        return _array(entries).reshape(pattern.shape)

    def call(self, name, function: Callable, *arguments: Operand | np.ndarray) -> list[Operand]:
        """What a function of object arrays returns, a tuple of arrays; it must do the same whenever the name is the same.

        Parameters
        ----------
        name : hashable
            Tells functions apart.
        function : callable
            Takes object arrays of the shapes of the arguments.
        *arguments : Block or ndarray
            Numbers and places.
        """
        blocks = [given if given.__class__ is Operand else self.block(given) for given in arguments]
        key = name, tuple([block.pattern for block in blocks])
        form = self._forms.get(key)
        if form is None:
            form = self._forms[key] = self._traced(function, [self._patterns[block.pattern] for block in blocks])
        given = [address for block in blocks for address in block.addresses]
        first = len(self.start)
        if form.size:
            self.start.extend([0.0] * form.size)
            self._section.append(form.number)
            self._section.extend([given[k] for k in form.used])
            self._section.extend(range(first, first + form.size))
        return [
            Operand(pattern, [given[k] if k >= 0 else first - 1 - k for k in places], shape)
            for pattern, places, shape in form.results
        ]

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
        needed = set(Function("cell", list(symbols), outputs).nodes)
        used = [k for k, symbol in enumerate(symbols) if symbol in needed]
        if outputs:
            self.functions.append(Function("cell", [symbols[k] for k in used], outputs))
        return Specialisation(len(self.functions) - 1, used, results, len(outputs))

    def _result(self, found: np.ndarray, index: dict, outputs: list) -> tuple:
        """Pattern, places and shape of an array of expressions; what is new among them becomes an output."""
        codes, numbers, seen = [], [], {}
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

    def compiled(self) -> "Memory":
        """Memory with the machine code of all sections."""
        return Memory(np.array(self.start), Calls(self.functions), self.sections)


class Memory:
    """One memory, and sections of calls that work on it.

    Parameters
    ----------
    values : ndarray
        The memory.
    calls : Calls
        Machine code of the functions.
    sections : dict
        Table of calls by name.
    """

    def __init__(self, values: np.ndarray, calls: Calls, sections):
        self.values, self.calls = values, calls
        self.tables = {name: np.array(table, dtype=np.int32) for name, table in sections.items()}

    def run(self, section: str):
        """Make all calls of a section."""
        self.calls.run(self.values, self.tables[section])


class Vector:
    """Numbers in a memory, read and written as one array.

    Parameters
    ----------
    entries : ndarray
        Numbers and places.
    """

    def __init__(self, entries: np.ndarray):
        flat = entries.ravel().tolist()
        self.here = np.array([k for k, entry in enumerate(flat) if isinstance(entry, Slot)], dtype=int)
        self.addresses = np.array([flat[k].address for k in self.here], dtype=int)
        self.signs = np.array([-1.0 if flat[k].negative else 1.0 for k in self.here])
        self.constants = np.array([0.0 if isinstance(entry, Slot) else float(entry) for entry in flat])

    def read(self, memory: Memory) -> np.ndarray:
        """What is there."""
        found = self.constants.copy()
        found[self.here] = self.signs * memory.values[self.addresses]
        return found

    def write(self, memory: Memory, numbers):
        """Put numbers there; entries are places all of them."""
        memory.values[self.addresses] = numbers


def _array(entries: list) -> np.ndarray:
    """Object array (n,) of any objects."""
    found = np.empty(len(entries), dtype=object)
    found[:] = entries
    return found
