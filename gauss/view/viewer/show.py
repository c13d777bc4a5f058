"""Show a scene or a motion in the browser, or write it to a file that needs nothing else."""

import socket
import threading
import time
import webbrowser
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from pathlib import Path

import rich
import viser

from gauss.errors import FileError, writing
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.view.viewer.panel import with_panel
from gauss.view.viewer.player import Player
from gauss.view.viewer.poser import Poser
from gauss.view.viewer.shown import FRAMES, Shown, shown
from gauss.view.viewer.stage import ViewerStage

LOOPBACK = "127.0.0.1"  # the viewer is not visible on the network
HEIGHT = 520  # of the viewer inside a notebook


class Viewer:
    """A viewer that runs; close it with :meth:`close`.

    Parameters
    ----------
    what : Shown
        What is shown.
    port : int
        Port of the viewer on this machine.
    dark : bool
        Whether the ground is dark.
    beside : Shown, optional
        Second motion.

    Attributes
    ----------
    url : str
        Where a browser finds it.

    Examples
    --------
    >>> import gauss
    >>> viewer = gauss.show(gauss.load("pendulum"), port=8123)
    >>> viewer.url.startswith("http://127.0.0.1:")
    True
    >>> viewer.close()
    """

    def __init__(self, what: Shown, port: int, dark: bool = False, beside: Shown | None = None):
        self.server = _server(port, what.motion.system.scene.name)
        self.url = f"http://{LOOPBACK}:{self.server.get_port()}"
        stage = ViewerStage(self.server, what, dark)
        second = None if beside is None else ViewerStage(self.server, beside, beside=stage)
        stage.make_room(second)
        moves = len(what.pictures) > 1 or second is not None
        self.player: Player | Poser = Player(stage, second) if moves else Poser(stage)
        self.clock = threading.Thread(target=self.player.run, daemon=True)
        self.clock.start()

    def _repr_html_(self) -> str:
        """Viewer inside a notebook whose kernel runs on this machine."""
        return f'<iframe src="{self.url}" width="100%" height="{HEIGHT}" style="border:none"></iframe>'

    def close(self):
        """Stop the clock and the server."""
        self.player.stopped.set()
        self.clock.join()
        _stop(self.server)

    def wait(self):
        """Wait until the user interrupts."""
        try:
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            self.close()


@dataclass(frozen=True)
class Page:
    """A motion as one page that needs no server; a notebook shows it where it is the value of a cell, and keeps it.

    Attributes
    ----------
    html : str
        The page.

    Examples
    --------
    >>> import gauss
    >>> from gauss.view.viewer import page
    >>> shown = page(gauss.load("pendulum"))  # a notebook shows it
    >>> type(shown).__name__
    'Page'
    """

    html: str = field(repr=False)

    def _repr_html_(self) -> str:
        """Page inside a notebook."""
        return f'<iframe srcdoc="{escape(self.html)}" width="100%" height="{HEIGHT}" style="border:none"></iframe>'


def show(
    thing: Scene | Trajectory,
    *,
    visuals=(),
    joints=(),
    traces=None,
    beside: Trajectory | None = None,
    beside_visuals=(),
    dark: bool = False,
    port: int = 8080,
    browser: bool = False,
) -> Viewer:
    """Show a scene or a motion in the browser; only this machine can see it.

    A scene is posed by sliders, and runs from there, while bodies are dragged by a spring. A motion plays or is stepped
    through, with its curves beside it.

    Parameters
    ----------
    thing : Scene or Trajectory
        What is shown.
    visuals : iterable
        Meshes of bodies, see :func:`gauss.io.visuals.read_visuals`; generated shapes for the bodies that have none.
    joints : iterable of str
        Joints whose reactions are drawn as arrows.
    traces : iterable of str, optional
        Bodies and frames that leave a trace; the bodies that carry no others when not given.
    beside : Trajectory, optional
        Second motion, which plays beside the first at the same times.
    beside_visuals : iterable
        Meshes of the bodies of the second motion.
    dark : bool
        Whether the ground is dark at first.
    port : int
        Port of the viewer.
    browser : bool
        Open a browser.

    Returns
    -------
    Viewer
        With the ``url``; it runs until it is closed. A notebook shows it where it is the value of a cell.

    Raises
    ------
    FileError
        If the port is taken.
    StateError
        If a trace is named after nothing.
    """
    with socket.socket() as probe:
        if probe.connect_ex((LOOPBACK, port)) == 0:
            raise FileError(f"port {port} is taken, perhaps by another viewer; choose another one with port=.")
    second = None if beside is None else shown(beside, 2 * FRAMES, beside_visuals)
    viewer = Viewer(shown(thing, 2 * FRAMES, visuals, joints, traces), port, dark, second)
    if browser:
        webbrowser.open(viewer.url)
    return viewer


def page(
    thing: Scene | Trajectory,
    *,
    visuals=(),
    joints=(),
    traces=None,
    beside: Trajectory | None = None,
    beside_visuals=(),
    dark: bool = False,
    frames: int = FRAMES,
) -> Page:
    """Put a scene or motion on one page that plays in any browser, without a network, and inside a notebook.

    Beside the scene are curves, cameras, steps, and the layers: links, frames, paths, forces.

    Parameters
    ----------
    thing, visuals, joints, traces, beside, beside_visuals, dark
        As for :func:`show`.
    frames : int
        Pictures per second.

    Returns
    -------
    Page
        With its ``html``; a notebook shows it where it is the value of a cell.

    Examples
    --------
    >>> import gauss
    >>> from gauss.view.viewer import page
    >>> shown = page(gauss.simulate(gauss.load("pendulum"), 0.1), dark=True)
    >>> type(shown).__name__
    'Page'
    """
    what = shown(thing, frames, visuals, joints, traces)
    server = _server(_free_port(), what.motion.system.scene.name)
    try:
        stages = [ViewerStage(server, what, dark)]
        if beside is not None:
            stages.append(ViewerStage(server, shown(beside, frames, beside_visuals), beside=stages[0]))
        stages[0].make_room(stages[-1] if len(stages) > 1 else None, aside=0.0)
        times = max((stage.trajectory.t for stage in stages), key=lambda t: float(t[-1]))
        recording = server.get_scene_serializer()
        for before, t in pairwise(times):
            recording.insert_sleep(float(t - before))
            for stage in stages:
                stage.at(t)
        return Page(with_panel(recording.as_html(dark), stages))
    finally:
        _stop(server)


def export_html(thing: Scene | Trajectory, path, **options) -> Path:
    """Write a scene or motion as one HTML file that plays in any browser, without a network.

    Parameters
    ----------
    thing : Scene or Trajectory
        What is shown.
    path : str or Path
        The file, .html.
    **options
        As for :func:`page`.

    Returns
    -------
    Path
        Where it went.

    Raises
    ------
    FileError
        If the ending is another one, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".html":
        raise FileError(f"{path}: a viewer is written as .html.")
    text = page(thing, **options).html
    with writing(path):
        path.write_text(text, encoding="utf-8")
    return path


def _server(port: int, label: str) -> viser.ViserServer:
    with _silently():
        return viser.ViserServer(host=LOOPBACK, port=port, verbose=False, label=label)


def _stop(server: viser.ViserServer):
    with _silently():
        server.stop()


@contextmanager
def _silently():
    """Viser says by rich, not only on stdout, where it listens and when it stops: a notebook would show it."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
