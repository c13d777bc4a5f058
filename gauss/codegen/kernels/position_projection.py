"""Projection of the positions of free bodies at the end of a compiled step: no shape is left in another one.

The least displacement in the metric of the masses, as of :mod:`gauss.dynamics.contact.position_projection`: the contact
problem of a step without friction, of bodies at rest. Rates and forces of the step stay as they are.
"""

from llvmlite import ir

from gauss.codegen import POINTER
from gauss.codegen.kernels.arrays import Value
from gauss.codegen.kernels.block_contacts import CONTACT
from gauss.codegen.kernels.free_body_poses import COORDINATES, RATES, STEP, BodiesOfStep, FreeBodyFunctions
from gauss.codegen.kernels.near_pairs import ROW
from gauss.codegen.kernels.step_memory import RESULTS
from gauss.codegen.kernels.vectors import SIX

DOUBT = 0.5  # of the second derivative of a gap: what an impact is supposed to change of it, before it is looked at
REACH = 2.0  # of the deepest penetration: contacts that near are kept open, too
LARGEST_MOVE = 10.0  # of the deepest penetration: a larger displacement comes of contacts that are nearly opposite


class _PositionProjectionWriter(BodiesOfStep):
    def write(self) -> ir.Function:
        r, at, s, n = self.r, self.at, self.settings, self.at.n
        error, count = at["results"].after(RESULTS.index("error")), at.table("count")
        kept = r.variable(error[0])
        at.copy(at["q"], at["end_q"], n["n_q"])  # the loop of steps does so in any case
        with r.each(n["n_v"]) as i:
            at["v"][i] = 0.0
        for name, value in (("h", 0.0), ("share", 0.0)):
            self.set(name, value)
        r.call(self.shared[0], *r.arrays)
        for name in ("h", "share"):
            self.set(name, s[name])
        at.table("near_settings", POINTER)[0] = s["deepest"] * REACH
        self.find()
        m, deepest = count[0], r.variable(0.0)
        with r.when(~((count[1] > 0) | (count[2] > 0) | (m > n["capacity"]))):
            with r.each(m) as c:
                self.touch(c)
                deepest[0] = r.maximum(at.table("rows", POINTER)[c * ROW] * -1.0, deepest[0])
            with r.when(deepest[0] > s["accepted"]):
                r.call(self.shared[1], *r.arrays)
                with r.each(m) as c:
                    self._row(c)
                solved = self.islands.solve()
                with r.when(solved & (s["h"] * self.speed("added") <= s["deepest"] * LARGEST_MOVE)):
                    with r.each(n["n"]) as k:
                        self._move(k)
        error[0] = kept[0]
        return r.done()

    def _row(self, c: Value):
        """Jacobian and gap of a contact at its place in islands: the rate that closes it within a step."""
        at, place = self.at, self.islands.contact[c]
        row = at.table("rows", POINTER).after(c * ROW)
        at.copy(at["J"].after(place * CONTACT), row.after(4), CONTACT)
        at["mu"][place] = 0.0
        for q in range(3):
            at["f"][place * 3 + q], at["b"][place * 3 + q] = 0.0, row[0] / self.settings["h"] if q == 0 else 0.0

    def _move(self, k: Value):
        """Coordinates of a body after the displacement; of one that has none as they are."""
        r, at, start = self.r, self.at, self.at.table("q_start")[k]
        added, size = self.twist("added", k), r.variable(0.0)
        for value in added:
            size[0] = size[0] + r.absolute(value)
        with r.when(size[0] > 0.0):
            own, zero = at["constants"].after(k * at.n["constants"]), r.number(0.0)
            constants = len(self.functions.end.inputs) - COORDINATES - RATES - SIX - 2
            given = [*self.joint("q", k, COORDINATES), *[zero] * RATES, *(own[i] for i in range(constants)), *added]
            found = r.inline(self.functions.end, *given, self.settings["h"], zero)
            for i in range(COORDINATES):
                at["end_q"][start + i] = found[i]


def write_position_projection(
    functions: FreeBodyFunctions, shared: tuple[ir.Function, ...], module: ir.Module
) -> ir.Function:
    """Emit ``project``, whose arguments are those of a step; it changes the coordinates at its end."""
    function = ir.Function(module, STEP, "project")
    function.linkage = "internal"
    return _PositionProjectionWriter(functions, shared, function).write()
