"""Groups of coordinates that move by themselves while nothing touches, by what the traced terms of a mechanism depend on.

Two rates belong together if an inertia, a constraint or a stop couples them, or the force on one depends on the other. So
two trees of joints are apart unless a load or a rope connects them. A group under a law of time does not rest by itself.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression, Function, write
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms, SparseArrays, TracedMechanism
from gauss.dynamics.store import cached_on_disk
from gauss.linked_groups import linked_groups
from gauss.system import System


class CoordinateGroups(NamedTuple):
    """Groups of one system, numbered from 0."""

    of_rate: np.ndarray  # (n_v,) group of each rate
    of_carrier: np.ndarray  # (k,) group of each body that carries shapes; −1 of those that no rate moves
    of_row: np.ndarray  # (g + s,) group of each stop, rope and set-valued element; −1 of those that act on no rate
    timed: np.ndarray  # (count,) whether each depends on time: by a law of a load, or a prescribed motion
    inputs: np.ndarray  # (n_u, count) whether each input acts on each


class _Dependence(NamedTuple):
    """What one term depends on: rates, time, and inputs."""

    rates: frozenset[int]
    timed: bool
    inputs: frozenset[int]


class _Terms:
    """Dependences of the terms of a system."""

    def __init__(self, traced: TracedMechanism):
        smooth = traced.smooth
        self.n_v, n_q = smooth.n_v, smooth.n_q
        of_q: list[tuple[int, ...]] = [()] * n_q
        for joint in smooth.joints:
            for k in range(joint.q.start, joint.q.stop):
                of_q[k] = tuple(range(joint.v.start, joint.v.stop))
        self.places = [(), *of_q, *((k,) for k in range(self.n_v))]  # rates behind the inputs: time, coordinates, rates
        layout: list[SparseArrays] = []

        def begin(t, q, v):
            traced.order_inputs(t)
            layout.append(SparseArrays(traced.terms_at(t[0], q, v)))
            return (layout[-1].outputs,)

        function = write(begin, 1, n_q, self.n_v, name="mechanism")
        arrays, found = layout[0], _masks(function)
        masks, self.parts = [0] * arrays.flat.size, dict(zip(MechanismTerms._fields, arrays.parts, strict=True))
        filled = arrays.flat != 0.0
        filled[arrays.entries] = True
        for k, mask in zip(arrays.entries, found, strict=True):
            masks[k] = mask
        self.masks, self.filled = masks, filled

    def pattern(self, name: str) -> np.ndarray:
        """Which entries of an array may differ from zero."""
        part, shape = self.parts[name]
        return self.filled[part].reshape(shape)

    def of(self, name: str, *place) -> _Dependence:
        """What some entries of an array depend on."""
        part, shape = self.parts[name]
        numbers = np.arange(part.start, part.stop).reshape(shape)[place]
        mask = 0
        for k in np.ravel(numbers).tolist():
            mask |= self.masks[k]
        bits = [k for k in range(mask.bit_length()) if mask >> k & 1]
        rates = frozenset(rate for k in bits if k < len(self.places) for rate in self.places[k])
        return _Dependence(rates, 0 in bits, frozenset(k - len(self.places) for k in bits if k >= len(self.places)))


def _masks(function: Function) -> list[int]:
    """Inputs (bits, in order) that each output of a function depends on."""
    masks = {symbol.index: 1 << k for k, symbol in enumerate(function.inputs)}
    for node in function.nodes:
        if node.index not in masks:
            mask = 0
            for operand in node.operands:
                mask |= masks[operand.index]
            masks[node.index] = mask
    return [masks[x.index] if isinstance(x, Expression) else 0 for x in function.outputs]


def coordinate_groups(system: System, smooth: System, carriers: tuple[int, ...], held: bool) -> CoordinateGroups:
    """Groups of a system, cached with it, and by its content on disk; arguments as of :class:`TracedMechanism`."""
    traced = TracedMechanism(system, smooth, carriers, held)
    return cached_on_disk(system, (coordinate_groups, carriers, held, traced.laws.key), lambda: _groups(traced))


def _groups(traced: TracedMechanism) -> CoordinateGroups:
    terms = _Terms(traced)
    n_v, carriers = terms.n_v, len(traced.carriers)
    own = [({k} | _columns(terms, "M", k) | _columns(terms, "B", k), terms.of("tau", k)) for k in range(n_v)]
    own += [({k}, terms.of("beta", k)) for k in range(n_v)]
    bodies = [(_columns(terms, "J", k), terms.of("bodies", slice(None), k)) for k in range(carriers)]
    rows = [(_columns(terms, "K", k), _of_row(terms, k)) for k in range(len(terms.pattern("K")))]
    loops = [(_columns(terms, "G", k), _of_all(terms, ("G", "gamma"), k)) for k in range(len(terms.pattern("G")))]
    parts = [*own, *bodies, *rows, *loops]
    root = linked_groups(n_v, (link for rates, found in parts for link in pairwise(sorted(rates | found.rates))))
    numbers, of_rate = np.unique(root, return_inverse=True)
    of_rate = of_rate.reshape(n_v)
    timed = np.zeros(numbers.size, dtype=bool)
    inputs = np.zeros((len(traced.inputs), numbers.size), dtype=bool)
    for rates, found in parts:
        group = of_rate[sorted(rates | found.rates)]
        timed[group] |= found.timed
        for u in found.inputs:
            inputs[u, group] = True

    def group_of(which) -> np.ndarray:
        every = [sorted(rates | found.rates) for rates, found in which]
        return np.array([of_rate[one[0]] if one else -1 for one in every], dtype=np.int64)

    return CoordinateGroups(of_rate, group_of(bodies), group_of(rows), timed, inputs)


def bodies_of_groups(system: System, groups: CoordinateGroups) -> list[tuple[str, ...]]:
    """Bodies that each group moves, without those of no mass and inertia, as between the joints of one body of MJCF."""
    group = np.full(system.structure.n_bodies + 1, -1)  # the ground is the last one
    for edge in system.structure.tree:  # inner bodies come first
        v = system.joints[edge.constraint].v
        group[edge.outer] = groups.of_rate[v.start] if v.stop > v.start else group[edge.inner]
    group[:-1][~system.Phi.reshape(-1, 6).any(axis=1)] = -1
    names = system.structure.bodies
    return [tuple(names[body] for body in np.flatnonzero(group[:-1] == k)) for k in range(groups.timed.size)]


def _columns(terms: _Terms, name: str, k: int) -> set[int]:
    """Rates in a row, or in the rows of a body."""
    pattern = terms.pattern(name)[k].reshape(-1, terms.n_v)
    return set(np.flatnonzero(pattern.any(axis=0)).tolist())


def _of_row(terms: _Terms, k: int) -> _Dependence:
    """What a stop, rope or set-valued element depends on."""
    names = "rate", "K", "bias", "gap"
    return _of_all(terms, names if k < len(terms.pattern("gap")) else names[:-1], k)


def _of_all(terms: _Terms, names: Iterable[str], k: int) -> _Dependence:
    """What the k-th rows of some arrays depend on."""
    rates, timed, inputs = zip(*(terms.of(name, k) for name in names), strict=True)
    return _Dependence(frozenset().union(*rates), any(timed), frozenset().union(*inputs))
