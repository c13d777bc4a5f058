"""Step of a mechanism with contacts in machine code: terms, near contacts, rows, laws, and the state at the end of the step.

    v₁ = v₀ + h (q̈_free + H Kᵀ f),   H = N (Nᵀ M N)⁻¹ Nᵀ = (N C⁻ᵀ)(N C⁻ᵀ)ᵀ,   W = h Y Yᵀ,   Y = K N C⁻ᵀ

with the Cholesky factor C of Nᵀ M N. The equations are those of :mod:`gauss.dynamics.contact.mechanism_step`, whose Python
code repeats the steps that are not finished here. Kernels of the scene are called through their addresses, so that this code
holds no scene and is made once on a machine.
"""

import ctypes
from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, machine
from gauss.codegen.kernels.arrays import Array, Routine, Value
from gauss.codegen.kernels.contact_solver import ContactSolver, room_of
from gauss.codegen.kernels.near_pairs import INTEGERS, ROW, write_near

STEP = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)
SIZES = ("n_q", "n_v", "r", "bodies", "g", "s", "entries", "flat", "parts", "pairs", "capacity", "loops", "input")
ADDRESSES = (
    *("begin", "forces", "move", "entries"),
    *("body", "pair", "kind", "feature", "found", "count"),
    *("own", "signs", "deepest", "near_settings", "moved", "rows", "depth"),
    *("law", "known_found", "known_count", "under", "status", "column"),
)
FINISHED, REPEATED, IMPACT = range(3)  # status of a step: what Python does where it is not finished
STEP_SETTINGS = ("t", "h", "share", "rest", "slow", "margin", "missed", "jammed", "contact_unit")
RESULTS = ("power0", "power1", "power2", "error", "doubtful")
ROUNDS = 20  # of activating gaps
MOST_SLIDING = 6  # sliding contacts that are examined for Painlevé's paradox
POSITIVE = 1e-9  # relative to the response without friction: K + Kᵀ is positive definite beside that of round-off


def slots(n: dict[str, int]) -> dict[str, int]:
    """Lengths of the arrays of working memory by name, for the sizes of a scene; terms lie in "flat"."""
    v, r, m, others = n["n_v"], n["r"], n["capacity"], n["g"] + n["s"]
    rows = 3 * m + others
    return {
        "settings": len(STEP_SETTINGS),
        "results": len(RESULTS),
        "q": n["n_q"],
        "v": v,
        "end_q": n["n_q"],
        "end_v": v,
        "given": 1 + n["n_q"] + v + n["input"],
        "out": max(n["entries"], v + 3),
        "fixed": n["flat"],
        "flat": n["flat"],
        "reach": n["bodies"],
        "value": v,
        "C": r * r,
        "E": r * r,
        "Z": v * r,
        "a": v,
        "added": v,
        "total": v,
        "z": r,
        "friction": n["laws"] + 1,
        "restitution": n["laws"] + 1,
        "other_restitution": n["g"],
        "unit": rows,
        "other_unit": n["g"],
        "set_unit": n["s"],
        "limit": n["s"],
        "lossy": n["s"],
        "known": 3 * m,
        "known_others": others,
        "K": rows * v,
        "Y": rows * r,
        "rate": rows,
        "bias": rows,
        "gap": m + n["g"],
        "e": m + n["g"],
        "mu": m,
        "after": rows,
        "force": rows,
        "active": m + n["g"],
        "W": rows * rows,
        "b": rows,
        "f": rows,
        "active_mu": m,
        "slide": MOST_SLIDING * (2 * r + MOST_SLIDING),
        "residual": 1,
        "room": room_of(rows),
    } | {f"flat:{name}": 0 for name in TERMS}


@dataclass(frozen=True, eq=False)
class StepFunctions:
    """Traced functions of a step.

    Parameters
    ----------
    place : Function
        As of :class:`gauss.codegen.kernels.NearPairs`.
    solver : ContactSolver
        Laws of contact, friction and set-valued elements.
    impact : Function
        (gap, rate, speed, h, share) → 1 for an impact.
    plastic, elastic : Function
        (gap, rate, h, rest, share), the latter with the coefficient of restitution after the rate → least rate.
    """

    place: Function
    solver: ContactSolver
    impact: Function
    plastic: Function
    elastic: Function


class _StepWriter:
    def __init__(self, functions: StepFunctions, module: ir.Module):
        self.functions, self.module = functions, module
        self.near, self.solve = write_near(functions.place, module), functions.solver.write(module)
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGERS, INTEGERS, POINTER]), "step"))
        ints, self.addresses, self.work = r.arrays
        self.n = {name: ints[k] for k, name in enumerate(SIZES)}
        self.places = ints.after(len(SIZES))
        kinds = [INTEGER, POINTER, INTEGER, POINTER, INTEGER]
        self.kernel = ir.FunctionType(ir.VoidType(), kinds).as_pointer()
        self.names = list(slots({**dict.fromkeys(SIZES, 0), "laws": 0}))
        self.arrays = {name: self.work.after(self.places[k]) for k, name in enumerate(self.names)}
        self.settings = {name: self.arrays["settings"][k] for k, name in enumerate(STEP_SETTINGS)}
        self.remaining = self.settings["share"] * -1.0 + 1.0
        self.status = self.table("status")

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    def table(self, name: str, kind=INTEGERS) -> Array:
        """Array by its address."""
        b, address = self.r.b, self.addresses[ADDRESSES.index(name)]
        return Array(b, b.inttoptr(address.value, kind))

    def write(self):
        r, s = self.r, self.settings
        self.status[0] = REPEATED
        self._begin()
        speed = r.maximum(self._speed(self["v"]), self._speed(self["total"]))
        near = self.table("near_settings", POINTER)
        near[0] = s["margin"] * 2.0 * self.remaining * s["h"] * speed
        self._find()
        count = self.table("count")
        m = count[0]
        unknown = (count[1] > 0) | (count[2] > 0) | (m > self.n["capacity"])
        with r.when(~unknown):
            self._rows(m)
            with r.when(~(self._impact(m) > 0.0)):
                self._solve(m, speed)
        r.done()

    def _call(self, name: str, given: Array, found: Array):
        b, one = self.r.b, INTEGER(1)
        pointer = b.inttoptr(self.addresses[ADDRESSES.index(name)].value, self.kernel)
        b.call(pointer, [one, given.pointer, one, found.pointer, one])

    def _copy(self, target: Array, source: Array, count):
        with self.r.each(count) as i:
            target[i] = source[i]

    def _dot(self, one: Array, other: Array, count) -> Value:
        return self.r.sum(count, lambda i: one[i] * other[i])

    def _begin(self):
        """Terms after the share of the step, compliance, accelerations without contact forces, rates that they lead to."""
        r, n, s, given = self.r, self.n, self.settings, self["given"]
        n_q, n_v = n["n_q"], n["n_v"]
        self._copy(given, self["q"], n_q)
        with r.each(n_v) as i:
            given[n_q + i] = s["share"] * s["h"] * self["v"][i]
        self._call("move", given, self["end_q"])
        given[0] = s["t"] + s["share"] * s["h"]
        self._copy(given.after(1), self["end_q"], n_q)
        self._copy(given.after(n_q + 1), self["v"], n_v)
        self._call("begin", given, self["out"])
        self._copy(self["flat"], self["fixed"], n["flat"])
        entries = self.table("entries")
        with r.each(n["entries"]) as i:
            self["flat"][entries[i]] = self["out"][i]
        self._factor()
        self._accelerate(self["flat:tau"])
        self._copy(self["results"], self["flat:power"], 3)
        with r.when(s["share"] > 0.0):
            with r.each(n_v) as i:
                given[n_q + 1 + i] = self["v"][i] + s["share"] * s["h"] * self["a"][i]
            self._call("forces", given, self["out"])
            self._accelerate(self["out"])
            self._copy(self["results"], self["out"].after(n_v), 3)
        with r.each(n_v) as i:
            self["total"][i] = self["v"][i] + s["h"] * self["a"][i]

    def _factor(self):
        """Cholesky factor C of Nᵀ M N, and Z = N C⁻ᵀ; each row of N has one entry."""
        r, n, value, C, E, Z, M = self.r, self.n, self["value"], self["C"], self["E"], self["Z"], self["flat:M"]
        k, n_v, column = n["r"], n["n_v"], self.table("column")
        with r.each(k * k) as i:
            C[i], E[i] = 0.0, 0.0
        with r.each(n_v) as i, r.each(n_v) as j:
            at = column[i] * k + column[j]
            C[at] = C[at] + value[i] * value[j] * M[i * n_v + j]
        with r.each(k) as j:
            with r.each(j) as p:
                C[j * k + j] = C[j * k + j] - C[j * k + p] * C[j * k + p]
            C[j * k + j] = r.square_root(C[j * k + j])
            with r.each(k, j + 1) as i:
                C[i * k + j] = (C[i * k + j] - self._dot(C.after(i * k), C.after(j * k), j)) / C[j * k + j]
        with r.each(k) as i, r.each(k, i) as j:
            total = r.variable(0.0)
            with r.when(j <= i):
                total[0] = 1.0
            with r.each(j, i) as p:
                total[0] = total[0] - E[i * k + p] * C[j * k + p]
            E[i * k + j] = total[0] / C[j * k + j]
        with r.each(n_v) as i, r.each(k) as j:
            Z[i * k + j] = value[i] * E[column[i] * k + j]

    def _accelerate(self, tau: Array):
        """Accelerations a = Z Zᵀ τ."""
        r, k, n_v = self.r, self.n["r"], self.n["n_v"]
        with r.each(k) as j:
            self["z"][j] = r.sum(n_v, lambda i: self["Z"][i * k + j] * tau[i])
        self._spread(self["a"])

    def _spread(self, target: Array):
        """Accelerations Z z."""
        r, k = self.r, self.n["r"]
        with r.each(self.n["n_v"]) as i:
            target[i] = self._dot(self["Z"].after(i * k), self["z"], k)

    def _speed(self, v: Array) -> Value:
        """Largest speed of a point of a shape."""
        r, n_v, largest = self.r, self.n["n_v"], self.r.variable(0.0)
        with r.each(self.n["bodies"] - 1) as b:
            squares = []
            for half in range(2):
                total = r.variable(0.0)
                for i in range(3):
                    rate = self._dot(self["flat:J"].after((b * 6 + (3 * half + i)) * n_v), v, n_v)
                    total[0] = total[0] + rate * rate
                squares.append(r.square_root(total[0]))
            largest[0] = r.maximum(squares[1] + squares[0] * self["reach"][b], largest[0])
        return largest[0]

    def _find(self):
        n, names = self.n, ("body", "pair", "kind", "feature", "found", "count")
        integers = [self.table(name) for name in names]
        others = ("own", "signs", "deepest", "near_settings", "moved", "rows", "depth")
        doubles = [self.table(name, POINTER) for name in others]
        sizes = n["parts"], n["pairs"], n["capacity"], n["bodies"]
        self.r.call(self.near, *sizes, *integers, self["flat:bodies"], *doubles)

    def _rows(self, m: Value):
        """Rows: normals, other gaps, tangents of all contacts, set-valued elements; in their units, and initial forces."""
        r, n, unit = self.r, self.n, self.settings["contact_unit"]
        g, s, law, pair, found = n["g"], n["s"], self.table("law"), self.table("pair"), self.table("found")
        body, rows = self.table("body"), self.table("rows", POINTER)
        with r.each(m) as c:
            p = found[c * 2]
            number, row = law[p], rows.after(c * ROW)
            self["mu"][c], self["e"][c] = self["friction"][number], self["restitution"][number]
            self["gap"][c] = row[0] * unit
            bodies = body[pair[p * 3] * 2], body[pair[p * 3 + 1] * 2]
            for q in range(3):
                at = c if q == 0 else m + g + c * 2 + (q - 1)
                self._row_of_contact(at, row.after(4 + 8 * q), row[52 + q], bodies, unit)
                self["force"][at] = 0.0
            self._known_force(m, c)
        with r.each(g) as j:
            self["gap"][m + j] = self["flat:gap"][j] * self["other_unit"][j]
            self["e"][m + j] = self["other_restitution"][j]
            self._row_of_other(m + j, j, self["other_unit"][j])
        with r.each(s) as j:
            self._row_of_other(m * 3 + g + j, g + j, self["set_unit"][j])

    def _row_of_contact(self, at: Value, J: Array, bias: Value, bodies, unit: Value):
        r, n_v = self.r, self.n["n_v"]
        with r.each(n_v) as j:
            total = r.number(0.0)
            for side, body in enumerate(bodies):
                for i in range(6):
                    total = total + J[24 * side + i] * self["flat:J"][(body * 6 + i) * n_v + j]
            self["K"][at * n_v + j] = total * unit
        rate = r.number(0.0)
        for side, body in enumerate(bodies):
            for i in range(6):
                rate = rate + J[24 * side + i] * self["flat:bodies"][(self.n["bodies"] * (12 + i)) + body]
        self["rate"][at], self["bias"][at], self["unit"][at] = rate * unit, bias * unit, unit

    def _row_of_other(self, at: Value, j: Value, unit: Value):
        n_v = self.n["n_v"]
        with self.r.each(n_v) as i:
            self["K"][at * n_v + i] = self["flat:K"][j * n_v + i] * unit
        self["rate"][at], self["bias"][at] = self["flat:rate"][j] * unit, self["flat:bias"][j] * unit
        self["unit"][at], self["force"][at] = unit, self["known_others"][j] / unit

    def _known_force(self, m: Value, c: Value):
        """Initial forces of a contact, those of the last step."""
        r, g, unit = self.r, self.n["g"], self.settings["contact_unit"]
        known, found = self.table("known_found"), self.table("found")
        with r.each(self.table("known_count")[0]) as k:
            pair, feature = known[k * 2] - found[c * 2], known[k * 2 + 1] - found[c * 2 + 1]
            with r.when((pair < 1) & (pair > -1) & (feature < 1) & (feature > -1)):
                self["force"][c] = self["known"][k * 3] / unit
                with r.when(self["mu"][c] > 0.0):
                    for q in range(2):
                        self["force"][m + g + c * 2 + q] = self["known"][k * 3 + 1 + q] / unit

    def _impact(self, m: Value) -> Value:
        """Whether a gap has an impact in the rest of a step of which the bodies moved a share; then it begins anew."""
        r, s, n_v, found = self.r, self.settings, self.n["n_v"], self.r.variable(0.0)
        with r.when(s["share"] > 0.0), r.each(m + self.n["g"]) as i:
            push = self._dot(self["K"].after(i * n_v), self["a"], n_v) + self["bias"][i]
            speed = r.absolute(push) * 2.0 * s["h"] + s["rest"]
            (hit,) = r.inline(self.functions.impact, self["gap"][i], self["rate"][i], speed, s["h"], s["share"])
            found[0] = r.maximum(hit, found[0])
        with r.when(found[0] > 0.0):
            self.status[0] = IMPACT
        return found[0]

    def _solve(self, m: Value, speed: Value):
        """Forces of the active rows; further gaps become active until none closes."""
        r, n, s, n_v, g = self.r, self.n, self.settings, self.n["n_v"], self.n["g"]
        rows = m * 3 + g + n["s"]
        scale = r.variable(0.0)
        with r.each(rows) as i:
            push = self._dot(self["K"].after(i * n_v), self["a"], n_v)
            self["after"][i] = self["rate"][i] + s["h"] * (push + self.remaining * self["bias"][i])
            scale[0] = r.maximum(r.absolute(self["rate"][i]), scale[0])
        with r.each(m + g) as i:
            given = self["gap"][i], self["rate"][i], s["h"], s["rest"], s["share"]
            (plastic,) = r.inline(self.functions.plastic, *given)
            (elastic,) = r.inline(self.functions.elastic, *given[:2], self["e"][i], *given[2:])
            self["after"][i] = self["after"][i] - r.choose(self["e"][i] > 0.0, elastic, plastic)
            self["active"][i] = r.choose((self["after"][i] < 0.0) | (self["force"][i] > 0.0), 1.0, 0.0)
        again, tries, solved = r.variable(1, INTEGER), r.variable(0, INTEGER), r.variable(1.0)
        with r.loop() as leave_if:
            leave_if((again[0] < 1) | (tries[0] > ROUNDS) | (solved[0] < 0.0))
            self._solve_active(m, solved)
            again[0], tries[0] = 0, tries[0] + 1
            with r.each(m + g) as i:
                push = self._dot(self["K"].after(i * n_v), self["added"], n_v)
                closes = self["after"][i] + s["h"] * push < s["missed"] * (scale[0] + 1.0) * -1.0
                with r.when(closes & (self["active"][i] < 1.0)):
                    self["active"][i], again[0] = 1.0, 1
        with r.when((solved[0] >= 0.0) & (again[0] < 1)):
            self._finish(m, rows, speed)

    def _solve_active(self, m: Value, solved: Array):
        """Problem of the active rows, its forces, and the accelerations that they add."""
        r, n, k, n_v, g = self.r, self.n, self.n["r"], self.n["n_v"], self.n["g"]
        under, which = self.table("under"), self.table("under").after(n["capacity"] * 2)
        normals, rough, count = (r.variable(0, INTEGER) for _ in range(3))
        order = which.after(n["capacity"] * 3 + g + n["s"])
        with r.each(m + g) as i, r.when(self["active"][i] > 0.0):
            which[normals[0]], order[i] = i, normals[0]
            normals[0] = normals[0] + 1
        count[0] = normals[0]
        with r.each(m) as c, r.when((self["active"][c] > 0.0) & (self["mu"][c] > 0.0)):
            under[rough[0]], self["active_mu"][rough[0]] = order[c], self["mu"][c]
            which[count[0]], which[count[0] + 1] = m + g + c * 2, m + g + c * 2 + 1
            rough[0], count[0] = rough[0] + 1, count[0] + 2
        with r.each(n["s"]) as j:
            which[count[0]] = m * 3 + g + j
            count[0] = count[0] + 1
        total = count[0]
        with r.each(total) as i:
            row, Y = which[i], self["Y"].after(i * k)
            self["b"][i], self["f"][i] = self["after"][row], self["force"][row]
            with r.each(k) as j:
                Y[j] = 0.0
            with r.each(n_v) as p:
                entry = self["K"][row * n_v + p]
                with r.when(r.absolute(entry) > 0.0), r.each(k) as j:
                    Y[j] = Y[j] + entry * self["Z"][p * k + j]
            with r.each(i + 1) as j:
                value = self._dot(Y, self["Y"].after(j * k), k) * self.settings["h"]
                self["W"][i * total + j], self["W"][j * total + i] = value, value
        self["residual"][0] = 0.0
        with r.when(total > 0):
            sizes = normals[0], rough[0], n["s"]
            r.call(
                self.solve,
                *(*sizes, self["W"], self["b"], under, self["active_mu"], self["limit"]),
                *(self["f"], self["residual"], self["room"]),
            )
        solved[0] = self["residual"][0]
        with r.each(m * 3 + g + n["s"]) as i:
            self["force"][i] = 0.0
        with r.each(k) as j:
            self["z"][j] = 0.0
        with r.each(total) as i:
            self["force"][which[i]] = self["f"][i]
            with r.each(k) as j:
                self["z"][j] = self["z"][j] + self["f"][i] * self["Y"][i * k + j]
        self._jams(normals[0], total, which, solved)
        self._spread(self["added"])

    def _jams(self, normals: Value, total: Value, which: Array, solved: Array):
        """Leave the step to Python if a normal force moves nothing, because the loop constraints forbid it."""
        r, s, n_v = self.r, self.settings, self.n["n_v"]
        with r.when(self.n["loops"] > 0), r.each(normals) as i:
            alone = r.variable(0.0)
            with r.each(n_v) as j:
                inertia, entry = self["flat:M"][j * n_v + j], self["K"][which[i] * n_v + j]
                with r.when(inertia > 0.0):
                    alone[0] = alone[0] + entry * entry / inertia
            response = self["W"][i * total + i]
            with r.when((r.absolute(self["f"][i]) > 0.0) & (response <= s["jammed"] * s["h"] * alone[0])):
                solved[0] = -1.0

    def _finish(self, m: Value, rows: Value, speed: Value):
        """State at the end of the step, power, and the forces to be known in the next step."""
        r, n, s, n_v, g = self.r, self.n, self.settings, self.n["n_v"], self.n["g"]
        given, results = self["given"], self["results"]
        with r.each(n_v) as i:
            acceleration = self["a"][i] + self["added"][i]
            self["end_v"][i] = self["v"][i] + s["h"] * acceleration
            self["total"][i] = self["v"][i] + s["h"] * 0.5 * acceleration
        lossy, other = r.variable(0.0), r.variable(0.0)
        with r.each(rows) as i:
            work = self["force"][i] * self._dot(self["K"].after(i * n_v), self["total"], n_v)
            with r.when(i < m * 3 + g):
                lossy[0] = lossy[0] + work
            with r.when(i >= m * 3 + g):
                share = self["lossy"][i - (m * 3 + g)]
                lossy[0], other[0] = lossy[0] + work * share, other[0] + work * (share * -1.0 + 1.0)
        results[0], results[2] = results[0] + other[0], results[2] - lossy[0]
        results[3], results[4] = self["residual"][0], 0.0
        self._slides(m)
        fits = self._speed(self["end_v"]) <= s["margin"] * speed
        with r.when(fits):
            self._copy(given, self["end_q"], n["n_q"])
            with r.each(n_v) as i:
                given[n["n_q"] + i] = self.remaining * s["h"] * self["end_v"][i]
            self._call("move", given, self["end_q"])
            self._keep(m)
            self.status[0] = FINISHED

    def _slides(self, m: Value):
        """Whether K + Kᵀ is not positive definite, K the response to forces n + μ t of sliding contacts (Painlevé)."""
        r, k, g, s, mu = self.r, self.n["r"], self.n["g"], self.settings, self["mu"]
        count, doubtful = r.variable(0, INTEGER), r.variable(0.0)
        with r.each(m) as c:
            t = m + g + c * 2
            one, other = self["rate"][t], self["rate"][t + 1]
            speed = r.square_root(one * one + other * other)
            slides = (speed > s["slow"]) & (mu[c] > 0.0) & (self["force"][c] > 0.0)
            with r.when(slides & (count[0] < MOST_SLIDING)):
                self._respond(self["slide"].after(count[0] * k * 2), c, t, -(mu[c] * one / speed), -(mu[c] * other / speed))
                count[0] = count[0] + 1
        total, S = count[0], self["slide"].after(k * (2 * MOST_SLIDING))
        with r.each(total) as i, r.each(i + 1) as j:
            (smooth, rubbed), (own, pushed) = (
                (self["slide"].after(a * k * 2), self["slide"].after(a * k * 2 + k)) for a in (i, j)
            )
            found = r.variable(0.0)
            found[0] = self._dot(smooth, pushed, k) + self._dot(own, rubbed, k)
            with r.when(i <= j):
                found[0] = found[0] + self._dot(smooth, smooth, k) * POSITIVE
            with r.each(j) as p:
                found[0] = found[0] - S[i * MOST_SLIDING + p] * S[j * MOST_SLIDING + p]
            with r.when(i > j):
                S[i * MOST_SLIDING + j] = found[0] / S[j * MOST_SLIDING + j]
            with r.when(i <= j):
                S[i * MOST_SLIDING + i] = r.square_root(found[0])
                with r.when(~(found[0] > 0.0)):
                    doubtful[0] = 1.0
        self["results"][4] = doubtful[0]

    def _respond(self, target: Array, c: Value, t: Value, along: Value, aside: Value):
        """Rows Zᵀ Kᵀ of the normal of a contact, and of its normal with friction."""
        k, n_v, K = self.n["r"], self.n["n_v"], self["K"]
        with self.r.each(k) as j:
            target[j], target[k + j] = 0.0, 0.0
        with self.r.each(n_v) as p, self.r.each(k) as j:
            normal, Z = K[c * n_v + p], self["Z"][p * k + j]
            rubbed = normal + along * K[t * n_v + p] + aside * K[(t + 1) * n_v + p]
            target[j], target[k + j] = target[j] + normal * Z, target[k + j] + rubbed * Z

    def _keep(self, m: Value):
        r, n, g, known, found = self.r, self.n, self.n["g"], self.table("known_found"), self.table("found")
        with r.each(m) as c:
            known[c * 2], known[c * 2 + 1] = found[c * 2], found[c * 2 + 1]
            self["known"][c * 3] = self["force"][c] * self["unit"][c]
            for q in range(2):
                at = m + g + c * 2 + q
                self["known"][c * 3 + 1 + q] = self["force"][at] * self["unit"][at]
        with r.each(g) as j:
            self["known_others"][j] = self["force"][m + j] * self["unit"][m + j]
        with r.each(n["s"]) as j:
            at = m * 3 + g + j
            self["known_others"][g + j] = self["force"][at] * self["unit"][at]
        self.table("known_count")[0] = m


TERMS = ("M", "tau", "power", "bodies", "J", "gap", "rate", "K", "bias")  # of the mechanism, in this order


class CompiledMechanismStep:
    """Python interface.

    Parameters
    ----------
    functions : StepFunctions
        Traced functions.
    """

    def __init__(self, functions: StepFunctions):
        module = ir.Module(name="gauss")
        _StepWriter(functions, module).write()
        self.code = machine.load(str(module))
        self._bind()

    def _bind(self):
        self._step = self.code.entry("step", STEP)

    def __getstate__(self) -> dict:
        return {"code": self.code}

    def __setstate__(self, state: dict):
        vars(self).update(state)
        self._bind()

    def __call__(self, ints: int, addresses: int, work: int):
        """Take a step; sizes and places, addresses, and working memory, each by its address."""
        self._step.call(ints, addresses, work)
