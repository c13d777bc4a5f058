"""Chart q = q₀ ⊕ θ of a system in machine code: loops over its plain coordinates and over its quaternions.

What a loop does with one coordinate or quaternion is traced from :mod:`gauss.system.manifold` and
:mod:`gauss.integrators.control`.
"""

from collections.abc import Iterator
from functools import cache, reduce

import numpy as np

from gauss import math
from gauss.codegen import INTEGER, Function, write
from gauss.codegen.kernels import RowCode, RowFunction
from gauss.dynamics.gear_trains import followers
from gauss.dynamics.point_layout import PointLayout
from gauss.dynamics.traced_system import Program
from gauss.integrators import Tolerance
from gauss.rotations import rotation_vector_lead
from gauss.system import turned


class ChartCode:
    """Emitter of the chart of a system, and of calls of its functions.

    Parameters
    ----------
    program : Program
        The system.
    shares : ndarray, shape (2, n_v), optional
        Factors of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, shares: np.ndarray | None = None):
        self.layout: PointLayout = program.layout
        self.n_q, self.n_v, self.shares = self.layout.n_q, self.layout.n_v, shares
        self.followers = followers(program.system) if program.drift.projects else []
        places: dict[str, list] = {"plain": [], "quaternion": []}
        for joint in program.system.joints:
            k = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
            places["plain"] += [(joint.q.start + i, joint.v.start + i) for i in range(k)]
            places["quaternion"] += [] if joint.pair.quaternion is None else [(joint.q.start + k, joint.v.start + k)]
        self.places = {kind: np.array(found, dtype=int).ravel() for kind, found in places.items()}

    def _each(self, code: RowCode, kind: str) -> Iterator[tuple]:
        """Write a loop over the coordinates of a kind: their places in q and in v."""
        places = self.places[kind]
        for k in code.each(len(places) // 2):
            if not self.places["quaternion"].size:
                yield k, k
            else:
                first = code.b.add(k, k)
                pair = first, code.b.add(first, INTEGER(1))
                at_q, at_v = (code.constant(f"places_of_{kind}", places, place) for place in pair)
                yield at_q, at_v

    def _numbers(self, code: RowCode, pointer, first, count: int) -> list:
        return [code.number(pointer, code.b.add(first, INTEGER(j))) for j in range(count)]

    def _put(self, code: RowCode, pointer, first, values: list):
        for j, value in enumerate(values):
            code.put(pointer, code.b.add(first, INTEGER(j)), value)

    def retract(self, code: RowCode, q, theta, target):
        """Write q ⊕ θ to an array."""
        for at_q, at_v in self._each(code, "plain"):
            code.put(target, at_q, code.b.fadd(code.number(q, at_q), code.number(theta, at_v)))
        if self.places["quaternion"].size:
            for at_q, at_v in self._each(code, "quaternion"):
                given = self._numbers(code, q, at_q, 4) + self._numbers(code, theta, at_v, 3)
                self._put(code, target, at_q, code.inline(_turned(), *given))

    def rate(self, code: RowCode, theta, v, target):
        """Write the rate of the chart at θ to an array, when the system moves with rates v."""
        code.copy(target, v, self.n_v)
        if self.places["quaternion"].size:
            for _, at_v in self._each(code, "quaternion"):
                given = self._numbers(code, theta, at_v, 3) + self._numbers(code, v, at_v, 3)
                self._put(code, target, at_v, code.inline(_turning_rate(), *given))

    def retract_at_rate(self, code: RowCode, q, theta, v, target, rate):
        """Write q ⊕ θ and the rate of the chart at θ to arrays; about a quaternion they share the angle and its sine."""
        if not self.places["quaternion"].size:
            self.retract(code, q, theta, target)
            self.rate(code, theta, v, rate)
            return
        code.copy(rate, v, self.n_v)
        for at_q, at_v in self._each(code, "plain"):
            code.put(target, at_q, code.b.fadd(code.number(q, at_q), code.number(theta, at_v)))
        for at_q, at_v in self._each(code, "quaternion"):
            given = self._numbers(code, q, at_q, 4) + self._numbers(code, theta, at_v, 3) + self._numbers(code, v, at_v, 3)
            found = code.inline(_turned_at_rate(), *given)
            self._put(code, target, at_q, found[:4])
            self._put(code, rate, at_v, found[4:])

    def displacement(self, code: RowCode, q, moved, theta, target):
        """Write the displacement from q to ``moved``: the difference of plain coordinates, θ about quaternions."""
        code.copy(target, theta, self.n_v)
        for at_q, at_v in self._each(code, "plain"):
            code.put(target, at_v, code.b.fsub(code.number(moved, at_q), code.number(q, at_q)))

    def follow(self, code: RowCode, x):
        """Let the gear trains of a point follow their first joints, as :meth:`Program.on_trains`."""
        for joint in self.followers:
            q, v = code.number(x, 1 + joint.first_q), code.number(x, 1 + self.n_q + joint.first_v)
            ratio, offset = code.motions.constant(joint.ratio), code.motions.constant(joint.offset)
            code.put(x, 1 + joint.q, code.b.fadd(code.b.fmul(ratio, q), offset))
            code.put(x, 1 + self.n_q + joint.v, code.b.fmul(ratio, v))

    def state(self, code: RowCode, x, t, y, target):
        """Write the state (t, q, v) of y in the chart around a point x."""
        code.put(target, 0, t)
        self.retract(code, code.at(x, 1), y, code.at(target, 1))
        code.copy(code.at(target, 1 + self.n_q), code.at(y, self.n_v), self.n_v)

    def state_room(self, code: RowCode):
        """Buffer of a state, and of the parameters of the system."""
        return code.room(1 + self.n_q + self.n_v + len(self.layout.parameters))

    def evaluate(self, code: RowCode, function: Function | RowFunction, state, x, found):
        """Call a function of (t, q, v) with the parameters of a point x."""
        known = self.layout.parameters
        for k, name in enumerate(function.parameters):
            value = code.number(x, self.layout.size - len(known) + known.index(name))
            code.put(state, 1 + self.n_q + self.n_v + k, value)
        code.call(function, state, found)

    def sizes(self, code: RowCode, state, target):
        """Write the sizes of the coordinates, and the rates, to an array (2 n_v,)."""
        if self.places["quaternion"].size:
            for k in code.each(self.n_v):
                code.put(target, k, code.motions.constant(1.0))
        for at_q, at_v in self._each(code, "plain"):
            (size,) = code.inline(_size(), code.number(state, code.b.add(at_q, INTEGER(1))))
            code.put(target, at_v, size)
        code.copy(code.at(target, self.n_v), code.at(state, 1 + self.n_q), self.n_v)

    def tolerances(self, code: RowCode, settings, sizes: list):
        """Array (2 n_v,) of the largest tolerances at some states.

        Parameters
        ----------
        code : RowCode
            Emitter.
        settings : llvmlite.ir.Value
            Array of rtol, atol, and atol of rates.
        sizes : list
            Arrays of :meth:`sizes` of the states.
        """
        found, (rtol, *absolute) = code.room(2 * self.n_v), (code.number(settings, k) for k in range(3))
        for half, atol in enumerate(absolute):
            entry = _tolerance(half, len(sizes), self.shares is not None)
            for i in code.each(self.n_v):
                k = code.b.add(i, INTEGER(half * self.n_v))
                own = [] if self.shares is None else [code.constant("tolerance_shares", self.shares.ravel(), k)]
                (value,) = code.inline(
                    entry, rtol, atol, *(code.number(part, k) for part in sizes), *map(code.motions.broadcast, own)
                )
                code.put(found, k, value)
        return found


@cache
def _turned() -> Function:
    return write(turned, 4, 3, name="turned")


@cache
def _turning_rate() -> Function:
    return write(lambda theta, v: v + rotation_vector_lead(theta, v), 3, 3, name="turning_rate")


@cache
def _turned_at_rate() -> Function:
    return write(lambda Q, theta, v: (turned(Q, theta), v + rotation_vector_lead(theta, v)), 4, 3, 3, name="turned_at_rate")


@cache
def _size() -> Function:
    return write(np.abs, 1, name="size")


@cache
def _tolerance(half: int, states: int, shared: bool) -> Function:
    """Function (rtol, atol, sizes, share if there is one) → largest tolerance of one coordinate, or of one rate."""

    def entry(rtol, atol, sizes, share):
        tolerance, share = Tolerance(rtol[0], atol[0], atol[0]), share[0] if shared else 1.0
        of = tolerance.of_rates if half else tolerance.of_coordinates
        return [reduce(math.maximum, [of(size, share) for size in sizes])]

    return write(entry, 1, 1, states, int(shared), name="tolerance")
