"""Painlevé's paradox: principal minors of K are negative, the response of gaps to forces n + μ t of sliding contacts.

They are not where K + Kᵀ is positive definite, which is tested first.
"""

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.step_memory import MOST_SLIDING, StepMemory

POSITIVE = 1e-9  # relative to the response without friction: K + Kᵀ is positive definite beside that of round-off


class SlidingContacts:
    """Emitter of the examination of sliding contacts.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    """

    def __init__(self, memory: StepMemory):
        self.at, self.r = memory, memory.r

    def examine(self, m: Value):
        """Whether K + Kᵀ is not positive definite, K the response to forces n + μ t of sliding contacts (Painlevé)."""
        r, k, g, s, mu = self.r, self.at.n["r"], self.at.n["g"], self.at.settings, self.at["mu"]
        count, doubtful = r.variable(0, INTEGER), r.variable(0.0)
        with r.each(m) as c:
            t = m + g + c * 2
            one, other = self.at["rate"][t], self.at["rate"][t + 1]
            speed = r.square_root(one * one + other * other)
            slides = (speed > s["slow"]) & (mu[c] > 0.0) & (self.at["force"][c] > 0.0)
            with r.when(slides & (count[0] < MOST_SLIDING)):
                along, aside = -(mu[c] * one / speed), -(mu[c] * other / speed)
                self._respond(self.at["slide"].after(count[0] * k * 2), c, t, along, aside)
                count[0] = count[0] + 1
        total, S = count[0], self.at["slide"].after(k * (2 * MOST_SLIDING))
        with r.each(total) as i, r.each(i + 1) as j:
            (smooth, rubbed), (own, pushed) = (
                (self.at["slide"].after(a * k * 2), self.at["slide"].after(a * k * 2 + k)) for a in (i, j)
            )
            found = r.variable(0.0)
            found[0] = self.at.dot(smooth, pushed, k) + self.at.dot(own, rubbed, k)
            with r.when(i <= j):
                found[0] = found[0] + self.at.dot(smooth, smooth, k) * POSITIVE
            with r.each(j) as p:
                found[0] = found[0] - S[i * MOST_SLIDING + p] * S[j * MOST_SLIDING + p]
            with r.when(i > j):
                S[i * MOST_SLIDING + j] = found[0] / S[j * MOST_SLIDING + j]
            with r.when(i <= j):
                S[i * MOST_SLIDING + i] = r.square_root(found[0])
                with r.when(~(found[0] > 0.0)):
                    doubtful[0] = 1.0
        with r.when(doubtful[0] > 0.0):
            doubtful[0] = 0.0
            self._find_negative_minor(total, doubtful)
        self.at["results"][4] = doubtful[0]

    def _find_negative_minor(self, total: Value, found: Array):
        """Set ``found`` if a principal minor of K is negative: some contacts have no forces, or several."""
        r, k, slide = self.r, self.at.n["r"], self.at["slide"]
        K, own = r.buffer(MOST_SLIDING * MOST_SLIDING), r.buffer(MOST_SLIDING)
        with r.each(total) as i:
            own[i] = self.at.dot(slide.after(i * k * 2), slide.after(i * k * 2), k)
            with r.each(total) as j:
                K[i * MOST_SLIDING + j] = self.at.dot(slide.after(i * k * 2), slide.after(j * k * 2 + k), k)
        chosen, sets = r.buffer(MOST_SLIDING, INTEGER), Value(r.b, r.b.shl(INTEGER(1), total.value))
        with r.each(sets, 1) as some, r.when(found[0] < 1.0):
            n, size = r.variable(0, INTEGER), r.variable(POSITIVE)
            with r.each(total) as i:
                bit = Value(r.b, r.b.and_(r.b.lshr(some.value, i.value), INTEGER(1)))
                with r.when(bit > 0):
                    chosen[n[0]] = i
                    n[0], size[0] = n[0] + 1, size[0] * own[i]
            with r.when(self._determinant(K, chosen, n[0]) <= -size[0]):
                found[0] = 1.0

    def _determinant(self, K: Array, chosen: Array, n: Value) -> Value:
        """Determinant of chosen rows and columns, by elimination with row pivots."""
        r, A, found = self.r, self.r.buffer(MOST_SLIDING * MOST_SLIDING), self.r.variable(1.0)
        with r.each(n) as i, r.each(n) as j:
            A[i * MOST_SLIDING + j] = K[chosen[i] * MOST_SLIDING + chosen[j]]
        with r.each(n) as p:
            best = r.variable(p, INTEGER)
            with r.each(n, p + 1) as i:
                larger = r.absolute(A[i * MOST_SLIDING + p]) > r.absolute(A[best[0] * MOST_SLIDING + p])
                with r.when(larger):
                    best[0] = i
            with r.when(best[0] > p):
                found[0] = -found[0]
                with r.each(n) as j:
                    one, other = A[p * MOST_SLIDING + j], A[best[0] * MOST_SLIDING + j]
                    A[p * MOST_SLIDING + j], A[best[0] * MOST_SLIDING + j] = other, one
            pivot = A[p * MOST_SLIDING + p]
            found[0] = found[0] * pivot
            with r.when(r.absolute(pivot) > 0.0), r.each(n, p + 1) as i:
                factor = A[i * MOST_SLIDING + p] / pivot
                with r.each(n, p) as j:
                    A[i * MOST_SLIDING + j] = A[i * MOST_SLIDING + j] - factor * A[p * MOST_SLIDING + j]
        return found[0]

    def _respond(self, target: Array, c: Value, t: Value, along: Value, aside: Value):
        """Rows Zᵀ Kᵀ of the normal of a contact, and of its normal with friction."""
        k, n_v, K = self.at.n["r"], self.at.n["n_v"], self.at["K"]
        with self.r.each(k) as j:
            target[j], target[k + j] = 0.0, 0.0
        with self.r.each(n_v) as p, self.r.each(k) as j:
            normal, Z = K[c * n_v + p], self.at["Z"][p * k + j]
            rubbed = normal + along * K[t * n_v + p] + aside * K[(t + 1) * n_v + p]
            target[j], target[k + j] = target[j] + normal * Z, target[k + j] + rubbed * Z
