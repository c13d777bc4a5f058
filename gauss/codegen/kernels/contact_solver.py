"""Contact problem W f + b = u under contact laws: semismooth Newton method, regularised where it fails.

W is the Delassus matrix, f the forces, u the relative velocities. Rows: normals, then two tangential ones per frictional
contact, then limited elements (dry friction of joints, brakes). Residual and derivatives of each law are traced functions
(Alart and Curnier, CMAME 92, 1991). Steps with the Jacobian r' + ε 1 change the forces less; projected Gauss–Seidel sweeps
come last.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Writer, machine
from gauss.codegen.kernels.arrays import INTEGERS, Routine, Value, subroutine
from gauss.codegen.kernels.newton_rounds import LARGEST_RESIDUAL_SUM, Round, write_rounds
from gauss.codegen.kernels.small_linear_systems import space, write_equations

SMALLEST_DIAGONAL = 1e-300  # lower bound of the largest diagonal entry of W, against a division by zero


@dataclass(frozen=True, eq=False)
class ContactSolver:
    """Solver of W f + b = u with a contact law for each row.

    Parameters
    ----------
    normal, friction, limited : Function
        Residuals of the laws, with derivatives. Normal: (f, u, w) → (residual, its derivatives by f and u). Friction:
        (two tangential forces, two velocities, w, normal force, its velocity, its w, friction coefficient) → (two residuals,
        their derivatives by tangential forces and velocities, normal force and velocity). Limited element:
        (f, u, w, limit) → as for a normal.
    project_normal, project_friction, project_limited : Function
        Projections onto the admissible forces: f → normal force; (two forces, radius) → two tangential forces;
        (f, limit) → force of a limited element.
    rounds : tuple of Round
        Rounds of Newton steps, until one succeeds.
    target, accepted : float
        Target and acceptance limit of the residual, relative to 1 + the largest velocity.
    least_diagonal : float
        Least diagonal entry of W, relative to the largest one; smaller ones are raised to it.
    """

    normal: Function
    friction: Function
    limited: Function
    project_normal: Function
    project_friction: Function
    project_limited: Function
    rounds: tuple[Round, ...]
    target: float
    accepted: float
    least_diagonal: float

    def write(self, module: ir.Module) -> ir.Function:
        """Emit the solver.

        It is ``solve_contacts(i64 normals, i64 frictional, i64 limited, double* W, double* b, i64* under, double* friction,
        double* limit, double* f, double* residual, double* room)``: ``f`` holds the initial forces, then the solution;
        ``residual`` the residual of the laws, −1 if no solution was found.
        """
        kinds = [INTEGER] * 3 + [POINTER] * 2 + [INTEGERS] + [POINTER] * 5
        return _ContactSolverWriter(self, subroutine(module, "solve_contacts", kinds)).write()


def room_of(rows: int) -> int:
    """Numbers of working memory for a contact problem with so many rows."""
    return 7 * rows + rows * rows + space(rows)


class _ContactSolverWriter:
    def __init__(self, laws: ContactSolver, r: Routine):
        self.laws, self.r = laws, r
        self.normals, self.frictional, self.limited = r.integers
        self.W, self.b, self.under, self.friction, self.limit, self.f, self.residual, room = r.arrays
        self.limited_rows = self.normals + self.frictional * 2  # first row of the limited elements
        self.n = n = self.limited_rows + self.limited
        self.w, self.u, self.error, self.best, self.step = (room.after(n * k) for k in range(5))
        self.slope, self.work = room.after(n * 5), room.after(n * 5 + n * n)
        self.eps = r.variable(0.0)
        self.equations = write_equations(r.module)

    def write(self) -> ir.Function:
        r, laws = self.r, self.laws
        self._measure()
        scale = r.variable(0.0)
        with r.each(self.n) as i:
            scale[0] = r.maximum(r.absolute(self.b[i]), scale[0])
        scale[0] = scale[0] + 1.0
        least, *_ = write_rounds(self, "dense", laws.rounds, self.n, lambda: scale[0] * laws.target)
        self.residual[0] = r.choose(least[0] <= scale[0] * laws.accepted, least[0], -1.0)
        return r.done()

    def begin_round(self, regularisation: Value, decay: Value):  # noqa: ARG002
        """One ε for all rows, which stays."""
        self.eps[0] = regularisation

    def accumulate(self):
        """Velocities are found where they are needed."""

    def _measure(self):
        """Scale of each row: the diagonal of W, equal for both tangential directions, bounded from below."""
        r, w, largest = self.r, self.w, self.r.variable(SMALLEST_DIAGONAL)
        with r.each(self.n) as i:
            w[i] = self.W[i * self.n + i]
        with r.each(self.frictional) as j:
            i = self.normals + j * 2
            w[i] = r.maximum(w[i], w[i + 1])
            w[i + 1] = w[i]
        with r.each(self.n) as i:
            largest[0] = r.maximum(w[i], largest[0])
        with r.each(self.n) as i:
            w[i] = r.maximum(w[i], largest[0] * self.laws.least_diagonal)

    def _rate(self, i: Value) -> Value:
        """Velocity of a row under the present forces."""
        return self.b[i] + self.r.sum(self.n, lambda j: self.W[i * self.n + j] * self.f[j])

    def sweep(self):
        """One projected Gauss–Seidel sweep over contacts and limited elements."""
        r, f, w = self.r, self.f, self.w
        with r.each(self.normals) as i:
            (f[i],) = r.inline(self.laws.project_normal, f[i] - self._rate(i) / w[i])
        with r.each(self.frictional) as j:
            i = self.normals + j * 2
            moved = [f[k] - self._rate(k) / w[k] for k in (i, i + 1)]
            f[i], f[i + 1] = r.inline(self.laws.project_friction, *moved, self.friction[j] * f[self.under[j]])
        with r.each(self.limited) as j:
            i = self.limited_rows + j
            (f[i],) = r.inline(self.laws.project_limited, f[i] - self._rate(i) / w[i], self.limit[j])

    def residuals(self) -> Value:
        """Evaluate the residuals of the laws (as forces) and the Jacobian; returns the largest residual, as a velocity."""
        r, f, u, w = self.r, self.f, self.u, self.w
        with r.each(self.n) as i:
            u[i] = self._rate(i)
        with r.each(self.n * self.n) as i:
            self.slope[i] = 0.0
        with r.each(self.normals) as i:
            self.error[i], *slopes = r.inline(self.laws.normal, f[i], u[i], w[i])
            self._slope(i, [i], slopes)
        with r.each(self.frictional) as j:
            i, n = self.normals + j * 2, self.under[j]
            rows = (i, i + 1, n)
            known = f[i], f[i + 1], u[i], u[i + 1], w[i], f[n], u[n], w[n], self.friction[j]
            self.error[i], self.error[i + 1], *slopes = r.inline(self.laws.friction, *known)
            self._slope(i, rows, slopes[:6])
            self._slope(i + 1, rows, slopes[6:])
        with r.each(self.limited) as j:
            i = self.limited_rows + j
            self.error[i], *slopes = r.inline(self.laws.limited, f[i], u[i], w[i], self.limit[j])
            self._slope(i, [i], slopes)
        largest, total = r.variable(0.0), r.variable(0.0)

        def measure(size: Value):
            largest[0], total[0] = r.maximum(size, largest[0]), total[0] + size

        with r.each(self.n) as i:
            measure(r.absolute(self.error[i] * w[i]))
        with r.each(self.limited) as j:
            i = self.limited_rows + j
            is_held = self.W[i * self.n + i] < w[i]  # its velocity does not react, as that of a prescribed joint
            share = r.absolute(self.error[i]) / (self.limit[j] + SMALLEST_DIAGONAL)
            measure(r.choose(is_held, share * r.absolute(u[i]), 0.0))
        return r.choose(total[0] <= LARGEST_RESIDUAL_SUM, largest[0], np.inf)  # the maximum ignores NaN, the sum does not

    def _slope(self, row: Value, rows, slopes):
        """Row of the Jacobian by all forces: ∂r/∂f + ∂r/∂u W, from the derivatives by forces and velocities of some rows."""
        r, n = self.r, self.n
        forces, rates = slopes[: len(rows)], slopes[len(rows) :]
        with r.each(n) as column:
            terms = [slope * self.W[i * n + column] for i, slope in zip(rows, rates, strict=True)]
            self.slope[column * n + row] = sum(terms[1:], terms[0])
        for i, slope in zip(rows, forces, strict=True):
            self.slope[i * n + row] = self.slope[i * n + row] + slope

    def newton(self):
        """One Newton step."""
        r, step = self.r, self.step
        with r.each(self.n) as i:
            step[i] = -self.error[i]
            self.slope[i * self.n + i] = self.slope[i * self.n + i] + self.eps[0]
        r.call(self.equations, self.n, self.slope, step, self.work)
        with r.each(self.n) as i:
            self.f[i] = self.f[i] + step[i]


class CompiledContactSolver(machine.CodeCaller):
    """Python interface of the contact solver.

    Parameters
    ----------
    solver : ContactSolver
        The solver.
    """

    def __init__(self, solver: ContactSolver):
        writer = Writer()
        inner = solver.write(writer.module)
        r = Routine(ir.Function(writer.module, inner.function_type, "solve"))
        r.call(inner, *r.integers, *r.arrays)
        r.done()
        self.code = machine.load(str(writer.module))
        self._bind()

    def _bind(self):
        self._solve = self.code.entry("solve", ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 8))

    def __call__(self, W, b, under, friction, limit, start) -> tuple[np.ndarray, float]:
        """Forces (n,) and the residual of the laws, −1 if no solution was found.

        Parameters
        ----------
        W, b : ndarray, shape (n, n), (n,)
            Delassus matrix and velocities without forces; rows: normals, tangential directions, limited elements.
        under : ndarray of int, shape (k,)
            Row of the normal of each pair of tangential rows.
        friction, limit : ndarray, shape (k,), (g,)
            Friction coefficients, limits of limited elements.
        start : ndarray, shape (n,)
            Initial forces.
        """
        counts = start.size - 2 * friction.size - limit.size, friction.size, limit.size
        forces, left, room = np.array(start, dtype=float), np.empty(1), np.empty(room_of(start.size))
        arrays = [np.ascontiguousarray(array, dtype=float) for array in (W, b, friction, limit)]
        arrays.insert(2, np.ascontiguousarray(under, dtype=np.int64))
        self._solve.call(*counts, *(array.ctypes.data for array in (*arrays, forces, left, room)))
        return forces, float(left[0])
