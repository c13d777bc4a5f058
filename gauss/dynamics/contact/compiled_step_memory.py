"""Working memory of compiled steps with contacts, and the loop of steps that works on it."""

from typing import Any, NamedTuple

import numpy as np

from gauss.codegen.kernels import CompiledSteps, MemoryLayout, address
from gauss.codegen.kernels.near_pairs import NEAR_INTEGERS, NEAR_NUMBERS
from gauss.codegen.kernels.step_memory import CHANGE, FINISHED, LOOP_SETTINGS, RESULTS, STEP_SETTINGS
from gauss.dynamics.contact.contact_changes import ModeChange, ModeRecord, RecordedChanges
from gauss.dynamics.contact.near_detection import NearDetection
from gauss.system import System

TIME_PLACE, ERROR_PLACE, DOUBT_PLACE = STEP_SETTINGS.index("t"), LOOP_SETTINGS.index("largest"), RESULTS.index("doubtful")
KEPT_STEPS = 64  # of a call whose arrays are kept for the next one
RECORDED = ("modes", "next_modes", "closed", "fresh", "counts")


class LoopOfSteps(NamedTuple):
    """Steps that machine code took one after the other."""

    steps: int  # finished steps
    largest: float  # largest error of the laws of contact, in units of the scene
    changes: RecordedChanges | list[ModeChange]  # changes of the contact mode
    doubtful: bool  # whether the last of them has sliding contacts that are to be examined for Painlevé's paradox


class CompiledStepMemory:
    """Arrays of the compiled steps of one system.

    Parameters
    ----------
    code : CompiledSteps
        Machine code of the steps.
    layout : MemoryLayout
        Names of the arrays.
    sizes : dict
        Sizes of the scene.
    extra : dict
        Names of views of working memory, and their places after other arrays: (array, place).
    """

    record: ModeRecord
    detection: NearDetection
    integers: dict[str, np.ndarray]
    settings: Any  # settings, loop, results: buffers, which give floats
    loop: Any
    results: Any
    version = -1

    def __init__(self, code: CompiledSteps, layout: MemoryLayout, sizes: dict[str, int], extra: dict[str, tuple[str, int]]):
        self.code, self.layout, self.sizes = code, layout, sizes
        lengths = layout.slots(sizes)
        ends = np.cumsum([0, *lengths.values()])
        self.work = np.zeros(ends[-1] + 1)
        offsets = dict(zip(lengths, ends.tolist(), strict=False))
        for name, (array, place) in extra.items():
            offsets[name] = offsets[array] + place
        self.ints = np.array([*(sizes[name] for name in layout.sizes), *offsets.values()], dtype=np.int64)
        self.at = {name: self.work[offsets[name] : offsets[name] + length] for name, length in lengths.items()}
        self.begun = self.work[offsets["q"] : offsets["work"] + lengths["work"]]  # q, v and work follow one another
        self.settings, self.loop, self.results = (self.at[name].data for name in ("settings", "loop", "results"))
        self.ends, self.rows, self.places = np.empty(0), np.empty(0), (0, 0)

    def set_first(self, system: System, resting: float, sliding: float, share: float, names: tuple, constants: dict):
        """Settings of all steps by their names, and of the loop; those that differ from step to step are zero."""
        loop = {"pace": 1.0 / system.scale.time, "resting": resting, "sliding": sliding, "shares": share, "recorded": 1.0}
        self.at["settings"][:] = [constants.get(name, 0.0) for name in names]
        self.at["loop"][:] = [loop.get(name, 0.0) for name in LOOP_SETTINGS]
        self.at["own"][:] = 1.0 / system.scale.coordinates

    def kernels(self) -> dict[str, int]:
        """Addresses of kernels of the scene."""
        return {}

    def connect(self):
        """Take all addresses anew: a new motion may run in another tier."""
        self.version = self.detection.version
        arrays = {**self.integers, **{name: getattr(self.detection, name) for name in (*NEAR_INTEGERS, *NEAR_NUMBERS)}}
        arrays |= {name: getattr(self.record, name) for name in RECORDED}
        found = {name: array.ctypes.data for name, array in arrays.items()} | self.kernels()
        self.addresses = np.array([found[name] for name in self.layout.addresses], dtype=np.int64)
        self.given = self.ints.ctypes.data, self.addresses.ctypes.data, self.work.ctypes.data

    def _places_of(self, ends: np.ndarray, rows: np.ndarray) -> tuple[int, int]:
        """Addresses, kept for the next call with the same arrays if they are small."""
        found = address(ends), address(rows)
        if ends.size <= KEPT_STEPS:
            self.ends, self.rows, self.places = ends, rows, found
        return found

    def advance(self, begin: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps from a state and its work to some times, as far as machine code finishes them.

        Parameters
        ----------
        begin : ndarray, shape (4 + n_q + n_v,)
            (t, q, v, work) where they begin.
        ends : ndarray, shape (k,)
            Ends of the steps [s].
        rows : ndarray, shape (k, 4 + n_q + n_v)
            Destination of (t, q, v, work) at these ends.
        """
        if self.version != self.detection.version:
            self.connect()
        places = self.places if ends is self.ends and rows is self.rows else self._places_of(ends, rows)
        self.begun[:], record = begin[1:], self.record
        self.settings[TIME_PLACE], self.loop[ERROR_PLACE] = begin[0], 0.0
        before = record.kept()
        self.code.advance(*self.given, ends.size, *places)
        _, _, changed, count = record.counts.tolist()
        changes: RecordedChanges | list[ModeChange] = []
        if changed:
            changes = RecordedChanges(self.at["changes"][: CHANGE * changed].copy(), before)
        doubtful = self.results[DOUBT_PLACE] != 0.0 and int(self.integers["status"][0]) == FINISHED
        return LoopOfSteps(count, self.loop[ERROR_PLACE], changes, doubtful)
