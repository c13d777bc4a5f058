"""Contact problem of many bodies in machine code: u = b + J T, T = M⁻¹ Jᵀ f, with the laws of contact and friction.

Semismooth Newton method of Alart and Curnier (CMAME 92, 1991) as in :mod:`gauss.codegen.kernels.contact_solver`, with the
same laws. The residuals r of a contact have the derivatives A by its forces and B by its relative velocities. With A raised
to A + ε B w, w the diagonal of the Delassus matrix, every contact is eliminated by itself,

    δf = −g − K J δT,   g = (A + ε B w)⁻¹ r,   K = (A + ε B w)⁻¹ B,   (M + Jᵀ K J) δT = −Jᵀ g,

and what remains is a sparse matrix with a block (6, 6) for each body and each pair of bodies that are near. The
regularisation ε picks one of the distributions of redundant forces, that nearest to the last; the residuals are those of the
exact laws. Where Newton's method fails, projected Gauss–Seidel sweeps over single contacts precede it.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, machine
from gauss.codegen.kernels.arrays import Array, Routine, Value
from gauss.codegen.kernels.block_lu import INTEGERS, write_solve
from gauss.codegen.kernels.newton_rounds import LARGEST_RESIDUAL_SUM, Round, write_rounds
from gauss.codegen.kernels.vectors import BLOCK, SIX, WIDTH, TwistRows

SIDE = 3 * WIDTH  # doubles of the rows of one contact for one body: normal, two tangents
CONTACT = 2 * SIDE
MASS = 20  # inertia (3, 3) [kg m²], its inverse, mass, its inverse
FREEDOMS = 6  # of a body
LEAST_NUMBER = 1e-60  # forces and velocities that are set to zero: their squares may not be inverted
ELIMINATED = 12  # K (3, 3) and g (3,) of a contact
APART, STICKING, SLIPPING = 0.0, 1.0, 2.0  # modes of a contact
LEAST_REGULARISATION = 1e-7  # of contacts that keep their mode: their forces are hardly held back
ORDER = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 7)
SOLVE = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 14)


@dataclass(frozen=True, eq=False)
class BlockContactLaws:
    """Laws and settings of the solver.

    Parameters
    ----------
    normal, friction, project_normal, project_friction : Function
        As of :class:`gauss.codegen.kernels.ContactSolver`.
    rounds, redundant_rounds : tuple of Round
        What is tried one after the other, each from the best forces so far; the latter in problems of
        ``least_contacts`` or more whose contacts are redundant: those that stick by the known forces bear more components of
        force than the bodies have freedoms.
    least_contacts : int
        Number of contacts.
    """

    normal: Function
    friction: Function
    project_normal: Function
    project_friction: Function
    rounds: tuple[Round, ...]
    redundant_rounds: tuple[Round, ...]
    least_contacts: int


class _BlockContactWriter:
    def __init__(self, laws: BlockContactLaws, module: ir.Module):
        self.laws, self.solve = laws, write_solve(module)
        kinds = [INTEGER] * 3 + [INTEGERS] * 5 + [POINTER] * 9
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "contacts"))
        self.rows = TwistRows(r)
        self.n, self.m, self.blocks = r.integers
        self.bodies, self.slot, self.order, self.start, self.listed = r.arrays[:5]
        self.J, self.mass, self.b, self.mu, self.f, self.T, self.A, room, self.result = r.arrays[5:]
        m = self.m
        self.w, self.best, self.eps, self.mode = (room.after(m * k) for k in (0, 3, 6, 7))
        self.eliminated = room.after(m * 9)
        self.x = room.after(m * (9 + ELIMINATED))
        self.tolerance, self.highest, self.decay = self.result[0], r.variable(0.0), r.variable(1.0)

    def write(self) -> ir.Function:
        r = self.r
        self._measure()
        usual, redundant = self.laws.rounds, self.laws.redundant_rounds
        first, end = r.variable(0, INTEGER), r.variable(len(usual), INTEGER)
        with r.when((self.m >= self.laws.least_contacts) & self._are_redundant()):
            first[0], end[0] = len(usual), len(usual) + len(redundant)
        span = first[0], end[0]
        least, total, rounds = write_rounds(self, "sparse", usual + redundant, self.m * 3, lambda: self.tolerance, span)
        self.accumulate()
        self.result[0], self.result[1] = least[0], total[0]
        self.result[2] = r.as_double(rounds[0])
        return r.done()

    def _are_redundant(self) -> Value:
        """Whether the contacts that stick by the known forces have more components than the bodies have freedoms."""
        sticking = self.r.variable(0, INTEGER)
        with self.r.each(self.m) as c:
            push, *across = (self.f[c * 3 + k] for k in range(3))
            most = self.mu[c] * push
            with self.r.when((push > 0.0) & (across[0] * across[0] + across[1] * across[1] < most * most)):
                sticking[0] = sticking[0] + 1
        return sticking[0] * 3 > self.n * FREEDOMS

    def begin_round(self, regularisation: Value, decay: Value):
        """The same ε for all contacts at first."""
        self.highest[0], self.decay[0] = regularisation, decay
        with self.r.each(self.m) as c:
            self.eps[c], self.mode[c] = regularisation, APART

    def _sides(self, c: Value):
        """Body and rows of both sides of a contact."""
        return [(self.bodies[c * 2 + k], c * CONTACT + k * SIDE) for k in range(2)]

    def _row(self, place: Value, q: int) -> ir.Value:
        return self.rows.load(self.J, place + q * WIDTH)

    def _measure(self):
        """Diagonal w of the Delassus matrix, equal for both tangents."""
        r, w = self.r, self.w
        with r.each(self.m) as c:
            for q in range(3):
                w[c * 3 + q] = 0.0
            for body, place in self._sides(c):
                with r.when(body >= 0):
                    for q in range(3):
                        row = [self.J[place + (q * WIDTH + k)] for k in range(SIX)]
                        w[c * 3 + q] = w[c * 3 + q] + _dot(row, self._accelerated(body, row))
            w[c * 3 + 1] = r.maximum(w[c * 3 + 1], w[c * 3 + 2])
            w[c * 3 + 2] = w[c * 3 + 1]

    def _accelerated(self, body: Value, p) -> list[Value]:
        """M⁻¹ p of one body."""
        own = self.mass.after(body * MASS)
        turned = [_dot([own[9 + 3 * i + k] for k in range(3)], p[:3]) for i in range(3)]
        return turned + [own[19] * p[k] for k in range(3, SIX)]

    def _push(self, c: Value, forces):
        """Add the velocities by forces (3,) of a contact."""
        for body, place in self._sides(c):
            with self.r.when(body >= 0):
                p = self.rows.added(self.rows.zero(), forces, [self._row(place, q) for q in range(3)])
                found = self._accelerated(body, [self.rows.entry(p, k) for k in range(SIX)])
                for k, value in enumerate(found):
                    self.T[body * WIDTH + k] = self.T[body * WIDTH + k] + value

    def accumulate(self):
        """Velocities T = M⁻¹ Jᵀ f."""
        r, f = self.r, self.f
        with r.each(self.n * WIDTH) as i:
            self.T[i] = 0.0
        with r.each(self.m) as c:
            forces = [f[c * 3 + q] for q in range(3)]
            with r.when((r.absolute(forces[0]) + r.absolute(forces[1]) + r.absolute(forces[2])) > 0.0):
                self._push(c, forces)

    def _moved(self, c: Value, T: Array, start) -> list[Value]:
        """Relative velocities ``start`` + J T of a contact."""
        r = self.r
        found = [r.variable(0.0) for _ in range(3)]
        for q in range(3):
            found[q][0] = start[q]
        for body, place in self._sides(c):
            with r.when(body >= 0):
                own = [T[body * WIDTH + k] for k in range(SIX)]
                for q in range(3):
                    row = [self.J[place + (q * WIDTH + k)] for k in range(SIX)]
                    found[q][0] = found[q][0] + _dot(row, own)
        return [entry[0] for entry in found]

    def _rates(self, c: Value) -> list[Value]:
        return self._moved(c, self.T, [self.b[c * 3 + q] for q in range(3)])

    def sweep(self):
        """One projected Gauss–Seidel sweep over the contacts."""
        r, f, w = self.r, self.f, self.w
        with r.each(self.m) as c:
            i = c * 3
            (new,) = r.inline(self.laws.project_normal, f[i] - self._rates(c)[0] / w[i])
            change = new - f[i]
            f[i] = new
            self._push(c, [change, self.r.number(0.0), self.r.number(0.0)])
            u = self._rates(c)
            moved = [f[i + k] - u[k] / w[i + k] for k in (1, 2)]
            across = r.inline(self.laws.project_friction, *moved, self.mu[c] * f[i])
            changes = [across[k] - f[i + 1 + k] for k in range(2)]
            f[i + 1], f[i + 2] = across
            self._push(c, [self.r.number(0.0), *changes])

    def residuals(self) -> Value:
        """Residuals of the laws and the elimination of each contact; returns the largest residual, as a velocity."""
        r, f, w = self.r, self.f, self.w
        largest, total = r.variable(0.0), r.variable(0.0)
        with r.each(self.m) as c:
            i = c * 3
            u = [self._flushed(rate) for rate in self._rates(c)]
            error, by_force, by_rate = r.inline(self.laws.normal, f[i], u[0], w[i])
            trial = [f[i + k] - u[k] / w[i + k] for k in range(3)]
            eps, small = self._regularisation(c, trial), r.absolute(trial[1]) + r.absolute(trial[2]) < LEAST_NUMBER
            moved = r.choose(small, LEAST_NUMBER, 0.0)  # away from where |f_t| has no slope
            known = f[i + 1] + moved, f[i + 2], u[1], u[2], w[i + 1], f[i], u[0], w[i], self.mu[c]
            e1, e2, *slopes = r.inline(self.laws.friction, *known)
            alpha = by_force + by_rate * w[i] * eps
            Kn, gn = by_rate / alpha, error / alpha
            K, g = [[Kn, r.number(0.0), r.number(0.0)]], [gn]
            sides = []
            for e, own in ((e1, slopes[:6]), (e2, slopes[6:])):
                raised = [own[k] + own[k + 3] * w[i + 1 if k < 2 else i] * eps for k in range(3)]  # by f1, f2, f_n
                sides.append((raised[:2], own[5] - raised[2] * Kn, own[3], own[4], e - raised[2] * gn))
            (a, b), (d, e) = sides[0][0], sides[1][0]
            determinant = a * e - b * d
            for first, second in ((e, -b), (-d, a)):
                column = [(first * x + second * y) / determinant for x, y in zip(sides[0][1:], sides[1][1:], strict=True)]
                K.append(column[:3])
                g.append(column[3])
            kept = self.eliminated.after(c * ELIMINATED)
            for k, value in enumerate([*K[0], *K[1], *K[2], *g]):
                kept[k] = value
            for k, value in enumerate((error, e1, e2)):
                size = r.absolute(value * w[i + k])
                largest[0], total[0] = r.maximum(size, largest[0]), total[0] + size
        return r.choose(total[0] <= LARGEST_RESIDUAL_SUM, largest[0], np.inf)  # the maximum ignores NaN, the sum does not

    def _regularisation(self, c: Value, trial: list[Value]) -> Value:
        """Regularisation ε of a contact: that of the round after a change of its mode, else less than in the last step."""
        r, radius = self.r, self.mu[c] * trial[0]
        slips = trial[1] * trial[1] + trial[2] * trial[2] > radius * radius
        mode = r.choose(trial[0] > 0.0, r.choose(slips, SLIPPING, STICKING), APART)
        lowered = r.maximum(self.eps[c] * self.decay[0], r.number(LEAST_REGULARISATION))
        stays = r.absolute(mode - self.mode[c]) < 0.5 * STICKING
        self.mode[c], self.eps[c] = mode, r.choose(stays | (self.decay[0] >= 1.0), lowered, self.highest[0])
        return self.eps[c]

    def _flushed(self, x: Value) -> Value:
        return self.r.choose(self.r.absolute(x) < LEAST_NUMBER, 0.0, x)

    def newton(self):
        r, f = self.r, self.f
        self._assemble()
        r.call(self.solve, self.n, self.slot, self.order, self.start, self.listed, self.A, self.x)
        with r.each(self.m) as c:
            own = self.eliminated.after(c * ELIMINATED)
            zero = [r.number(0.0)] * 3
            moved = self._moved(c, self.x, zero)
            for q in range(3):
                f[c * 3 + q] = self._flushed(f[c * 3 + q] - own[9 + q] - _dot([own[q * 3 + k] for k in range(3)], moved))
        self.accumulate()

    def _assemble(self):
        """Matrix M + Jᵀ K J and right-hand side −Jᵀ g."""
        r, A, x, rows = self.r, self.A, self.x, self.rows
        with r.each(self.blocks * SIX) as i:
            rows.store(rows.zero(), A, i * WIDTH)
        with r.each(self.n * WIDTH) as i:
            x[i] = 0.0
        with r.each(self.n) as i:
            block, own = A.after((self.slot[i * self.n + i] - 1) * BLOCK), self.mass.after(i * MASS)
            for k in range(9):
                block[k // 3 * WIDTH + k % 3] = own[k]
            for k in range(3, SIX):
                block[k * WIDTH + k] = own[18]
        with r.each(self.m) as c:
            own = self.eliminated.after(c * ELIMINATED)
            values = [own[k] for k in range(ELIMINATED)]
            size = r.variable(0.0)
            for value in values:
                size[0] = size[0] + r.absolute(value)
            with r.when(size[0] > 0.0):
                K, g = [values[3 * q : 3 * q + 3] for q in range(3)], values[9:]
                sides = self._sides(c)
                for body, place in sides:
                    with r.when(body >= 0):
                        J = [self._row(place, q) for q in range(3)]
                        at = body * WIDTH
                        rows.store(rows.added(rows.load(x, at), [-entry for entry in g], J), x, at)
                for body, place in sides:
                    for other, other_place in sides:
                        with r.when((body >= 0) & (other >= 0)):
                            self._add_block(body, place, other, other_place, K)

    def _add_block(self, body, place, other, other_place, K):
        """Add Jᵢᵀ K Jⱼ to a block."""
        rows = self.rows
        right = [self._row(other_place, q) for q in range(3)]
        products = [rows.added(rows.zero(), K[q], right) for q in range(3)]
        at = (self.slot[body * self.n + other] - 1) * BLOCK
        for i in range(SIX):
            factors = [self.J[place + (q * WIDTH + i)] for q in range(3)]
            rows.store(rows.added(rows.load(self.A, at + i * WIDTH), factors, products), self.A, at + i * WIDTH)


def _dot(one, other) -> Value:
    total = one[0] * other[0]
    for x, y in zip(one[1:], other[1:], strict=True):
        total = total + x * y
    return total


def write_block_contacts(laws: BlockContactLaws, module: ir.Module) -> ir.Function:
    """Emit ``contacts``: the arguments are those of :meth:`ContactGraph.solve`, in its order."""
    return _BlockContactWriter(laws, module).write()


class BlockContactSolver(machine.CodeCaller):
    """Python interface of the solver.

    Parameters
    ----------
    code : MachineCode
        Code of a module that holds ``order`` and ``contacts``: that of a step.
    """

    def __init__(self, code: machine.MachineCode):
        self.code = code
        self._bind()

    def _bind(self):
        self._order, self._solve = self.code.entry("order", ORDER), self.code.entry("contacts", SOLVE)

    def graph(self, n: int, bodies: np.ndarray) -> "ContactGraph":
        """Order of elimination of n bodies with contacts between ``bodies`` (m, 2), −1 for the ground."""
        return ContactGraph(self, n, np.ascontiguousarray(bodies, dtype=np.int64))


class ContactGraph:
    """Bodies and contacts between them, with the order of elimination.

    Parameters
    ----------
    solver : BlockContactSolver
        The solver.
    n : int
        Number of bodies.
    bodies : ndarray of int64, shape (m, 2)
        Bodies of each contact; −1 for the ground.
    """

    def __init__(self, solver: BlockContactSolver, n: int, bodies: np.ndarray):
        self.solver, self.n, self.bodies = solver, n, bodies
        self.slot, self.list = np.empty(n * n, dtype=np.int64), np.empty(n * n + 1, dtype=np.int64)
        self.order, self.degree = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
        self.start, count = np.empty(n + 1, dtype=np.int64), np.empty(1, dtype=np.int64)
        arrays = bodies, self.slot, self.order, self.start, self.list, self.degree, count
        solver._order.call(n, len(bodies), *(array.ctypes.data for array in arrays))
        self.blocks = int(count[0])

    def solve(self, J, mass, b, mu, f, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces (m, 3), the velocities (n, 6) that they add, and (residual, Newton steps, rounds).

        Parameters
        ----------
        J : ndarray, shape (m, 2, 3, 8)
            TwistRows of normal and tangents for the twist of each body; the last two columns are zero.
        mass : ndarray, shape (n, 20)
            Inertia, its inverse, mass, its inverse.
        b, mu, f : ndarray, shape (m, 3), (m,), (m, 3)
            Relative velocities without forces, friction coefficients, initial forces.
        tolerance : float
            Largest residual of the laws, as a velocity.
        """
        n, m = self.n, len(self.bodies)
        f, T, result = np.array(f, dtype=float), np.empty((n, WIDTH)), np.array([tolerance, 0.0, 0.0])
        A, room = np.empty(self.blocks * BLOCK), np.empty(m * (9 + ELIMINATED) + n * WIDTH)
        whole = self.bodies, self.slot, self.order, self.start, self.list
        given = [np.ascontiguousarray(array, dtype=float) for array in (J, mass, b, mu)]
        arrays = (*whole, *given, f, T, A, room, result)
        self.solver._solve.call(n, m, self.blocks, *(array.ctypes.data for array in arrays))
        return f, T[:, :SIX], result
