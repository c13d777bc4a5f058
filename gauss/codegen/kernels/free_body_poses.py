"""Bodies of a compiled step: its working memory, their poses and velocities, and the contacts that are near."""

from collections.abc import Callable
from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import POINTER, Function
from gauss.codegen.kernels.arrays import Routine, Value
from gauss.codegen.kernels.block_contacts import CONTACT, ELIMINATED, MASS, BlockContactLaws
from gauss.codegen.kernels.contact_islands import ISLANDS, ContactIslands
from gauss.codegen.kernels.near_pairs import BODY, INTEGERS, NEAR_INTEGERS, NEAR_NUMBERS, parts_of
from gauss.codegen.kernels.step_memory import CHANGE, CHANGES_ROOM, LOOP_SETTINGS, RESULTS, MemoryLayout, StepMemory
from gauss.codegen.kernels.vectors import BLOCK, SIX, WIDTH

SIZES = ("n_q", "n_v", "n", "bodies", "parts", "pairs", "capacity", "blocks", "laws", "constants", "sleepers")
ADDRESSES = (
    *NEAR_INTEGERS,
    *NEAR_NUMBERS,
    *("known_found", "known_count", "status", "q_start", "v_start"),
    *("touching", "ordered", "within", "ordered_count", "slot", "order", "start", "list", "degree", "needed"),
    *ISLANDS,
    *("modes", "next_modes", "closed", "fresh", "counts"),
)
SETTINGS = (
    *("t", "h", "share", "rest", "slow", "margin", "unit", "tolerance", "unsolved", "removal", "accepted", "deepest"),
    "curved",
)
POSE, COORDINATES, RATES = 24, 7, 6  # pose and velocities of a body, coordinates and rates of its joint


def slots(n: dict[str, int]) -> dict[str, int]:
    """Lengths of the arrays of working memory by name."""
    bodies, m = n["n"], n["capacity"]
    return {
        "settings": len(SETTINGS),
        "results": len(RESULTS),
        "q": n["n_q"],
        "v": n["n_v"],
        "work": 3,  # q, v and work follow one another
        "end_q": n["n_q"],
        "end_v": n["n_v"],
        "own": n["n_v"],
        "loop": len(LOOP_SETTINGS),
        "constants": bodies * n["constants"],
        "gravity": 3,
        "reach": bodies,
        "bodies": POSE * n["bodies"],
        "at": COORDINATES * bodies,
        "mass": MASS * bodies,
        "first": WIDTH * bodies,
        "free": WIDTH * bodies,
        "added": WIDTH * bodies,
        "expected": SIX * bodies,
        "friction": n["laws"] + 1,
        "restitution": n["laws"] + 1,
        "hit": n["laws"],
        "lost": n["laws"],
        "changes": CHANGE * (CHANGES_ROOM + 2 * n["laws"]),
        "J": CONTACT * m,
        "before": 3 * m,
        "after": 3 * m,
        "b": 3 * m,
        "mu": m,
        "f": 3 * m,
        "known": 3 * m,
        "island:mass": MASS * bodies,
        "island:added": WIDTH * bodies,
        "A": BLOCK * n["blocks"],
        "room": (9 + ELIMINATED) * m + WIDTH * bodies,
        "result": 3,
    }


FREE_BODIES = MemoryLayout(SIZES, ADDRESSES, slots)


@dataclass(frozen=True, eq=False)
class FreeBodyFunctions:
    """Traced functions of a step.

    Parameters
    ----------
    place : Function
        As of :class:`gauss.codegen.kernels.NearPairs`.
    begin, end : Function
        Of one body, as of :class:`gauss.dynamics.contact.free_bodies.FreeBodyKernels`.
    laws : BlockContactLaws
        Laws of contact and friction.
    impact, plastic, elastic, to_close, rest_steps
        As of :class:`gauss.codegen.kernels.StepFunctions`.
    gap_after : Function
        (gap, its rate, its second derivative, a time) → the gap after that time.
    """

    place: Function
    begin: Function
    end: Function
    laws: BlockContactLaws
    impact: Function
    plastic: Function
    elastic: Function
    to_close: Function
    gap_after: Function
    rest_steps: float


STEP = ir.FunctionType(ir.VoidType(), [INTEGERS, INTEGERS, POINTER])  # sizes and places, addresses, working memory


class BodiesOfStep:
    """Emitter of what the parts of a step have in common.

    Parameters
    ----------
    functions : FreeBodyFunctions
        Traced functions.
    shared : tuple of llvmlite.ir.Function
        Near contacts, order of elimination, solution of a contact problem; begin of all bodies, islands.
    function : llvmlite.ir.Function
        The function to be written; its arguments are those of a step.
    """

    def __init__(self, functions: FreeBodyFunctions, shared: tuple[ir.Function, ...], function: ir.Function):
        self.functions = functions
        self.near, order, solver, *self.shared = shared
        r = self.r = Routine(function)
        self.at = StepMemory(r, r.arrays, FREE_BODIES)
        self.settings = {name: self.at["settings"][k] for k, name in enumerate(SETTINGS)}
        self.at.settings = self.settings
        self.islands = ContactIslands(self.at, order, solver)

    def set(self, name: str, value):
        """Change a setting in memory; its value here stays the one at the begin of the function."""
        self.at["settings"][SETTINGS.index(name)] = value

    def begin_all(self):
        """Begin all bodies, by the length and the share of the step in its settings."""
        with self.r.each(self.at.n["n"]) as k:
            self._begin(k)

    def _begin(self, k: Value):
        """Pose, velocities, free accelerations and inertia of a body after the share of the step."""
        at, n = self.at, self.at.n
        q, v, own = self.joint("q", k, COORDINATES), self.joint("v", k, RATES), at["constants"].after(k * n["constants"])
        constants = len(self.functions.begin.inputs) - COORDINATES - RATES - 3 - SIX - 2
        given = [*q, *v, *(own[i] for i in range(constants)), *(at["gravity"][i] for i in range(3))]
        given += [at["expected"][k * SIX + i] for i in range(SIX)]
        found = self.r.inline(self.functions.begin, *given, self.settings["h"], self.settings["share"])
        for i in range(COORDINATES):
            at["at"][k * COORDINATES + i] = found[i]
        pose = found[COORDINATES : COORDINATES + POSE]
        for i, value in enumerate(pose):
            at["bodies"][n["bodies"] * i + k] = value
        rest = found[COORDINATES + POSE :]
        for i in range(SIX):
            at["first"][k * WIDTH + i] = pose[12 + i]
            at["free"][k * WIDTH + i] = pose[12 + i] + self.settings["h"] * rest[i]
            at["added"][k * WIDTH + i] = 0.0
        for i in range(18):
            at["mass"][k * MASS + i] = rest[SIX + i]
        at["mass"][k * MASS + 18] = own[constants - 1]
        at["mass"][k * MASS + 19] = self.r.number(1.0) / own[constants - 1]

    def joint(self, name: str, k: Value, count: int) -> list[Value]:
        """Coordinates or rates of a body, by the name of their array."""
        start = self.at.table(f"{name}_start")[k]
        return [self.at[name][start + i] for i in range(count)]

    def twist(self, name: str | None, k: Value) -> list[Value]:
        """Velocities (6,) of a body before the step, after it without contacts ("free"), and with them ("added")."""
        first = self.at["first" if name is None else "free"].after(k * WIDTH)
        return [first[i] + self.at["added"][k * WIDTH + i] if name == "added" else first[i] for i in range(SIX)]

    def speed(self, name: str | None) -> Value:
        """Largest speed of a point of a shape."""
        r, largest = self.r, self.r.variable(0.0)
        with r.each(self.at.n["n"]) as k:
            x = self.twist(name, k)
            turning, moving = (r.square_root(a * a + b * b + c * c) for a, b, c in (x[:3], x[3:]))
            largest[0] = r.maximum(moving + turning * self.at["reach"][k], largest[0])
        return largest[0]

    def find(self):
        """Contacts nearer than the reach."""
        at, n = self.at, self.at.n
        integers = [at.table(name) for name in NEAR_INTEGERS]
        others = [at.table(name, POINTER) for name in NEAR_NUMBERS]
        self.r.call(self.near, n["parts"], n["pairs"], n["capacity"], n["bodies"], *integers, at["bodies"], *others)

    def touch(self, c: Value):
        """Bodies of a contact that move, −1 for others."""
        at = self.at
        found, touching, body = (at.table(name) for name in ("found", "touching", "body"))
        for side, part in enumerate(parts_of(found[c * 2], at.n["parts"])):
            column = body[part * BODY]
            touching[c * 2 + side] = -1
            with self.r.when(column < at.n["n"]):
                touching[c * 2 + side] = column


def write_parts(functions: FreeBodyFunctions, shared: tuple[ir.Function, ...], module: ir.Module) -> list[ir.Function]:
    """Emit ``begin``, all bodies after the share of a step, and ``divide``, islands of contacts, as functions."""

    def write(name: str, body: Callable[[BodiesOfStep], None]) -> ir.Function:
        function = ir.Function(module, STEP, name)
        function.linkage = "internal"
        writer = BodiesOfStep(functions, shared, function)
        body(writer)
        return writer.r.done()

    return [
        write("begin", lambda writer: writer.begin_all()),
        write("divide", lambda writer: writer.islands.divide(writer.at.table("count")[0])),
    ]
