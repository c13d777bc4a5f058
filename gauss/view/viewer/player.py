"""Controls beside the stage: play and pause, time, speed, what is shown, and the curves of the motion."""

import threading
import time

import numpy as np

from gauss.analysis import energy
from gauss.simulation import Trajectory
from gauss.view.style import COLOURS, NAMED
from gauss.view.viewer.controls import add_layers, add_view
from gauss.view.viewer.stage import ViewerStage

SPEEDS = ("0.1×", "0.25×", "0.5×", "1×", "2×", "4×")
STEPS = {"◀ step": -1, "step ▶": 1}  # by so many pictures
PAUSE = 1 / 60  # between two looks at the clock [s]


class Player:
    """Clock and controls of one stage.

    Parameters
    ----------
    stage : ViewerStage
        What is moved; of more than one picture.
    beside : ViewerStage, optional
        Stage of a second motion, which moves with the first.
    """

    def __init__(self, stage: ViewerStage, beside: ViewerStage | None = None):
        self.stage, self.trajectory = stage, stage.trajectory
        self.stages = [stage] if beside is None else [stage, beside]
        longest = max(self.stages, key=lambda each: float(each.trajectory.t[-1]))
        self.times, gui = longest.trajectory.t, stage.server.gui
        t = self.times
        self.now, self.playing, self.stopped = float(t[0]), True, threading.Event()
        gui.add_markdown(" | ".join(f"**{each.trajectory.system.scene.name}**" for each in self.stages))
        self.button = gui.add_button("Pause")
        self.slider = gui.add_slider("time [s]", float(t[0]), float(t[-1]), float(t[1] - t[0]), float(t[0]))
        steps = gui.add_button_group("step", tuple(STEPS))
        self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1×")
        self.button.on_click(lambda _: self.play(not self.playing))
        steps.on_click(lambda _: self.step(STEPS[steps.value]))
        self.slider.on_update(lambda event: self._dragged() if event.client is not None else None)
        add_layers(self.stages, lambda: self._go(self.now))
        add_view(stage)
        for each in self.stages:
            self._curves(gui, each.trajectory)

    def play(self, on: bool):
        """Play or pause."""
        self.playing, self.button.label = on, "Pause" if on else "Play"

    def run(self):
        """Move the stage with the clock, until ``stopped`` is set."""
        t, before = self.times, time.perf_counter()
        while not self.stopped.wait(PAUSE):
            elapsed, before = time.perf_counter() - before, time.perf_counter()
            if self.playing:
                ahead = self.now + elapsed * float(self.speed.value.rstrip("×"))
                self._go(ahead if ahead <= t[-1] else float(t[0]))
                self.slider.value = self.now

    def _dragged(self):
        self.play(False)
        self._go(float(self.slider.value))

    def step(self, pictures: int):
        """Pause, and move by so many pictures."""
        self.play(False)
        here = int(abs(self.times - self.now).argmin()) + pictures
        self._go(float(self.times[min(max(here, 0), len(self.times) - 1)]))
        self.slider.value = self.now

    def _go(self, t: float):
        self.now = t
        with self.stage.server.atomic():
            for stage in self.stages:
                stage.at(t)

    @staticmethod
    def _curves(gui, trajectory: Trajectory):
        """Plots of coordinates, rates and energies; of the first coordinates, where they are many."""
        from viser import uplot

        names = trajectory.system.coordinates[:NAMED]
        scales = {"x": uplot.Scale(time=False)}
        found = {"rates [rad/s, m/s]": trajectory.v[:, : len(names)]}
        if trajectory.system.is_flat:
            found = {"coordinates [rad, m]": trajectory.q[:, : len(names)]} | found
        lines = [uplot.Series(label=name, stroke=COLOURS[k % len(COLOURS)], width=2) for k, name in enumerate(names)]
        for title, columns in found.items():
            data = (trajectory.t, *np.ascontiguousarray(columns.T))
            gui.add_uplot(data, (uplot.Series(label="t [s]"), *lines), title=title, scales=scales, aspect=1.4)
        energies = energy(trajectory)
        kinetic, potential = energies.kinetic, energies.potential
        parts = {"kinetic": kinetic, "potential": potential, "sum": kinetic + potential}
        lines = [uplot.Series(label=name, stroke=COLOURS[k], width=2) for k, name in enumerate(parts)]
        data, axis = (trajectory.t, *parts.values()), uplot.Series(label="t [s]")
        gui.add_uplot(data, (axis, *lines), title="energies [J]", scales=scales, aspect=1.4)
