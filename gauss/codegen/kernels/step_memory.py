"""Working memory of the step of a mechanism, and its view in the emitted code: sizes, addresses, arrays by name.

All arrays of doubles lie in one block, at places that depend on the sizes of a scene; arrays of integers, kernels of the
scene and those of the search for near contacts are reached by a table of addresses.
"""

from collections.abc import Callable
from typing import NamedTuple

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import Array, Routine, Value
from gauss.codegen.kernels.contact_solver import room_of
from gauss.codegen.kernels.near_pairs import BODY, INTEGERS, NEAR_INTEGERS, NEAR_NUMBERS, parts_of

SIZES = (
    *("n_q", "n_v", "r", "links", "bodies", "g", "s", "entries", "flat", "parts", "pairs", "capacity", "loops", "input"),
    *("laws", "sleepers", "gathers"),
)
PATTERNS = (  # which terms may differ from zero: of gauss.dynamics.contact.step_patterns
    *("gathered", "first", "lowest", "z_begin", "z_end", "body_begin", "body_end", "row_begin", "row_end"),
)
ADDRESSES = (
    *("begin", "forces", "move", "entries"),
    *NEAR_INTEGERS,
    *NEAR_NUMBERS,
    *("known_found", "known_count", "under", "status", "row", "column", "asleep"),
    *(*PATTERNS, "k_begin", "k_end"),
    *("modes", "next_modes", "closed", "fresh", "counts"),
)
TERMS = ("M", "tau", "power", "bodies", "J", "gap", "rate", "K", "bias")  # of the mechanism, in this order
FINISHED, REPEATED, IMPACT = range(3)  # status of a step: what Python does where it is not finished
STEP_SETTINGS = ("t", "h", "share", "rest", "slow", "margin", "missed", "jammed", "most_bent", "contact_unit", "removal")
LOOP_SETTINGS = ("pace", "resting", "sliding", "shares", "recorded", "largest")
CHANGE = 5  # step, element, its mode, whether it had an impact, energy lost
CHANGES_ROOM = 256  # changes of the contact mode that are kept, beside those of one step
RESULTS = ("power0", "power1", "power2", "error", "doubtful", "fastest")
MOST_SLIDING = 6  # sliding contacts that are examined for Painlevé's paradox


def slots(n: dict[str, int]) -> dict[str, int]:
    """Lengths of the arrays of working memory by name, for the sizes of a scene; terms lie in "flat"."""
    v, r, m, others = n["n_v"], n["r"], n["capacity"], n["g"] + n["s"]
    rows, elements = 3 * m + others, n["laws"] + others
    return (
        {
            "settings": len(STEP_SETTINGS),
            "results": len(RESULTS),
            "q": n["n_q"],
            "v": v,
            "work": 3,  # q, v and work follow one another
            "end_q": n["n_q"],
            "end_v": v,
            "given": 1 + n["n_q"] + v + n["input"],
            "out": max(n["entries"], v + 3),
            "fixed": n["flat"],
            "flat": n["flat"],
            "reach": n["bodies"],
            "value": n["links"],
            "weight": n["gathers"],
            "C": r * r,
            "E": r * r,
            "Z": v * r,
            "a": v,
            "damping": v,
            "implicit": v,
            "stiff": 1,
            "added": v,
            "before": 1,
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
            "product": rows,
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
            "loop": len(LOOP_SETTINGS),
            "own": v,
            "row_work": rows,
            "hit": elements,
            "lost": elements,
            "changes": CHANGE * (CHANGES_ROOM + 2 * elements),
        }
        | {f"flat:{name}": 0 for name in TERMS}
        | {"fixed:M": 0}
    )


class MemoryLayout(NamedTuple):
    """Names of what a step works on."""

    sizes: tuple[str, ...]  # sizes of a scene
    addresses: tuple[str, ...]  # arrays and kernels that are reached by their address
    slots: Callable[[dict[str, int]], dict[str, int]]  # sizes of a scene → lengths of the arrays of working memory by name


MECHANISM = MemoryLayout(SIZES, ADDRESSES, slots)


class StepMemory:
    """Arrays of one step in the emitted code, by name.

    Parameters
    ----------
    given : list of Array
        Sizes and places, addresses, and working memory.
    layout : MemoryLayout
        Their names.
    """

    def __init__(self, r: Routine, given: list[Array], layout: MemoryLayout = MECHANISM):
        self.r, self.layout = r, layout
        ints, self.addresses, self.work = given
        self.n = {name: ints[k] for k, name in enumerate(layout.sizes)}
        self.places = ints.after(len(layout.sizes))
        kinds = [INTEGER, POINTER, INTEGER, POINTER, INTEGER]
        self.kernel = ir.FunctionType(ir.VoidType(), kinds).as_pointer()
        self.names = list(layout.slots(dict.fromkeys(layout.sizes, 0)))
        self.arrays = {name: self.work.after(self.places[k]) for k, name in enumerate(self.names)}
        self.settings = {name: self.arrays["settings"][k] for k, name in enumerate(STEP_SETTINGS)}
        self.remaining = self.settings["share"] * -1.0 + 1.0

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    def table(self, name: str, kind=INTEGERS) -> Array:
        """Array by its address."""
        b, address = self.r.b, self.addresses[self.layout.addresses.index(name)]
        return Array(b, b.inttoptr(address.value, kind))

    def call(self, name: str, given: Array, found: Array):
        """Call a kernel of the scene by its address."""
        b, one = self.r.b, INTEGER(1)
        pointer = b.inttoptr(self.addresses[self.layout.addresses.index(name)].value, self.kernel)
        b.call(pointer, [one, given.pointer, one, found.pointer, one])

    def copy(self, target: Array, source: Array, count):
        """Copy numbers."""
        with self.r.each(count) as i:
            target[i] = source[i]

    def dot(self, one: Array, other: Array, count) -> Value:
        """Scalar product."""
        return self.r.sum(count, lambda i: one[i] * other[i])

    def pushes_asleep(self, m: Value, force: Callable[[Value], Value], sleeps: Callable[[Value], Value]) -> Value:
        """1 if one of m near contacts pushes a body asleep: such a step is not finished, its island is woken first.

        Parameters
        ----------
        force, sleeps : callable
            Normal force of a contact; whether a body sleeps, by its column.
        """
        r, woken, found, body = self.r, self.r.variable(0, INTEGER), self.table("found"), self.table("body")
        with r.when(self.n["sleepers"] > 0), r.each(m) as c, r.when(force(c) > 0.0):
            for part in parts_of(found[c * 2], self.n["parts"]):
                with r.when(sleeps(body[part * BODY])):
                    woken[0] = 1
        return woken[0]
