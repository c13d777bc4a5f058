"""Show a scene or a motion in the browser, or write it to a file that needs nothing else."""

import socket
import threading
import time
import webbrowser
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import rich
import viser

from gauss.errors import FileError
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.view.viewer.player import Player
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

    Attributes
    ----------
    url : str
        Where a browser finds it.
    """

    def __init__(self, what: Shown, port: int):
        self.server = _server(port, what.motion.system.scene.name)
        self.url = f"http://{LOOPBACK}:{self.server.get_port()}"
        stage = ViewerStage(self.server, what)
        stage.make_room()
        self.player = Player(stage)
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
    """

    html: str = field(repr=False)

    def _repr_html_(self) -> str:
        """Page inside a notebook."""
        return f'<iframe srcdoc="{escape(self.html)}" width="100%" height="{HEIGHT}" style="border:none"></iframe>'


def show(
    thing: Scene | Trajectory, *, visuals=(), joints=(), traces=None, port: int = 8080, browser: bool = False
) -> Viewer:
    """Show a scene in its start, or a motion, in the browser; only this machine can see it.

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
    viewer = Viewer(shown(thing, 2 * FRAMES, visuals, joints, traces), port)
    if browser:
        webbrowser.open(viewer.url)
    return viewer


def page(thing: Scene | Trajectory, *, visuals=(), joints=(), traces=None, frames: int = FRAMES) -> Page:
    """Put a scene or motion on one page that plays in any browser, without a network, and inside a notebook.

    Parameters
    ----------
    thing, visuals, joints, traces
        As for :func:`show`.
    frames : int
        Pictures per second.

    Returns
    -------
    Page
        With its ``html``; a notebook shows it where it is the value of a cell.
    """
    what = shown(thing, frames, visuals, joints, traces)
    server, motion = _server(_free_port(), what.motion.system.scene.name), what.pictures
    try:
        stage = ViewerStage(server, what)
        recording = server.get_scene_serializer()
        for k in range(1, len(motion)):
            recording.insert_sleep(float(motion.t[k] - motion.t[k - 1]))
            stage.to(k)
        return Page(recording.as_html())
    finally:
        _stop(server)


def export_html(thing: Scene | Trajectory, path, *, visuals=(), joints=(), traces=None, frames: int = FRAMES) -> Path:
    """Write a scene or motion as one HTML file that plays in any browser, without a network.

    Parameters
    ----------
    thing, visuals, joints, traces, frames
        As for :func:`page`.
    path : str or Path
        The file, .html.

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
    text = page(thing, visuals=visuals, joints=joints, traces=traces, frames=frames).html
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}.") from error
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
