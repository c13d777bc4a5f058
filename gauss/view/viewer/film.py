"""A motion as a film, made without a browser: GIF by Pillow, MP4 by ffmpeg."""

from importlib import import_module
from pathlib import Path

import numpy as np

from gauss.errors import FileError
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.view.viewer.painter import Painter
from gauss.view.viewer.shown import shown

ENDINGS = (".gif", ".mp4")
FRAMES = 25  # per second; a GIF counts in hundredths of a second
SIZE = (800, 600)
PALE = 170  # of 255: sky, floor and shadows have no less red, green or blue


def export_film(
    thing: Scene | Trajectory,
    path,
    *,
    visuals=(),
    joints=(),
    traces=None,
    frames: int = FRAMES,
    size: tuple[int, int] = SIZE,
) -> Path:
    """Write a motion as a film.

    Parameters
    ----------
    thing : Scene or Trajectory
        What is shown; a scene is a film of one picture.
    path : str or Path
        The file: .gif, or .mp4 (``pip install imageio-ffmpeg``).
    visuals : iterable
        Meshes of bodies, see :func:`gauss.io.visuals.read_visuals`; fine ones are drawn as their convex hulls.
    joints : iterable of str
        Joints whose reactions are drawn as lines from the joint.
    traces : iterable of str, optional
        Bodies and frames that leave a trace; the bodies that carry no others when not given.
    frames : int
        Pictures per second.
    size : tuple of int
        Width and height [pixels].

    Returns
    -------
    Path
        Where it went.

    Raises
    ------
    FileError
        If the ending is another one, nothing on this machine writes it, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import gauss
    >>> from gauss.view.viewer import export_film
    >>> motion = gauss.simulate(gauss.load("pendulum"), 0.1)
    >>> export_film(motion, f"{tempfile.mkdtemp()}/pendulum.gif", size=(160, 120)).name
    'pendulum.gif'
    """
    path = Path(path)
    if path.suffix.lower() not in ENDINGS:
        raise FileError(f"{path}: a film is written as {' or '.join(ENDINGS)}.")
    write = _write_gif if path.suffix.lower() == ".gif" else _mp4_writer(path)
    if not path.resolve().parent.is_dir():
        raise FileError(f"{path}: cannot be written: there is no folder {path.resolve().parent}.")
    what = shown(thing, frames, visuals, joints, traces)
    width, height = (2 * (pixels // 2) for pixels in size)  # films of H.264 have even sides
    painter = Painter(what, width, height)
    try:
        write(path, (painter.picture(k) for k in range(len(what.pictures))), frames, (width, height))
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error}.") from error
    return path


def _write_gif(path: Path, pictures, frames: int, size: tuple[int, int]):
    from PIL import Image

    palette, images = None, []
    for pixels in pictures:
        image = Image.fromarray(pixels)
        palette = palette or Image.fromarray(_sample(pixels)).quantize(255)  # one for all: colours do not flicker
        images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    first, *rest = images
    first.save(path, save_all=True, append_images=rest, duration=round(100 / frames) * 10, loop=0)


def _sample(pixels: np.ndarray) -> np.ndarray:
    """Pixels of a picture, half of them of bodies, so that a palette has room for these, too, not for the sky alone."""
    flat = pixels.reshape(-1, 3)
    solid = flat[flat.min(axis=1) < PALE]
    return np.concatenate([flat, np.resize(solid, flat.shape)] if len(solid) else [flat])[None]


def _mp4_writer(path: Path):
    """Function that writes MP4 by the package imageio-ffmpeg, which brings ffmpeg with it."""
    try:
        ffmpeg = import_module("imageio_ffmpeg")
    except ImportError:
        raise FileError(f"{path}: MP4 is written by ffmpeg: pip install imageio-ffmpeg, or write a .gif.") from None

    def write(path: Path, pictures, frames: int, size: tuple[int, int]):
        film = ffmpeg.write_frames(str(path), size, fps=frames, macro_block_size=2)
        film.send(None)
        for pixels in pictures:
            film.send(np.ascontiguousarray(pixels))
        film.close()

    return write
