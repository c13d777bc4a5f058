"""Forces that obey laws of contact, in machine code: Newton's method, and sweeps of single contacts where it fails.

Rows are those of normals, then two for each place with friction, then those of grips. What each law says of its row is a
traced function, and so are its slopes.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Writer, machine
from gauss.codegen.kernels.arrays import Array, Routine, Value
from gauss.codegen.kernels.small_linear_systems import space, write_equations

NOTHING, HUGE = 1e-300, 1e300


@dataclass(frozen=True, eq=False)
class ContactSolver:
    """Solver of W f + b = u under one law for each row.

    Parameters
    ----------
    normal, rough, grip : Function
        What a law leaves, and its slopes: (f, u, w) → (error, its slopes over f and u) of a force along a normal;
        (two forces across, two rates, w, force along the normal, its rate, its w, friction) → (two errors, their slopes over
        the forces across, rates, force and rate along the normal); (f, u, w, limit) → as for a normal, of a grip.
    pushing, rubbing, holding : Function
        What a single row may be, the others given: f → force along a normal; (two forces, radius) → two forces across;
        (f, limit) → force of a grip.
    sweeps : tuple of int
        Sweeps of single contacts before each round of Newton steps.
    steps : int
        Newton steps in a round.
    settled, accepted : float
        Error that is aimed at, and error that is taken, times 1 + the largest rate.
    flat : float
        Of the largest diagonal entry of W: a row that is smaller is no row.
    """

    normal: Function
    rough: Function
    grip: Function
    pushing: Function
    rubbing: Function
    holding: Function
    sweeps: tuple[int, ...]
    steps: int
    settled: float
    accepted: float
    flat: float

    def room(self, rows: int) -> int:
        """Numbers of room that the machine code asks for, for so many rows."""
        return 7 * rows + rows * rows + space(rows)

    def write(self, module: ir.Module) -> ir.Function:
        """Write the solver.

        It is ``settle(i64 normals, i64 rough, i64 grips, double* W, double* b, i64* under, double* friction, double* limit,
        double* f, double* left, double* room)``: forces in ``f``, first those to start from, and in ``left`` the error of
        the laws; −1 if none were found.
        """
        kinds = [INTEGER] * 3 + [POINTER] * 2 + [INTEGER.as_pointer()] + [POINTER] * 5
        return _Writing(self, Routine(module, "settle", kinds)).write()


class _Writing:
    def __init__(self, laws: ContactSolver, r: Routine):
        self.laws, self.r = laws, r
        r.function.linkage = "internal"
        self.normals, self.rough, self.grips, self.W, self.b, self.under, self.friction, self.limit = r.arguments[:8]
        self.f, self.left, room = r.arguments[8:]
        self.held = self.normals + self.rough * 2  # where the rows of grips begin
        self.n = n = self.held + self.grips
        self.w, self.u, self.error, self.best, self.step = (room.after(n * k) for k in range(5))
        self.slope, self.work = room.after(n * 5), room.after(n * 5 + n * n)
        self.equations = write_equations(r.module)

    def write(self) -> ir.Function:
        r, laws = self.r, self.laws
        self._measure()
        scale = r.cell(0.0)
        with r.each(self.n) as i:
            scale[0] = r.larger(r.size(self.b[i]), scale[0])
            self.best[i] = self.f[i]
        scale[0] = scale[0] + 1.0
        least, done, round_ = r.cell(np.inf), r.cell(0, INTEGER), r.cell(0, INTEGER)
        times = self._table("sweeps", laws.sweeps)
        with r.loop() as leave_if:
            leave_if((round_[0] >= len(laws.sweeps)) | (done[0] > 0))
            with r.each(self.n) as i:
                self.f[i] = self.best[i]
            with r.each(times[round_[0]]):
                self._sweep()
            tries = r.cell(0, INTEGER)
            with r.loop() as leave_round_if:
                leave_round_if((tries[0] >= laws.steps) | (done[0] > 0))
                off = self._errors()
                with r.when(off < least[0]):
                    least[0] = off
                    with r.each(self.n) as i:
                        self.best[i] = self.f[i]
                with r.when(least[0] <= scale[0] * laws.settled):
                    done[0] = 1
                with r.when(done[0] < 1):
                    self._newton()
                tries[0] = tries[0] + 1
                with r.when(off >= HUGE):
                    tries[0] = laws.steps
            round_[0] = round_[0] + 1
        with r.each(self.n) as i:
            self.f[i] = self.best[i]
        self.left[0] = r.choose(least[0] <= scale[0] * laws.accepted, least[0], -1.0)
        return r.done()

    def _table(self, name: str, values) -> Array:
        kind = ir.ArrayType(INTEGER, len(values))
        table = ir.GlobalVariable(self.r.module, kind, name)
        table.initializer, table.global_constant, table.linkage = ir.Constant(kind, list(values)), True, "internal"
        return Array(self.r.b, self.r.b.gep(table, [INTEGER(0), INTEGER(0)]))

    def _measure(self):
        """Diagonal of W, one number for both directions of a place with friction; none of them is zero."""
        r, w, largest = self.r, self.w, self.r.cell(NOTHING)
        with r.each(self.n) as i:
            w[i] = self.W[i * self.n + i]
        with r.each(self.rough) as j:
            i = self.normals + j * 2
            w[i] = r.larger(w[i], w[i + 1])
            w[i + 1] = w[i]
        with r.each(self.n) as i:
            largest[0] = r.larger(w[i], largest[0])
        with r.each(self.n) as i:
            w[i] = r.larger(w[i], largest[0] * self.laws.flat)

    def _rate(self, i: Value) -> Value:
        """Rate of a row under the forces at hand."""
        return self.b[i] + self.r.sum(self.n, lambda j: self.W[i * self.n + j] * self.f[j])

    def _sweep(self):
        """Let each contact and grip in turn obey its law."""
        r, f, w = self.r, self.f, self.w
        with r.each(self.normals) as i:
            (f[i],) = r.written(self.laws.pushing, f[i] - self._rate(i) / w[i])
        with r.each(self.rough) as j:
            i = self.normals + j * 2
            moved = [f[k] - self._rate(k) / w[k] for k in (i, i + 1)]
            f[i], f[i + 1] = r.written(self.laws.rubbing, *moved, self.friction[j] * f[self.under[j]])
        with r.each(self.grips) as j:
            i = self.held + j
            (f[i],) = r.written(self.laws.holding, f[i] - self._rate(i) / w[i], self.limit[j])

    def _errors(self) -> Value:
        """Fill in what the laws leave, as forces, and its slopes; the largest of it, as a rate."""
        r, f, u, w = self.r, self.f, self.u, self.w
        with r.each(self.n) as i:
            u[i] = self._rate(i)
        with r.each(self.n * self.n) as i:
            self.slope[i] = 0.0
        with r.each(self.normals) as i:
            self.error[i], *slopes = r.written(self.laws.normal, f[i], u[i], w[i])
            self._slope(i, [i], slopes)
        with r.each(self.rough) as j:
            i, n = self.normals + j * 2, self.under[j]
            rows = (i, i + 1, n)
            known = f[i], f[i + 1], u[i], u[i + 1], w[i], f[n], u[n], w[n], self.friction[j]
            self.error[i], self.error[i + 1], *slopes = r.written(self.laws.rough, *known)
            self._slope(i, rows, slopes[:6])
            self._slope(i + 1, rows, slopes[6:])
        with r.each(self.grips) as j:
            i = self.held + j
            self.error[i], *slopes = r.written(self.laws.grip, f[i], u[i], w[i], self.limit[j])
            self._slope(i, [i], slopes)
        off, total = r.cell(0.0), r.cell(0.0)
        with r.each(self.n) as i:
            size = r.size(self.error[i] * w[i])
            off[0], total[0] = r.larger(size, off[0]), total[0] + size
        return r.choose(total[0] <= HUGE, off[0], np.inf)  # a maximum passes over what is no number

    def _slope(self, row: Value, rows, slopes):
        """Write the slopes of an error over all forces, from those over the forces and the rates of some rows."""
        r, n = self.r, self.n
        forces, rates = slopes[: len(rows)], slopes[len(rows) :]
        with r.each(n) as column:
            terms = [slope * self.W[i * n + column] for i, slope in zip(rows, rates, strict=True)]
            self.slope[column * n + row] = sum(terms[1:], terms[0])
        for i, slope in zip(rows, forces, strict=True):
            self.slope[i * n + row] = self.slope[i * n + row] + slope

    def _newton(self):
        r, step = self.r, self.step
        with r.each(self.n) as i:
            step[i] = -self.error[i]
        r.call(self.equations, self.n, self.slope, step, self.work)
        with r.each(self.n) as i:
            self.f[i] = self.f[i] + step[i]


class Solve:
    """The solver as Python calls it.

    Parameters
    ----------
    settle : ContactSolver
        What is solved.
    """

    def __init__(self, settle: ContactSolver):
        self.settle, writer = settle, Writer()
        inner = settle.write(writer.module)
        r = Routine(writer.module, "solve", [argument.type for argument in inner.args])
        r.call(inner, *r.arguments)
        r.done()
        self.code = machine.load(str(writer.module))
        self._solve = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 8)(self.code.address("solve"))

    def __call__(self, W, b, under, friction, limit, start) -> tuple[np.ndarray, float]:
        """Forces (n,) and the error of the laws, −1 if there are none.

        Parameters
        ----------
        W, b : ndarray, shape (n, n), (n,)
            Slopes and values of the rates; rows of normals first, then those across, then those of grips.
        under : ndarray of int, shape (k,)
            Row of the normal that each two rows across go with.
        friction, limit : ndarray, shape (k,), (g,)
            Coefficients of friction, limits of grips.
        start : ndarray, shape (n,)
            Forces to start from.
        """
        counts = start.size - 2 * friction.size - limit.size, friction.size, limit.size
        forces, left, room = np.array(start, dtype=float), np.empty(1), np.empty(self.settle.room(start.size))
        arrays = [np.ascontiguousarray(array, dtype=float) for array in (W, b, friction, limit)]
        arrays.insert(2, np.ascontiguousarray(under, dtype=np.int64))
        self._solve(*counts, *(array.ctypes.data for array in (*arrays, forces, left, room)))
        return forces, float(left[0])
