"""Rows of the contact problem of a mechanism: normals, other gaps, tangents of all contacts, set-valued elements.

    K = J_first − J_second,   by points and normals of the near contacts

Each row is in its unit, so that the laws compare forces and rates of all rows.
"""

from gauss.codegen import POINTER
from gauss.codegen.kernels.arrays import Array, Value
from gauss.codegen.kernels.interleaved_sums import RowBounds, higher, lower, row_products
from gauss.codegen.kernels.near_pairs import BODY, ROW, parts_of
from gauss.codegen.kernels.step_memory import StepMemory


class ContactRows:
    """Emitter of the rows of a step, and of the forces that the next step starts from.

    Parameters
    ----------
    memory : StepMemory
        Arrays of the step.
    """

    def __init__(self, memory: StepMemory):
        self.at, self.r = memory, memory.r

    def write(self, m: Value):
        """Rows: normals, other gaps, tangents of all contacts, set-valued elements; in their units, and initial forces."""
        r, n, unit = self.r, self.at.n, self.at.settings["contact_unit"]
        g, s, law, found = n["g"], n["s"], self.at.table("law"), self.at.table("found")
        body, rows = self.at.table("body"), self.at.table("rows", POINTER)
        with r.each(m) as c:
            p = found[c * 2]
            number, row = law[p] - 1, rows.after(c * ROW)
            self.at["mu"][c], self.at["e"][c] = self.at["friction"][number], self.at["restitution"][number]
            self.at["gap"][c] = row[0] * unit
            first, second = parts_of(p, n["parts"])
            bodies = body[first * BODY], body[second * BODY]
            for q in range(3):
                at = c if q == 0 else m + g + c * 2 + (q - 1)
                self._row_of_contact(at, row.after(4 + 8 * q), row[52 + q], bodies, unit)
                self.at["force"][at] = 0.0
            self._known_force(m, c)
        with r.each(g) as j:
            self.at["gap"][m + j] = self.at["flat:gap"][j] * self.at["other_unit"][j]
            self.at["e"][m + j] = self.at["other_restitution"][j]
            self._row_of_other(m + j, j, self.at["other_unit"][j])
        with r.each(s) as j:
            self._row_of_other(m * 3 + g + j, g + j, self.at["set_unit"][j])

    def _row_of_contact(self, at: Value, J: Array, bias: Value, bodies, unit: Value):
        r, n_v = self.r, self.at.n["n_v"]
        begins, ends = ([self.at.table(name)[body] for body in bodies] for name in ("body_begin", "body_end"))
        K = self.at["K"].after(at * n_v)
        with r.each(n_v) as j:
            K[j] = 0.0
        for side, body in enumerate(bodies):
            own = self.at["flat:J"].after(body * 6 * n_v)
            with r.each(ends[side], begins[side]) as j:
                total = K[j]
                for i in range(6):
                    total = total + J[24 * side + i] * own[n_v * i + j]
                K[j] = total
        begin, end = lower(*begins), higher(*ends)
        with r.each(end, begin) as j:
            K[j] = K[j] * unit
        self._bound(at, begin, end)
        rate = r.number(0.0)
        for side, body in enumerate(bodies):
            for i in range(6):
                rate = rate + J[24 * side + i] * self.at["flat:bodies"][(self.at.n["bodies"] * (12 + i)) + body]
        self.at["rate"][at], self.at["bias"][at], self.at["unit"][at] = rate * unit, bias * unit, unit

    def _row_of_other(self, at: Value, j: Value, unit: Value):
        n_v = self.at.n["n_v"]
        with self.r.each(n_v) as i:
            self.at["K"][at * n_v + i] = self.at["flat:K"][j * n_v + i] * unit
        self._bound(at, self.at.table("row_begin")[j], self.at.table("row_end")[j])
        self.at["rate"][at], self.at["bias"][at] = self.at["flat:rate"][j] * unit, self.at["flat:bias"][j] * unit
        self.at["unit"][at], self.at["force"][at] = unit, self.at["known_others"][j] / unit

    def _bound(self, at: Value, begin: Value, end: Value):
        """Keep the bounds of what differs from zero in a row."""
        self.at.table("k_begin")[at], self.at.table("k_end")[at] = begin, end

    @property
    def bounds(self) -> RowBounds:
        """Bounds of what differs from zero in the rows."""
        return RowBounds(self.at.table("k_begin"), self.at.table("k_end"))

    def products(self, count: Value, rates: Array) -> Array:
        """Products of the first rows with rates or accelerations (n_v,)."""
        row_products(self.r, self.at["K"], self.at.n["n_v"], count, rates, self.bounds, self.at["product"])
        return self.at["product"]

    def _known_force(self, m: Value, c: Value):
        """Initial forces of a contact, those of the last step."""
        r, g, unit = self.r, self.at.n["g"], self.at.settings["contact_unit"]
        known, found = self.at.table("known_found"), self.at.table("found")
        with r.each(self.at.table("known_count")[0]) as k:
            pair, feature = known[k * 2] - found[c * 2], known[k * 2 + 1] - found[c * 2 + 1]
            with r.when((pair < 1) & (pair > -1) & (feature < 1) & (feature > -1)):
                self.at["force"][c] = self.at["known"][k * 3] / unit
                with r.when(self.at["mu"][c] > 0.0):
                    for q in range(2):
                        self.at["force"][m + g + c * 2 + q] = self.at["known"][k * 3 + 1 + q] / unit

    def keep(self, m: Value):
        """Keep the forces for the next step."""
        r, n, g, known, found = self.r, self.at.n, self.at.n["g"], self.at.table("known_found"), self.at.table("found")
        with r.each(m) as c:
            known[c * 2], known[c * 2 + 1] = found[c * 2], found[c * 2 + 1]
            self.at["known"][c * 3] = self.at["force"][c] * self.at["unit"][c]
            for q in range(2):
                at = m + g + c * 2 + q
                self.at["known"][c * 3 + 1 + q] = self.at["force"][at] * self.at["unit"][at]
        with r.each(g) as j:
            self.at["known_others"][j] = self.at["force"][m + j] * self.at["unit"][m + j]
        with r.each(n["s"]) as j:
            at = m * 3 + g + j
            self.at["known_others"][g + j] = self.at["force"][at] * self.at["unit"][at]
        self.at.table("known_count")[0] = m
