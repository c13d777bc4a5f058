"""A motion by a compiled loop of fixed steps on a grid, interrupted where prescribed velocities jump."""

import ctypes
from bisect import bisect_right
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from gauss.codegen.kernels import Due, Fixed, Loop, LoopStatus, address
from gauss.integrators import FixedStep, Point
from gauss.simulation.compiled_run import HELD_SAMPLES, CompiledRun
from gauss.simulation.compiled_steps.loop_functions import fixed
from gauss.simulation.grid import grid_of, with_samples
from gauss.system import State

PAIR_BYTES = 16  # of a time of the grid and its :class:`Due`


class CompiledFixedRun(CompiledRun):
    """One motion by a fixed-step method in machine code."""

    fastest = inf  # largest speed of a point of a shape: not known

    @property
    def method(self) -> FixedStep:
        """The method."""
        assert isinstance(self.problem.method, FixedStep)
        return self.problem.method

    @property
    def step(self) -> float:
        """Step [s]."""
        assert self.problem.step is not None
        return self.problem.step

    def prepared(self) -> Loop:
        """Machine code of the steps."""
        return self._loop_of(self.method_key, lambda: self._functions().compile())

    def prepared_steps(self) -> Any:
        """Machine code of the steps, or what is called as it is: ``call(*arrays(…), n)``."""
        return self.prepared().entry

    def arrays(self, point: np.ndarray, confirmed: np.ndarray, grid: np.ndarray, out: np.ndarray) -> tuple:
        """Arguments of the machine code of the steps, before their number: the record and arrays by their addresses."""
        given = (ctypes.c_void_p(address(array)) for array in (point, confirmed, grid, out))
        return ctypes.byref(self.control), *given

    def separated(self, state: State) -> State:
        """The state: overlaps of shapes are removed by the first steps."""
        return state

    def begun(self, start: State) -> np.ndarray:
        """Point (layout.size,) at a start, with the rates there."""
        point = Point(start, np.zeros(3), self.evaluated(start), self.method_state)
        return self.layout.pack(point, self.inputs if len(self.inputs) else None)

    def kept(self):
        """Nothing: a point holds all that a motion continues from."""

    def take(self, kept):
        """Nothing to take beside a point."""

    def run(self):
        """Run until the end, or a status of :data:`gauss.simulation.compiled_run.UNTRUSTED`."""
        method, step = self.method, self.step
        loop = self.prepared()
        if self.held is not None:
            self.inputs = self.held.at(0, self.start.t, self.start.q.copy(), self.start.v.copy())
        point = self._pack(Point(self.start, np.zeros(3), self.evaluated(self.start), self.method_state))
        self._begin(point, loop.evaluate("check", point))
        self.control.every = self.common.every
        pairs = grid_of(method, self.start.t, self.end, step, self.samples, self.switching)
        out = self._room()
        self.crossings: dict[int, float] = {}
        self.renewed: set[int] = set()
        self.holds: dict[int, int] = {}
        if self.held is not None:
            pairs, self.holds = with_samples(pairs, self.held.times[1:], step, self.samples is None)
        if self.switching.times:
            self.crossings, renewed = self._interruptions(pairs, method)
            self.renewed = set(map(int, renewed))
        if method.starts_from_accelerations:
            self.renewed |= set(self.holds)
        self.stops = sorted({*self.renewed, *self.crossings, *self.holds})
        self._drive(lambda: self._advance(pairs, out), out)
        self.control.unseen += self.switching.times.unresolved(self.start.t, self.end, step)

    def _is_confirmed(self) -> bool:
        if self.held is not None:  # the rates of a point are those at the begin of its last step
            point = self.layout.point(self.point)
            self.point = self._pack(replace(point, rates=self.evaluated(point.state)))
        return super()._is_confirmed()

    def _room(self) -> np.ndarray:
        """Room of as many samples as one call of the loop writes."""
        return np.empty((self.budget, self.layout.row))

    def _functions(self) -> Fixed:
        """Functions of the step loop."""
        return fixed(self.program, self.method)

    def _interruptions(self, pairs: np.ndarray, method: FixedStep) -> tuple[dict[int, float], np.ndarray]:
        """Steps before a possible velocity jump, each with the time after it; steps that end at a switching time."""
        stops = [stop for stop in self.switching.times.stops(self.start.t, self.end) if stop[0] < stop[1]]
        place = np.searchsorted(pairs[:, 0], stops, side="right").reshape(-1, 2)
        crossings = {
            int(before): after
            for (before, _), (begin, after) in zip(place, stops, strict=True)
            if self.switching.jumps.within(begin, after)
        }
        return crossings, place[:, 1] if method.starts_from_accelerations else place[:0, 1]

    def _advance(self, pairs: np.ndarray, out: np.ndarray):
        """Run the steps of the grid up to the next interruption."""
        control = self.control
        if self.holds and not (self.renewed or self.crossings):
            self._advance_held(pairs, out)
            return
        if int(control.sample) in self.crossings:
            self._cross(pairs, self.crossings.pop(int(control.sample)))
        done = int(control.sample)
        following = bisect_right(self.stops, done)
        until = self.stops[following] if following < len(self.stops) else len(pairs)
        part = pairs[done : min(until, done + self.budget)]
        self.loop(control, self.point, self.confirmed, part, out, len(part))
        if int(control.sample) == until and until in self.holds:
            self._hold(self.holds[until])
        if int(control.sample) == until and until in self.renewed:  # the method state holds accelerations from before
            point = self.layout.point(self.point)
            rates = self.evaluated(point.state)
            self.point = self._pack(replace(point, rates=rates, method_state=rates.acceleration))
        if control.status == LoopStatus.DONE and control.sample < len(pairs):
            control.status = LoopStatus.PAUSED

    def _advance_held(self, pairs: np.ndarray, out: np.ndarray):
        """Run the steps of the grid up to some further samples of the control law, without Python beside the law."""
        control, count, point, n_q = self.control, len(pairs), self.point, 1 + self.layout.n_q
        run, (record, begin, confirmed, grid, rows) = self.loop.entry.call, self.arrays(point, self.confirmed, pairs, out)
        at, q, v = self.held.at, point[1:n_q], point[n_q : n_q + self.layout.n_v]  # type: ignore[union-attr]  # held here
        values: Any = point[point.size - len(self.inputs) :].data
        done, room = int(control.sample), 0
        first = bisect_right(self.stops, done)
        for until in (*self.stops[first : first + HELD_SAMPLES], count)[:HELD_SAMPLES]:
            while done < until:
                if room <= 0 and (room := len(out) - int(max(control.rows, control.notes))) <= 0:
                    control.status = LoopStatus.PAUSED
                    return
                steps = min(until - done, room)
                run(record, begin, confirmed, grid.value + PAIR_BYTES * done, rows, steps)
                if control.status:  # not done
                    return
                done, room = done + steps, room - steps
            if until in self.holds:
                values[:] = self.inputs = at(self.holds[until], point.item(0), q.copy(), v.copy())
        control.status = LoopStatus.PAUSED if done < count else LoopStatus.DONE

    def _cross(self, pairs: np.ndarray, after: float):
        """Continue on the grid after a switching time at which prescribed velocities jump."""
        before = self._row()
        if self._jumped(after) is None:
            return
        row = self._row()
        while self.control.sample < len(pairs) and pairs[int(self.control.sample), 0] <= after:
            if pairs[int(self.control.sample), 1] != Due.STEP and self.samples is not None:
                self.rows.append(row)
            self.control.sample += 1
        if self.samples is None:
            self.rows += [before, row]
