"""Show a scene or a motion in the browser, or write it to a file that needs nothing else."""

import socket
import threading
import time
import webbrowser
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import viser

from gauss.dynamics import compile_scene
from gauss.errors import FileError
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.simulation.trajectory import Stats
from gauss.view.viewer.frames import resampled
from gauss.view.viewer.player import Player
from gauss.view.viewer.stage import Stage

LOOPBACK = "127.0.0.1"  # nobody else on the network sees the viewer
FRAMES = 30  # per second
MOST = 1800  # frames of a file; a longer motion has fewer per second
NOTHING = Stats(0, 0, 0, 0, 0.0, 0.0, "not simulated")


class Viewer:
    """A viewer that runs; close it with :meth:`close`.

    Attributes
    ----------
    url : str
        Where a browser finds it.
    """

    def __init__(self, motion: Trajectory, visuals, joints, port: int):
        self.server = _server(port, motion.system.scene.name)
        self.url = f"http://{LOOPBACK}:{self.server.get_port()}"
        self.player = Player(Stage(self.server, motion, visuals, joints))
        self.clock = threading.Thread(target=self.player.run, daemon=True)
        self.clock.start()

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


def show(thing: Scene | Trajectory, *, visuals=(), joints=(), port: int = 8080, browser: bool = False) -> Viewer:
    """Show a scene in its start, or a motion, in the browser; only this machine can see it.

    Parameters
    ----------
    thing : Scene or Trajectory
        What is shown.
    visuals : iterable
        Meshes of bodies, see :func:`gauss.io.visuals.read_visuals`; generated shapes for the bodies that have none.
    joints : iterable of str
        Joints whose reactions are drawn as arrows.
    port : int
        Port of the viewer.
    browser : bool
        Open a browser.

    Returns
    -------
    Viewer
        With the ``url``; it runs until it is closed.

    Raises
    ------
    FileError
        If the port is taken.
    """
    with socket.socket() as probe:
        if probe.connect_ex((LOOPBACK, port)) == 0:
            raise FileError(f"port {port} is taken, perhaps by another viewer; choose another one with port=.")
    viewer = Viewer(_shown(thing, None), tuple(visuals), tuple(joints), port)
    if browser:
        webbrowser.open(viewer.url)
    return viewer


def export_html(thing: Scene | Trajectory, path, *, visuals=(), joints=(), frames: int = FRAMES) -> Path:
    """Write a scene or motion as one HTML file that plays in any browser, without a network.

    Parameters
    ----------
    thing : Scene or Trajectory
        What is shown.
    path : str or Path
        The file, .html.
    visuals, joints
        As for :func:`show`.
    frames : int
        Pictures per second.

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
    motion = _shown(thing, frames)
    server = _server(_free_port(), motion.system.scene.name)
    try:
        stage = Stage(server, motion, tuple(visuals), tuple(joints))
        recording = server.get_scene_serializer()
        for k in range(1, len(motion)):
            recording.insert_sleep(float(motion.t[k] - motion.t[k - 1]))
            stage.to(k)
        text = recording.as_html()
    finally:
        _stop(server)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}.") from error
    return path


def _shown(thing: Scene | Trajectory, frames: int | None) -> Trajectory:
    """Motion of equally spaced samples; a scene is a motion of one."""
    if isinstance(thing, Scene):
        system = compile_scene(thing)
        start = system.initial_state()
        return Trajectory(system, np.array([start.t]), start.q[None], start.v[None], np.zeros((1, 3)), NOTHING)
    span = float(thing.t[-1] - thing.t[0])
    return resampled(thing, max(1, min(MOST, 1 + round(span * (frames or 2 * FRAMES)))))


def _server(port: int, label: str) -> viser.ViserServer:
    with redirect_stdout(StringIO()):  # it prints a table
        return viser.ViserServer(host=LOOPBACK, port=port, verbose=False, label=label)


def _stop(server: viser.ViserServer):
    with redirect_stdout(StringIO()):
        server.stop()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
