"""Compliance of a system in a step in which stiff damping of joints is implicit, in machine code.

    H' = (H⁻¹ + D)⁻¹ = H − Hₛᵀ P Hₛ,   P = (D⁻¹ + Hₛₛ)⁻¹,   of which the rows s are D⁻¹ P Hₛ

with the inertias D that the damping adds to some coordinates s (Sherman–Morrison–Woodbury); H may be that of a system with
loops. The second form of the rows holds no difference, and is exact however stiff the damping is. Where it is not stiff, D
and P are zero, and H stays as it is, to the last bit.
"""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import NativeFunction, Writer
from gauss.codegen.kernels.arrays import Array, Routine, routine
from gauss.codegen.kernels.free_motion import STIFF_DAMPING, implicit_inertia


@dataclass(frozen=True, eq=False)
class DampedCompliance(NativeFunction):
    """Function of the compliance H (n, n), the inertias of the damped coordinates (s,) and the step h.

    Results are H' (n, n), P (s, s), the inertias D (s,), and 1 where the damping is stiff, 0 else.

    Parameters
    ----------
    freedoms : int
        Number of coordinates n.
    places : ndarray of int, shape (s,)
        Damped ones.
    damping : ndarray, shape (s,)
        Their damping, above zero.
    """

    freedoms: int
    places: np.ndarray
    damping: np.ndarray
    name = "damped_compliance"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        square, s = self.freedoms**2, self.places.size
        return square + s + 1, square + s * s + s + 1

    def operations(self) -> dict[str, int]:
        """Approximate number of operations, where the damping is stiff."""
        return {"mul": self.places.size * (self.freedoms**2 + self.freedoms * self.places.size)}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        r, source, target = routine(self, writer.module, width)
        n, s, results = self.freedoms, self.places.size, self.arity[1]
        given, found = r.buffer(len(self.inputs)), r.buffer(results)  # contiguous: the vectors of the caller may not be
        with r.each(len(self.inputs)) as k:
            given[k] = source[k]
        total = r.variable(0.0)
        for place, d in zip(self.places.tolist(), self.damping.tolist(), strict=True):
            total[0] = total[0] + given[place * n + place] * d
        is_stiff = total[0] * given[n * n + s] > STIFF_DAMPING
        with r.each(n * n) as k:
            found[k] = given[k]
        with r.each(results, n * n) as k:
            found[k] = 0.0
        with r.when(is_stiff):
            found[results - 1] = 1.0
            self._add(r, given, found)
        with r.each(results) as k:
            target[k] = found[k]
        return r.done()

    def _add(self, r: Routine, given: Array, found: Array):
        """Add the inertias D to the compliance."""
        n, s = self.freedoms, self.places.size
        h, L, X, D = given[n * n + s], r.buffer(s * s), r.buffer(s * (n + s)), r.buffer(s)
        rows = r.buffer(s * n)
        for k, (place, d) in enumerate(zip(self.places.tolist(), self.damping.tolist(), strict=True)):
            own = given[n * n + k]
            D[k] = implicit_inertia(own, h * d, r.maximum) - own
            with r.each(n) as j:
                rows[k * n + j] = given[place * n + j]
            for i, other in enumerate(self.places.tolist()):
                L[k * s + i], X[k * (n + s) + n + i] = given[place * n + other], 1.0 if i == k else 0.0
            L[k * s + k] = L[k * s + k] + r.number(1.0) / D[k]
        with r.each(s) as k, r.each(n) as j:
            X[k * (n + s) + j] = rows[k * n + j]
        self._solve(r, L, X)
        with r.each(s) as k:
            found[k + (n * n + s * s)] = D[k]
            with r.each(s) as i:
                found[k * s + i + n * n] = X[k * (n + s) + n + i]
        with r.each(n) as i, r.each(n) as j:
            found[i * n + j] = given[i * n + j] - r.sum(s, lambda k: rows[k * n + i] * X[k * (n + s) + j])  # noqa: B023
        for k, place in enumerate(self.places.tolist()):
            with r.each(n) as j:
                entry = X[k * (n + s) + j] / D[k]
                found[j + place * n], found[j * n + place] = entry, entry

    def _solve(self, r: Routine, L: Array, X: Array):
        """Cholesky's factor L of D⁻¹ + Hₛₛ in its place, and X = P (Hₛ, 1) in that of (Hₛ, 1)."""
        s, m = self.places.size, self.freedoms + self.places.size
        with r.each(s) as j:
            L[j * s + j] = r.square_root(L[j * s + j] - r.sum(j, lambda p: L[j * s + p] * L[j * s + p]))
            with r.each(s, j + 1) as i:
                known = r.sum(j, lambda p: L[i * s + p] * L[j * s + p])  # noqa: B023
                L[i * s + j] = (L[i * s + j] - known) / L[j * s + j]
            with r.each(m) as c:
                known = r.sum(j, lambda p: L[j * s + p] * X[p * m + c])  # noqa: B023
                X[j * m + c] = (X[j * m + c] - known) / L[j * s + j]
        with r.each(s) as k, r.each(m) as c:
            j = k * -1 + (s - 1)
            known = r.sum(k, lambda q: L[(j + 1 + q) * s + j] * X[(j + 1 + q) * m + c])  # noqa: B023
            X[j * m + c] = (X[j * m + c] - known) / L[j * s + j]
