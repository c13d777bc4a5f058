"""Working memory and addresses of the compiled step of a mechanism: :mod:`gauss.codegen.kernels.mechanism_step`."""

from functools import cache
from typing import NamedTuple

import numpy as np

from gauss.codegen import from_disk, write
from gauss.codegen.kernels import CompiledMechanismStep, StepFunctions, address
from gauss.codegen.kernels.step_memory import (
    ADDRESSES,
    CHANGE,
    FINISHED,
    LOOP_SETTINGS,
    RESULTS,
    SIZES,
    STEP_SETTINGS,
    TERMS,
    slots,
)
from gauss.dynamics.contact.contact_changes import ModeChange
from gauss.dynamics.contact.contact_step import contact_solver
from gauss.dynamics.contact.free_bodies import place_function
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.contact.moreau_step import is_impact, least_rate
from gauss.dynamics.contact.near_detection import FIRST_ROOM
from gauss.dynamics.contact.paradox import SLIDING as SLIDING_SPEED
from gauss.dynamics.contact.shape_table import MOST_FEATURES
from gauss.dynamics.gap_functions import RESTING
from gauss.system import State


class LoopOfSteps(NamedTuple):
    """Steps that machine code took one after the other.

    Attributes
    ----------
    steps : int
        Finished steps.
    largest : float
        Largest error of the laws of contact, in units of the scene.
    changes : list of ModeChange
        Changes of the contact mode.
    doubtful : bool
        Whether the last of them has sliding contacts that are to be examined for Painlevé's paradox.
    """

    steps: int
    largest: float
    changes: list[ModeChange]
    doubtful: bool


class CompiledStepMemory:
    """Compiled steps of one system, with its working memory.

    Parameters
    ----------
    stepper : MechanismStepper
        The stepper, of a system without loop joints.
    """

    def __init__(self, stepper):
        self.stepper, self.code = stepper, compiled_mechanism_step()
        smooth, kernels, self.detection = stepper.smooth, stepper.kernels, stepper.detection
        table, N = stepper.table, stepper.compliance.free_columns
        self.sizes = {
            "n_q": smooth.n_q,
            "n_v": smooth.n_v,
            "r": N.shape[1],
            "bodies": stepper.n + 1,
            "g": len(stepper.rows.others),
            "s": stepper.rows.limit.size,
            "entries": kernels.layout.entries.size,
            "flat": kernels.layout.flat.size,
            "parts": len(table.parts),
            "pairs": len(self.detection.pair),
            "capacity": FIRST_ROOM,
            "loops": int(smooth.closes),
            "laws": len(table.contacts),
            "input": stepper.inputs.size,
        }
        lengths = slots(self.sizes)
        ends = np.cumsum([0, *lengths.values()])
        self.work = np.zeros(ends[-1] + 1)
        offsets = dict(zip(lengths, ends.tolist(), strict=False))
        parts = dict(zip(MechanismTerms._fields, kernels.layout.parts, strict=True))
        for name in TERMS:
            offsets[f"flat:{name}"] = offsets["flat"] + parts[name][0].start
        self.ints = np.array([*(self.sizes[name] for name in SIZES), *offsets.values()], dtype=np.int64)
        self.at = {name: self.work[offsets[name] : offsets[name] + length] for name, length in lengths.items()}
        self._fill(N)

    def _fill(self, N: np.ndarray):
        stepper, at, table, rows = self.stepper, self.at, self.stepper.table, self.stepper.rows
        column = np.abs(N).argmax(axis=1)
        at["value"][:] = N[np.arange(len(N)), column]
        at["fixed"][:] = stepper.kernels.layout.flat
        at["reach"][:] = stepper.reach
        at["friction"][:-1], at["restitution"][:-1] = table.friction, table.restitution
        at["other_restitution"][:], at["other_unit"][:] = rows.other_restitution, rows.other_unit
        at["set_unit"][:], at["limit"][:], at["lossy"][:] = rows.set_unit, rows.limit, rows.lossy
        first, second = self.detection.pairs
        room, n = FIRST_ROOM, self.sizes
        self.integers = {
            "entries": stepper.kernels.layout.entries.astype(np.int64),
            "law": (table.law[first, second] - 1).astype(np.int64),
            "known_found": np.zeros((room, 2), dtype=np.int64),
            "known_count": np.zeros(1, dtype=np.int64),
            "under": np.zeros(6 * room + 2 * n["g"] + n["s"] + 1, dtype=np.int64),
            "status": np.zeros(1, dtype=np.int64),
            "column": column.astype(np.int64),
        }
        self.first_settings, self.loop_settings = self._first_settings()
        at["own"][:] = 1.0 / stepper.system.scale.coordinates
        self.pair_keys = first * len(table.parts) + second

    def _first_settings(self) -> tuple[np.ndarray, np.ndarray]:
        """Settings of a step, and of the loop, before its first step."""
        scale, stepper = self.stepper.system.scale, self.stepper
        rates = {"pace": 1.0 / scale.time, "resting": scale.time * RESTING, "sliding": scale.time * SLIDING_SPEED}
        loop = rates | {"shares": stepper.shares[0], "recorded": 1.0, "largest": 0.0}
        given = [(STEP_SETTINGS, stepper.constants), (LOOP_SETTINGS, loop)]
        step, loops = (np.array([values.get(name, 0.0) for name in names]) for names, values in given)
        return step, loops

    def connect(self):
        """Take all addresses anew: a new motion may run in another tier."""
        self.version = self.detection.version
        kernels, detection = self.stepper.kernels, self.detection
        names = "body", "pair", "kind", "feature", "found", "count", "own", "signs", "deepest", "moved", "rows", "depth"
        arrays = {**self.integers, **{name: getattr(detection, name) for name in names}}
        arrays["near_settings"] = detection.settings
        record = self.stepper.record
        arrays |= {name: getattr(record, name) for name in ("modes", "next_modes", "closed", "fresh", "counts")}
        found = {name: array.ctypes.data for name, array in arrays.items()}
        found |= {name: getattr(kernels, name).address() for name in ("begin", "forces", "move")}
        self.addresses = np.array([found[name] for name in ADDRESSES], dtype=np.int64)
        self.given = self.ints.ctypes.data, self.addresses.ctypes.data, self.work.ctypes.data

    def _begin(self, state: State):
        at, inputs = self.at, self.stepper.inputs
        at["q"][:], at["v"][:] = state.q, state.v
        at["given"][at["given"].size - inputs.size :] = inputs

    def advance(self, state: State, work: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps to some times; see :meth:`gauss.dynamics.contact.mechanism_step.MechanismStepper.run`."""
        if self.version != self.detection.version:
            self.connect()
        at, record = self.at, self.stepper.record
        self._begin(state)
        at["settings"][:], at["settings"][STEP_SETTINGS.index("t")] = self.first_settings, state.t
        at["loop"][:], at["work"][:] = self.loop_settings, work
        before = record.kept()
        self.code.advance(*self.given, ends.size, address(ends), address(rows))
        _, _, changed, count = record.counts.tolist()
        changes = record.recorded(at["changes"][: CHANGE * changed], before)
        ended = int(self.integers["status"][0]) == FINISHED
        doubtful = ended and bool(at["results"][RESULTS.index("doubtful")])
        return LoopOfSteps(count, float(at["loop"][LOOP_SETTINGS.index("largest")]), changes, doubtful)

    @property
    def known(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces of the last step: keys of its contacts in order, forces (m, 3) of these, and of other constraints."""
        m = int(self.integers["known_count"][0])
        pair, feature = self.integers["known_found"][:m].T
        key = self.pair_keys[pair] * MOST_FEATURES + feature
        order = np.argsort(key)
        return key[order], self.at["known"][: 3 * m].reshape(m, 3)[order], self.at["known_others"].copy()

    @known.setter
    def known(self, found: tuple[np.ndarray, np.ndarray, np.ndarray]):
        key, force, others = found
        m = min(key.size, FIRST_ROOM)
        pair, feature = np.divmod(key[:m], MOST_FEATURES)
        self.integers["known_found"][:m, 0] = np.searchsorted(self.pair_keys, pair)
        self.integers["known_found"][:m, 1] = feature
        self.integers["known_count"][0] = m
        self.at["known"][: 3 * m], self.at["known_others"][:] = force[:m].ravel(), others


@cache
def compiled_mechanism_step() -> CompiledMechanismStep:
    """Machine code, made once on a machine."""

    def make() -> CompiledMechanismStep:
        functions = StepFunctions(
            place_function(),
            contact_solver(),
            write(lambda x: [is_impact(*x)], 5, name="impact"),
            write(lambda x: [least_rate(x[0], x[1], 0.0, *x[2:])], 5, name="plastic"),
            write(lambda x: [least_rate(*x)], 6, name="elastic"),
        )
        return CompiledMechanismStep(functions)

    return from_disk((CompiledMechanismStep,), make)
