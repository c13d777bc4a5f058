"""Free motion of a mechanism: terms after the share of a step, accelerations a = Z Zᵀ τ without contact forces.

    H = N (Nᵀ M N)⁻¹ Nᵀ = Z Zᵀ,   Z = N C⁻ᵀ

with the Cholesky factor C of Nᵀ M N; N are the rates of independent coordinates, given by its entries alone.
"""

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Value, subroutine
from gauss.codegen.kernels.interleaved_sums import RowBounds, each_sum, higher, row_products
from gauss.codegen.kernels.step_memory import StepMemory

# Sum of h d over the inertias that single forces meet, above which damping of joints is implicit. It bounds the largest rate
# of decay times the step: explicit steps diverge beyond 2, and overshoot beyond 1.
STIFF_DAMPING = 1.0
SPEED = "speed"  # function of a module


def implicit_inertia(inertia, damped, maximum):
    """Inertia max(M + ½ h d, h d) of a coordinate in a step of length h with damping d, from M and h d.

    See :mod:`gauss.dynamics.contact.implicit_damping`.
    """
    return maximum(inertia + damped * 0.5, damped)


class FreeMotion:
    """Emitter of the terms of a step.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    """

    def __init__(self, memory: StepMemory):
        self.at, self.r = memory, memory.r

    def begin(self):
        """Terms after the share of the step, compliance, accelerations without contact forces, rates at the end by these."""
        r, n, s, given = self.r, self.at.n, self.at.settings, self.at["given"]
        n_q, n_v = n["n_q"], n["n_v"]
        self.at.copy(given, self.at["q"], n_q)
        with r.each(n_v) as i:
            given[n_q + i] = s["share"] * s["h"] * self.at["v"][i]
        self.at.call("move", given, self.at["end_q"])
        given[0] = s["t"] + s["share"] * s["h"]
        self.at.copy(given.after(1), self.at["end_q"], n_q)
        self.at.copy(given.after(n_q + 1), self.at["v"], n_v)
        self.at.call("begin", given, self.at["out"])
        with r.each(n_v) as i:  # of all constants, implicit damping alone changes some
            self.at["flat:M"][i * n_v + i] = self.at["fixed:M"][i * n_v + i]
        entries = self.at.table("entries")
        with r.each(n["entries"]) as i:
            self.at["flat"][entries[i]] = self.at["out"][i]
        self._factor_with_damping()
        self._accelerate(self.at["flat:tau"])
        self.at.copy(self.at["results"], self.at["flat:power"], 3)
        self._without_damping_at(self.at["v"])
        with r.each(n_v) as i:
            self.at["total"][i] = self.at["v"][i] + s["h"] * self.at["a"][i]

    def at_later_rates(self, rows: Value):
        """Accelerations and powers at the rates after the share, where the forces of the last step are expected."""
        r, n, s, given, added = self.r, self.at.n, self.at.settings, self.at["given"], self.at["added"]
        n_q, n_v = n["n_q"], n["n_v"]
        with r.when(s["share"] > 0.0):
            self.at.copy(added, self.at["flat:tau"], n_v)
            with r.when(self.at["before"][0] > 0.0), r.each(rows) as row:
                force = self.at["force"][row]
                with r.when(r.absolute(force) > 0.0), r.each(n_v) as i:
                    added[i] = added[i] + force * self.at["K"][row * n_v + i]
            self._accelerate(added)
            with r.each(n_v) as i:
                given[n_q + 1 + i] = self.at["v"][i] + s["share"] * s["h"] * self.at["a"][i]
            self.at.call("forces", given, self.at["out"])
            ahead, damping = given.after(n_q + 1), self.at["damping"]
            with r.when(self.at["stiff"][0] > 0.0), r.each(n_v) as i:
                self.at["out"][i] = self.at["out"][i] + damping[i] * (ahead[i] - self.at["v"][i])
            self._accelerate(self.at["out"])
            self.at.copy(self.at["results"], self.at["out"].after(n_v), 3)
            self._without_damping_at(ahead)

    def _factor_with_damping(self):
        """Factors of the inertias; where damping of joints is stiff, with what makes it implicit."""
        r, k, again, stiff = self.r, self.at.n["r"], self.r.variable(1, INTEGER), self.at["stiff"]
        stiff[0] = 0.0
        with r.loop() as leave_if:
            leave_if(again[0] < 1)
            again[0] = 0
            self._factor()
            with r.when(stiff[0] < 1.0):
                total = r.variable(0.0)
                with r.each(self.at.n["n_v"]) as i, r.when(self.at["damping"][i] > 0.0):
                    row = self.at["Z"].after(i * k)
                    total[0] = total[0] + self.at["damping"][i] * self.at.dot(row, row, k)
                with r.when(total[0] * self.at.settings["h"] > STIFF_DAMPING):
                    stiff[0], again[0] = 1.0, 1
                    self._add_damping()

    def _add_damping(self):
        """Add what makes damping of joints implicit to their inertias."""
        r, n_v, M = self.r, self.at.n["n_v"], self.at["flat:M"]
        with r.each(n_v) as i, r.when(self.at["damping"][i] > 0.0):
            own = M[i * n_v + i]
            whole = implicit_inertia(own, self.at["damping"][i] * self.at.settings["h"], r.maximum)
            self.at["implicit"][i] = whole - own
            M[i * n_v + i] = whole

    def _without_damping_at(self, v: Array):
        """Leave stiff damping at some rates out of the dissipation."""
        r, results, damping = self.r, self.at["results"], self.at["damping"]
        with r.when(self.at["stiff"][0] > 0.0), r.each(self.at.n["n_v"]) as i:
            results[2] = results[2] - damping[i] * v[i] * v[i]

    def add_damping_over(self, middle: Array):
        """Add the dissipation of stiff damping over a step with mean rates ``middle``."""
        r, at, results, damping = self.r, self.at, self.at["results"], self.at["damping"]
        with r.when(at["stiff"][0] > 0.0), r.each(at.n["n_v"]) as i:
            force = damping[i] * at["v"][i] + at["implicit"][i] * (at["a"][i] + at["added"][i])
            results[2] = results[2] + force * middle[i]

    def _factor(self):
        """Cholesky factor C of Nᵀ M N, and Z = N C⁻ᵀ."""
        r, n = self.r, self.at.n
        value, C, E, Z, M = (self.at[name] for name in ("value", "C", "E", "Z", "flat:M"))
        k, n_v, links, row, column = n["r"], n["n_v"], n["links"], self.at.table("row"), self.at.table("column")
        first, least = self.at.table("first"), self.at.table("lowest")
        gathered, weight = self.at.table("gathered"), self.at["weight"]
        with r.each(k * k) as i:
            C[i] = 0.0
        with r.each(n["gathers"]) as i:
            at = gathered[i * 2]
            C[at] = C[at] + weight[i] * M[gathered[i * 2 + 1]]
        with r.each(k) as j:
            begin, own, row_of = first[j], j * k + j, C.after(j * k)
            with r.each(j, begin) as p:
                C[own] = C[own] - row_of[p] * row_of[p]
            C[own] = r.square_root(C[own])
            each_sum(
                r,
                k,
                lambda lanes: (begin, j),
                lambda total, i, p: total + C[i * k + p] * row_of[p],
                lambda i, total: C.__setitem__(i * k + j, (C[i * k + j] - total) / C[own]),
                first=j + 1,
            )
        with r.each(k) as j:
            begin, own, row_of = first[j], j * k + j, C.after(j * k)
            each_sum(
                r,
                j + 1,
                lambda lanes: (higher(begin, lanes[0]), j),
                lambda total, i, p: total - E[i * k + p] * row_of[p],
                lambda i, total: E.__setitem__(i * k + j, total / C[own]),
                first=least[j],
                initial=lambda i: r.choose(i >= j, 1.0, 0.0),
            )
        z_begin, z_end = self.at.table("z_begin"), self.at.table("z_end")
        with r.each(n_v) as i, r.each(z_end[i], z_begin[i]) as j:
            Z[i * k + j] = 0.0
        with r.each(links) as i, r.each(z_end[row[i]], column[i]) as j:
            at = row[i] * k + j
            Z[at] = Z[at] + value[i] * E[column[i] * k + j]

    def _accelerate(self, tau: Array):
        """Accelerations a = Z Zᵀ τ."""
        r, k, z, begin, end = self.r, self.at.n["r"], self.at["z"], self.at.table("z_begin"), self.at.table("z_end")
        with r.each(k) as j:
            z[j] = 0.0
        with r.each(self.at.n["n_v"]) as i:
            row, push = self.at["Z"].after(i * k), tau[i]
            with r.each(end[i], begin[i]) as j:
                z[j] = z[j] + row[j] * push
        self.spread(self.at["a"])

    def spread(self, target: Array):
        """Accelerations Z z."""
        at = self.at
        bounds = RowBounds(at.table("z_begin"), at.table("z_end"))
        row_products(self.r, at["Z"], at.n["r"], at.n["n_v"], at["z"], bounds, target)

    def speed(self, v: Array) -> Value:
        """Largest speed of a point of a shape."""
        r, at, found = self.r, self.at, self.r.buffer(1)
        bodies = at.n["bodies"] - 1, at.n["n_v"], at["flat:J"], at["reach"], at.table("body_begin"), at.table("body_end")
        r.call(r.module.globals.get(SPEED) or _write_speed(r.module), *bodies, v, found)
        return found[0]


def _write_speed(module: ir.Module) -> ir.Function:
    """Emit the largest speed of a point of a shape, by Jacobians of bodies and the reach of their shapes."""
    kinds = [INTEGER, INTEGER, POINTER, POINTER, INTEGERS, INTEGERS, POINTER, POINTER]
    r = subroutine(module, SPEED, kinds)
    (bodies, n_v), (J, reach, begin, end, v, found) = r.integers, r.arrays
    largest = r.variable(0.0)
    with r.each(bodies) as b:
        rates = [r.variable(0.0) for _ in range(6)]
        with r.each(end[b], begin[b]) as p:
            for i, rate in enumerate(rates):
                rate[0] = rate[0] + J[(b * 6 + i) * n_v + p] * v[p]
        squares = []
        for half in range(2):
            total = r.number(0.0)
            for rate in rates[3 * half : 3 * half + 3]:
                total = total + rate[0] * rate[0]
            squares.append(r.square_root(total))
        largest[0] = r.maximum(squares[1] + squares[0] * reach[b], largest[0])
    found[0] = largest[0]
    return r.done()
