"""Controls beside the stage: play and pause, time, speed, what is shown, and the curves of the motion."""

import threading
import time

import numpy as np

from gauss.analysis import energy
from gauss.view.style import COLOURS, NAMED
from gauss.view.viewer.stage import ViewerStage

SPEEDS = ("0.1×", "0.25×", "0.5×", "1×", "2×", "4×")
SHOWN = {"link": "links", "joint": "joints", "contact": "shapes of contact", "frame": "frames", "path": "paths"}
PAUSE = 1 / 60  # between two looks at the clock [s]


class Player:
    """Clock and controls of one stage.

    Parameters
    ----------
    stage : ViewerStage
        What is moved.
    """

    def __init__(self, stage: ViewerStage):
        self.stage, self.trajectory = stage, stage.trajectory
        t, gui = self.trajectory.t, stage.server.gui
        self.now, self.playing, self.stopped = float(t[0]), len(t) > 1, threading.Event()
        gui.add_markdown(f"**{self.trajectory.system.scene.name}**")
        if len(t) > 1:
            self.button = gui.add_button("Pause")
            self.slider = gui.add_slider("time [s]", float(t[0]), float(t[-1]), float(t[1] - t[0]), float(t[0]))
            self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1×")
            self.button.on_click(lambda _: self.play(not self.playing))
            self.slider.on_update(lambda event: self._dragged() if event.client is not None else None)
        with gui.add_folder("show"):
            for role, label in SHOWN.items():
                self._toggle(gui, label, stage.parts[role])
            if stage.arrows is not None:
                self._toggle(gui, f"reactions, longest {stage.largest:.3g} N", [stage.arrows])
            if stage.contacts.places:
                self._contacts(gui, stage.contacts)
        if len(t) > 1:
            self._curves(gui)

    def play(self, on: bool):
        """Play or pause."""
        self.playing, self.button.label = on, "Pause" if on else "Play"

    def run(self):
        """Move the stage with the clock, until ``stopped`` is set."""
        t, before = self.trajectory.t, time.perf_counter()
        while not self.stopped.wait(PAUSE):
            elapsed, before = time.perf_counter() - before, time.perf_counter()
            if self.playing:
                ahead = self.now + elapsed * float(self.speed.value.rstrip("×"))
                self._go(ahead if ahead <= t[-1] else float(t[0]))
                self.slider.value = self.now

    def _dragged(self):
        self.play(False)
        self._go(float(self.slider.value))

    def _go(self, t: float):
        self.now = t
        with self.stage.server.atomic():
            self.stage.to(int(abs(self.trajectory.t - t).argmin()))

    @staticmethod
    def _toggle(gui, label: str, handles: list):
        if not handles:
            return
        box = gui.add_checkbox(label, handles[0].visible)

        @box.on_update
        def _(_event):
            for handle in handles:
                handle.visible = box.value

    def _contacts(self, gui, contacts):
        box = gui.add_checkbox(f"contacts, longest {contacts.largest:.3g} N", True)

        @box.on_update
        def _(_event):
            contacts.visible = box.value
            self._go(self.now)

    def _curves(self, gui):
        """Plots of coordinates, rates and energies; of the first coordinates, where they are many."""
        from viser import uplot

        names = self.trajectory.system.coordinates[:NAMED]
        scales = {"x": uplot.Scale(time=False)}
        found = {"rates [rad/s, m/s]": self.trajectory.v[:, : len(names)]}
        if self.trajectory.system.is_flat:
            found = {"coordinates [rad, m]": self.trajectory.q[:, : len(names)]} | found
        lines = [uplot.Series(label=name, stroke=COLOURS[k % len(COLOURS)], width=2) for k, name in enumerate(names)]
        for title, columns in found.items():
            data = (self.trajectory.t, *np.ascontiguousarray(columns.T))
            gui.add_uplot(data, (uplot.Series(label="t [s]"), *lines), title=title, scales=scales, aspect=1.4)
        energies = energy(self.trajectory)
        kinetic, potential = energies.kinetic, energies.potential
        parts = {"kinetic": kinetic, "potential": potential, "sum": kinetic + potential}
        lines = [uplot.Series(label=name, stroke=COLOURS[k], width=2) for k, name in enumerate(parts)]
        data, axis = (self.trajectory.t, *parts.values()), uplot.Series(label="t [s]")
        gui.add_uplot(data, (axis, *lines), title="energies [J]", scales=scales, aspect=1.4)
