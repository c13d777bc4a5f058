"""Working memory and addresses of the compiled step of a mechanism: :mod:`gauss.codegen.kernels.mechanism_step`."""

from functools import cache
from math import isfinite
from typing import NamedTuple

import numpy as np

from gauss.codegen import from_disk
from gauss.codegen.kernels import CallingSteps, CompiledMechanismStep, StepFunctions
from gauss.codegen.kernels.step_memory import MECHANISM, PATTERNS, RESULTS, STEP_SETTINGS, TERMS
from gauss.dynamics.contact.compiled_step_memory import CompiledStepMemory, LoopOfSteps
from gauss.dynamics.contact.contact_step import contact_solver
from gauss.dynamics.contact.free_bodies import place_function
from gauss.dynamics.contact.gap_laws import REST_STEPS, laws_of_gaps
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.contact.near_detection import FIRST_ROOM
from gauss.dynamics.contact.paradox import SLIDING as SLIDING_SPEED
from gauss.dynamics.contact.shape_table import MOST_FEATURES
from gauss.dynamics.contact.step_patterns import step_patterns
from gauss.dynamics.gap_functions import RESTING

SPEED_PLACE = RESULTS.index("fastest")


class KnownForces(NamedTuple):
    """Forces of the last step."""

    key: np.ndarray  # (m,) contacts, in order
    force: np.ndarray  # (m, 3) their forces [N]
    others: np.ndarray  # (g + s,) those of other unilateral constraints, and of set-valued elements
    share: float  # share of that step in which coordinates moved with the rates before it; zero with an impact


class MechanismMemory(CompiledStepMemory):
    """Compiled steps of one mechanism, with its working memory.

    Parameters
    ----------
    stepper : MechanismStepper
        The stepper, of a tree, with couplings or without.
    room : int
        Contacts that there is room for.
    """

    def __init__(self, stepper, room: int = FIRST_ROOM):
        self.stepper, self.detection, self.record = stepper, stepper.detection, stepper.record
        smooth, kernels = stepper.smooth, stepper.kernels
        table, N = stepper.table, stepper.compliance.free_columns
        self.patterns = step_patterns(kernels.layout, N)
        sizes = {
            "n_q": smooth.n_q,
            "n_v": smooth.n_v,
            "r": N.shape[1],
            "links": np.count_nonzero(N),
            "bodies": stepper.n + 1,
            "g": len(stepper.rows.others),
            "s": stepper.rows.limit.size,
            "entries": kernels.layout.entries.size,
            "flat": kernels.layout.flat.size,
            "parts": len(table.parts),
            "pairs": len(self.detection.pair),
            "capacity": room,
            "loops": int(smooth.closes),
            "laws": len(table.contacts),
            "input": stepper.inputs.size,
            "sleepers": stepper.asleep.sum(),
            "gathers": self.patterns.weight.size,
        }
        parts = dict(zip(MechanismTerms._fields, kernels.layout.parts, strict=True))
        terms = {f"flat:{name}": ("flat", parts[name][0].start) for name in TERMS}
        terms["fixed:M"] = "fixed", parts["M"][0].start
        steps = compiled_mechanism_step() if kernels.receiver is None else CallingSteps(compiled_mechanism_step())
        super().__init__(steps, MECHANISM, sizes, terms)
        self.inputs = self.at["given"][sizes["n_v"] + sizes["n_q"] + 1 :]
        self._fill(N)

    def _fill(self, N: np.ndarray):
        stepper, at, table, rows = self.stepper, self.at, self.stepper.table, self.stepper.rows
        row, column = np.nonzero(N)
        at["value"][:], at["weight"][:] = N[row, column], self.patterns.weight
        at["fixed"][:] = at["flat"][:] = stepper.kernels.layout.flat
        at["reach"][:], at["damping"][:] = stepper.reach, stepper.damping.d
        at["friction"][:-1], at["restitution"][:-1] = table.friction, table.restitution
        at["other_restitution"][:], at["other_unit"][:] = rows.other_restitution, rows.other_unit
        at["set_unit"][:], at["limit"][:], at["lossy"][:] = rows.set_unit, rows.limit, rows.lossy
        room, n = self.sizes["capacity"], self.sizes
        self.integers = {
            "entries": stepper.kernels.layout.entries.astype(np.int64),
            "known_found": np.zeros((room, 2), dtype=np.int64),
            "known_count": np.zeros(1, dtype=np.int64),
            "under": np.zeros(6 * room + 2 * n["g"] + n["s"] + 1, dtype=np.int64),
            "status": np.zeros(1, dtype=np.int64),
            "row": row.astype(np.int64),
            "column": column.astype(np.int64),
            "asleep": stepper.asleep.astype(np.int64),
            "k_begin": np.zeros(3 * room + n["g"] + n["s"], dtype=np.int64),
            "k_end": np.zeros(3 * room + n["g"] + n["s"], dtype=np.int64),
        }
        found = self.patterns._asdict()
        self.integers |= {name: np.ascontiguousarray(found[name], dtype=np.int64) for name in PATTERNS}
        time = stepper.system.scale.time
        rates = time * RESTING, time * SLIDING_SPEED
        self.set_first(stepper.system, *rates, stepper.shares[0], STEP_SETTINGS, stepper.constants)

    def fitting(self) -> "MechanismMemory":
        """Return the memory, or a larger one if contacts lack room."""
        room = len(self.detection.rows)
        if room <= self.sizes["capacity"]:
            return self
        larger = MechanismMemory(self.stepper, room)
        larger.known = self.known
        return larger

    def kernels(self) -> dict[str, int]:
        """Addresses of kernels of the scene."""
        return self.stepper.kernels.addresses()

    def advance(self, begin: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps to some times, with the inputs that are held."""
        self.inputs[:] = self.stepper.inputs
        if self.stepper.kernels.receiver is not None:
            return self._calling(begin, ends, rows)
        found = super().advance(begin, ends, rows)
        last = rows[found.steps - 1]
        return found if not found.steps or isfinite(last.dot(last)) else self._sound(found, rows)

    def _sound(self, found: LoopOfSteps, rows: np.ndarray) -> LoopOfSteps:
        """Steps before one without finite results, which is left to Python; the forces that it begins from are forgotten."""
        finite = np.isfinite(rows[: found.steps]).all(axis=1)
        if finite.all():
            return found
        sound, modes = int(finite.argmin()), self.record.kept()
        for change in reversed(list(found.changes)):
            modes[change.element] = modes[change.element] if change.step < sound else change.before
        changes = [change for change in found.changes if change.step < sound]
        self.stepper.forget_forces()
        self.record.take(modes)
        return LoopOfSteps(sound, 0.0, changes, False)

    def _calling(self, begin: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps whose kernels call opaque laws, up to one in which such a law raises or returns no numbers."""
        known, modes = self.known, self.record.kept()
        try:
            with self.stepper.kernels.receiver:
                found = super().advance(begin, ends, rows)
        except BaseException:
            self.known = known
            self.record.take(modes)
            raise
        finite = np.isfinite(rows[: found.steps]).all(axis=1)
        if finite.all():
            return found
        self.known = known
        self.record.take(modes)
        sound = int(np.argmin(finite))
        return self._calling(begin, ends[:sound], rows) if sound else LoopOfSteps(0, 0.0, [], False)

    @property
    def fastest(self) -> float:
        """Largest speed of a point of a shape at the end of the last step [m/s]; infinite if another one was the last."""
        return float(self.at["results"][SPEED_PLACE])

    @property
    def known(self) -> KnownForces:
        """Forces of the last step."""
        m = int(self.integers["known_count"][0])
        pair, feature = self.integers["known_found"][:m].T
        key = pair * MOST_FEATURES + feature
        order = np.argsort(key)
        force, others = self.at["known"][: 3 * m].reshape(m, 3)[order], self.at["known_others"].copy()
        return KnownForces(key[order], force, others, float(self.at["before"][0]))

    @known.setter
    def known(self, found: KnownForces):
        self.at["results"][SPEED_PLACE] = np.inf
        key, force, others, self.at["before"][0] = found
        m = key.size
        self.integers["known_found"][:m] = np.column_stack(np.divmod(key[:m], MOST_FEATURES))
        self.integers["known_count"][0] = m
        self.at["known"][: 3 * m], self.at["known_others"][:] = force[:m].ravel(), others


@cache
def compiled_mechanism_step() -> CompiledMechanismStep:
    """Machine code, made once on a machine."""

    def make() -> CompiledMechanismStep:
        return CompiledMechanismStep(StepFunctions(place_function(), contact_solver(), *laws_of_gaps(), REST_STEPS))

    return from_disk((CompiledMechanismStep,), make)
