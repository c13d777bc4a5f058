"""Contact forces of one step of Moreau–Jean time stepping, in machine code: active set of the gaps, contact problem."""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, Function, NativeFunction, Writer
from gauss.codegen.kernels.arrays import Array, Routine, Strided, Value, routine
from gauss.codegen.kernels.contact_solver import ContactSolver, room_of


@dataclass(frozen=True, eq=False)
class ContactForces(NativeFunction):
    """Contact forces (n,), normal, tangential, and of limited elements, as a function.

    Inputs are the velocities (n,) after the step without forces, the step h, the Jacobian J (n, n_v) of the velocities, the
    inverse mass matrix H (n_v, n_v), initial forces (n,), sliding velocities (2 k,) before the step, the tolerance of
    approach velocities, and the velocity above which a contact slides. Outputs are the forces, the residual of the laws, and
    a doubt flag: no solution was found, or the forces of sliding contacts may be undetermined (Painlevé).

    Parameters
    ----------
    gaps, freedoms : int
        Number of gaps, and of velocities of the system.
    under : ndarray of int, shape (k,)
        Gap of each frictional contact.
    friction, limit : ndarray, shape (k,), (g,)
        Friction coefficients, limits of limited elements.
    solver : ContactSolver
        Contact solver.
    sliding : Function
        (response to a normal force, to tangential forces, friction coefficient, sliding direction (2,)) → response to a
        sliding contact.
    negative : float
        Tolerance of negative responses, relative to the largest one.
    most : int
        Sliding contacts of one definiteness test.
    """

    gaps: int
    freedoms: int
    under: np.ndarray
    friction: np.ndarray
    limit: np.ndarray
    solver: ContactSolver
    sliding: Function
    negative: float
    most: int
    name = "contacts"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return sum(self.sizes), self.rows + 2

    @property
    def rows(self) -> int:
        """Number of forces."""
        return self.gaps + 2 * self.under.size + self.limit.size

    @property
    def sizes(self) -> tuple[int, ...]:
        """Lengths of the parts of the input."""
        n, n_v = self.rows, self.freedoms
        return n, 1, n * n_v, n_v * n_v, n, 2 * self.under.size, 1, 1

    def operations(self) -> dict[str, int]:
        """Approximate number of operations."""
        return {"mul": self.rows * self.freedoms * (self.freedoms + self.rows)}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        return _ContactStepWriter(self, *routine(self, writer.module, width)).write()


class _ContactStepWriter:
    def __init__(self, contacts: ContactForces, r: Routine, source: Strided, target: Strided):
        self.contacts, self.r, self.target, self.solver = contacts, r, target, contacts.solver.write(r.module)
        given = r.buffer(len(contacts.inputs))
        with r.each(len(contacts.inputs)) as k:
            given[k] = source[k]
        parts = np.cumsum([0, *contacts.sizes[:-1]])
        self.after, h, self.J, self.H, self.force, self.slide, slack, slow = (given.after(int(k)) for k in parts)
        self.h, self.slack, self.slow = h[0], slack[0], slow[0]
        n, n_v, k = contacts.rows, contacts.freedoms, contacts.under.size
        self.W, self.R, self.acceleration = r.buffer(n * n), r.buffer(n * n_v), r.buffer(n_v)
        self.b, self.f, self.room, self.left = r.buffer(n), r.buffer(n), r.buffer(room_of(n)), r.variable(0.0)
        self.active, self.rows, self.place, self.below, self.which = (r.buffer(size, INTEGER) for size in (n, n, n, k, k))
        self.friction = r.buffer(k)
        self.n_active, self.n_frictional = r.variable(0, INTEGER), r.variable(0, INTEGER)

    def write(self) -> ir.Function:
        r, contacts = self.r, self.contacts
        m = contacts.gaps
        under, coefficients = self._table(contacts.under, INTEGER), self._table(contacts.friction)
        limits, doubtful = self._table(contacts.limit), r.variable(0.0)
        with r.each(m) as i:
            self.active[i] = r.as_integer((self.after[i] < 0.0) | (self.force[i] > 0.0))
        with r.loop() as leave_if:
            self._rows(under, coefficients)
            k = self.n_active[0] + self.n_frictional[0] * 2 + contacts.limit.size
            self._responses(k)
            self.left[0] = 0.0
            with r.when(k > 0):
                counts = self.n_active[0], self.n_frictional[0], contacts.limit.size
                arrays = self.W, self.b, self.below, self.friction, limits, self.f, self.left, self.room
                r.call(self.solver, *counts, *arrays)
            self._push(k)
            doubtful[0] = r.choose(self.left[0] < 0.0, 1.0, 0.0)
            leave_if((self._activated() < 1) | (doubtful[0] > 0.0))
        if contacts.under.size:
            with r.when(self._is_doubtful(k)):
                doubtful[0] = 1.0
        with r.each(contacts.rows) as i:
            self.target[i] = self.force[i]
        for place, value in enumerate((self.left[0], doubtful[0]), start=contacts.rows):
            self.target[place] = value
        return r.done()

    def _table(self, values: np.ndarray, kind=None) -> Array:
        """Array of constants of the scene."""
        table = self.r.buffer(values.size, INTEGER) if kind is INTEGER else self.r.buffer(values.size)
        for k, value in enumerate(values.tolist()):
            table[k] = value
        return table

    def _rows(self, under: Array, coefficients: Array):
        """List the rows of active gaps, of friction there, and of all limited elements."""
        r, contacts = self.r, self.contacts
        count, pairs = r.variable(0, INTEGER), r.variable(0, INTEGER)
        with r.each(contacts.gaps) as i, r.when(self.active[i] > 0):
            self.rows[count[0]], self.place[i] = i, count[0]
            count[0] = count[0] + 1
        self.n_active[0] = count[0]
        with r.each(contacts.under.size) as j, r.when(self.active[under[j]] > 0):
            row, pair = j * 2 + contacts.gaps, pairs[0]
            self.rows[count[0]], self.rows[count[0] + 1] = row, row + 1
            self.below[pair], self.friction[pair], self.which[pair] = self.place[under[j]], coefficients[j], j
            count[0], pairs[0] = count[0] + 2, pair + 1
        self.n_frictional[0] = pairs[0]
        with r.each(contacts.limit.size) as j:
            self.rows[count[0]] = j + (contacts.rows - contacts.limit.size)
            count[0] = count[0] + 1

    def _responses(self, k: Value):
        """Compute R = J H, W = h J Rᵀ, b and the initial forces of the active rows."""
        r, n_v = self.r, self.contacts.freedoms
        with r.each(k) as i:
            row = self.rows[i]
            J, R = self.J.after(row * n_v), self.R.after(i * n_v)
            self.b[i], self.f[i] = self.after[row], self.force[row]
            with r.each(n_v) as column:
                R[column] = r.sum(n_v, lambda l: J[l] * self.H[l * n_v + column])  # noqa: B023, E741
        with r.each(k) as i:
            J = self.J.after(self.rows[i] * n_v)
            with r.each(i + 1) as j:
                R = self.R.after(j * n_v)
                value = self.h * r.sum(n_v, lambda l: J[l] * R[l])  # noqa: B023, E741
                self.W[i * k + j], self.W[j * k + i] = value, value

    def _push(self, k: Value):
        """Accelerations by the forces; scatter the forces to all rows, zero elsewhere."""
        r, n_v = self.r, self.contacts.freedoms
        with r.each(n_v) as column:
            self.acceleration[column] = r.sum(k, lambda i: self.f[i] * self.R[i * n_v + column])
        with r.each(self.contacts.rows) as i:
            self.force[i] = 0.0
        with r.each(k) as i:
            self.force[self.rows[i]] = self.f[i]

    def _activated(self) -> Value:
        """Number of inactive gaps that would close; they become active."""
        r, n_v, activated = self.r, self.contacts.freedoms, self.r.variable(0, INTEGER)
        with r.each(self.contacts.gaps) as i, r.when(self.active[i] < 1):
            J = self.J.after(i * n_v)
            rate = self.after[i] + self.h * r.sum(n_v, lambda l: J[l] * self.acceleration[l])  # noqa: E741
            with r.when(rate < -self.slack):
                self.active[i] = 1
                activated[0] = activated[0] + 1
        return activated[0]

    def _is_doubtful(self, k: Value) -> Value:
        """Whether the symmetric part of the responses of the sliding contacts is not positive definite."""
        r, count, most = self.r, self.r.variable(0, INTEGER), self.contacts.most
        some, K = r.buffer(most, INTEGER), r.buffer(most * most)
        along, largest, bad = r.buffer(2 * most), r.variable(0.0), r.variable(0, INTEGER)
        with r.each(self.n_frictional[0]) as j:
            across = [self.slide[self.which[j] * 2 + axis] for axis in range(2)]
            speed = r.square_root(across[0] * across[0] + across[1] * across[1])
            with r.when((speed > self.slow) & (self.f[self.below[j]] > 0.0) & (count[0] < most)):
                some[count[0]] = j
                for axis in range(2):
                    along[count[0] * 2 + axis] = -across[axis] / speed
                count[0] = count[0] + 1
        n = count[0]
        with r.each(n) as x:
            row = self.below[some[x]] * k
            smooth = self.W[row + self.below[some[x]]]
            largest[0] = r.maximum(smooth, largest[0])
            with r.each(n) as y:
                across = self.n_active[0] + some[y] * 2
                answers = self.W[row + self.below[some[y]]], self.W[row + across], self.W[row + across + 1]
                (K[x * most + y],) = r.inline(
                    self.contacts.sliding, *answers, self.friction[some[y]], along[y * 2], along[y * 2 + 1]
                )
        self._symmetric(n, K, largest[0] * self.contacts.negative)
        with r.each(n) as j:  # Cholesky's factor, column by column
            pivot = K[j * most + j] - r.sum(j, lambda l: K[j * most + l] * K[j * most + l])  # noqa: B023, E741
            with r.when(~(pivot > 0.0)):
                bad[0] = 1
            root = r.square_root(pivot)
            K[j * most + j] = root
            with r.each(n, j + 1) as i:
                known = r.sum(j, lambda l: K[i * most + l] * K[j * most + l])  # noqa: B023, E741
                K[i * most + j] = (K[i * most + j] - known) / root
        return bad[0] > 0

    def _symmetric(self, n: Value, K: Array, lift: Value):
        """Twice the symmetric part of a matrix, ``lift`` added to its diagonal."""
        r, most = self.r, self.contacts.most
        with r.each(n) as i:
            with r.each(i) as j:
                both = K[i * most + j] + K[j * most + i]
                K[i * most + j], K[j * most + i] = both, both
            K[i * most + i] = K[i * most + i] * 2.0 + lift
