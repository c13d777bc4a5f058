"""Sliders that pose a scene, and a run of it from there in which bodies are dragged by a spring.

A slider sets one coordinate; where joints close loops the others follow by assembly with this coordinate kept.
"""

import threading
import time

import numpy as np

from gauss.errors import GaussError
from gauss.simulation import Simulator
from gauss.system import State, coordinate_units
from gauss.view.viewer.controls import add_layers, add_view
from gauss.view.viewer.pulling import WRENCH, BodyPull, pull_simulator
from gauss.view.viewer.stage import ViewerStage

STEP = 1e-3  # of the run [s]
STEPS = 2  # between two values of the force of the spring
FRAME = 1 / 60  # between two pictures [s]
LATEST = 0.05  # of the clock that is made up for, where the machine is slower [s]
TURN = float(np.pi)  # reach of the slider of an angle without limits [rad]
FINEST = 1e-3  # step of a slider, of its reach
HINT = "Drag a body to pull it by a spring."


class Poser:
    """Clock and controls of a scene that is posed and dragged.

    Parameters
    ----------
    stage : ViewerStage
        What is moved.
    """

    def __init__(self, stage: ViewerStage):
        self.stage, self.system = stage, stage.trajectory.system
        self.state = self.begun = stage.trajectory.state(0)
        self.playing, self.stopped, self.lock = False, threading.Event(), threading.RLock()
        self.pull: BodyPull | None = None
        self.simulators: dict[str, Simulator] = {}
        self.current: Simulator | None = None  # the one that is in the present state
        self.body = self.system.structure.bodies[-1] if self.system.structure.bodies else ""
        gui = stage.server.gui
        gui.add_markdown(f"**{self.system.scene.name}**")
        self.button = gui.add_button("Run")
        self.button.on_click(lambda _: self.play(not self.playing))
        group = gui.add_button_group("run", ("step", "reset"))
        group.on_click(lambda _: self.advance(FRAME) if group.value == "step" else self.reset())
        self.said = gui.add_markdown(HINT)
        self.turning: set[str] = set()  # angles without limits, of which sliders show what is within a turn
        with gui.add_folder("pose"):
            self.sliders = {name: self._slider(gui, name, unit) for name, unit in self._plain().items()}
        add_layers([stage], lambda: None)
        add_view(stage)
        # In a drag browsers print that preventDefault fails: viser's client calls it in a listener that react-three-fiber
        # has registered as passive. The drag is not affected, as viser locks its camera itself.
        for body, node in stage.solids:
            node.on_drag("left")(lambda event, body=body: self._dragged(event, body))

    def play(self, on: bool):
        """Run or pause."""
        self.playing, self.button.label = on, "Pause" if on else "Run"

    def reset(self):
        """Back to the start of the scene."""
        self.play(False)
        self._place(self.begun)

    def pose(self, name: str, value: float):
        """Set one coordinate, at rest; the others follow where joints close loops.

        GaussError if the loops do not close there.
        """
        q = self.state.q.copy()
        q[list(coordinate_units(self.system)).index(name)] = value
        v = np.zeros(self.system.n_v)
        closed = self.system.has_closures
        self._place(self.system.initial_state(q, v, keep=[name]) if closed else self.system.state(q, v, self.begun.t))

    def advance(self, span: float):
        """Move the run on by a span [s], under the spring where a body is dragged."""
        with self.lock:
            try:
                simulator = self._simulator()
                inputs = np.zeros(len(simulator.inputs))
                for _ in range(max(1, round(span / (STEP * STEPS)))):
                    inputs[-WRENCH:] = 0.0 if self.pull is None else self.pull.effort(simulator.state)
                    simulator.step(inputs, n=STEPS)
            except GaussError as error:
                self.play(False)
                self.pull, self.said.content = None, str(error)
                return
            self._place(simulator.state)
            self.current = simulator

    def run(self):
        """Move the stage with the clock, until ``stopped`` is set."""
        before = time.perf_counter()
        while not self.stopped.wait(FRAME / 4):
            elapsed = time.perf_counter() - before
            if elapsed >= FRAME:
                before = time.perf_counter()
                if self.playing:
                    self.advance(min(elapsed, LATEST))

    def _plain(self) -> dict[str, str]:
        """Names and units of the coordinates that are no part of a quaternion."""
        return {name: unit for name, unit in coordinate_units(self.system).items() if unit != "1"}

    def _slider(self, gui, name: str, unit: str):
        joint = self.system.scene.joints.get(name)
        reach = TURN if unit == "rad" else self.stage.framing.reach
        value = float(self.state.q[list(coordinate_units(self.system)).index(name)])
        limits = joint.limits if joint is not None else None
        if limits is None and unit == "rad":
            self.turning.add(name)
            value = within_a_turn(value)
        low, high = limits or (-reach, reach)
        low, high = min(low, value), max(high, value)
        digits = int(np.ceil(-np.log10(FINEST * (high - low))))
        low, high, value = (round(number, digits) for number in (low, high, value))
        slider = gui.add_slider(f"{name} [{unit}]", low, high, 10.0**-digits, value)

        @slider.on_update
        def _(event):
            if event.client is not None:
                self._slid(name, float(slider.value))

        return slider

    def _slid(self, name: str, value: float):
        self.play(False)
        self.said.content = HINT
        try:
            self.pose(name, value)
        except GaussError:
            self.said.content = f"{name} = {value:.3g}: the loops do not close there."

    def _place(self, state: State):
        with self.lock, self.stage.server.atomic():
            self.state, self.current = state, None
            self.stage.place(state)
            for name, column in zip(coordinate_units(self.system), state.q, strict=True):
                if name in self.sliders:
                    self._slide(name, float(column))

    def _slide(self, name: str, value: float):
        """Show the value of a coordinate by its slider, in steps of that."""
        slider, turns = self.sliders[name], name in self.turning
        if turns and abs(within_a_turn(value - slider.value)) < slider.step:  # as at its ends, which are one direction
            return
        value = within_a_turn(value) if turns else value
        digits = int(round(-np.log10(slider.step)))
        slider.value = float(np.clip(round(value, digits), slider.min, slider.max))

    def _simulator(self) -> Simulator:
        """Simulator whose inputs act on the dragged body, in the present state."""
        if self.body not in self.simulators:
            self.said.content = "Compiling …"
            self.simulators[self.body] = pull_simulator(self.system.scene, self.body, STEP)
            self.said.content = HINT
        found = self.simulators[self.body]
        if found is not self.current:
            found.reset(self.state)
            self.current = found
        return found

    def _dragged(self, event, body: str):
        with self.lock:
            if event.phase == "start":
                self._grasp(body, np.array(event.start_position))
            elif event.phase == "end":
                self.pull = None
            if self.pull is not None:
                self.pull.goal = np.array(event.end_position)

    def _grasp(self, body: str, point: np.ndarray):
        """Hold a body at a point by the spring, and run."""
        try:
            self.body = body
            self.pull = BodyPull(self._simulator(), body, point)
            self.play(True)
        except GaussError as error:
            self.pull, self.said.content = None, str(error)


def within_a_turn(angle: float) -> float:
    """Angle in [−π, π) of the same direction [rad]."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
