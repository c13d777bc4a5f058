"""The moving picture of the start page and of the README: ``python -m gauss.cli.docs.film`` writes it from the example.

The walking leg of ``models/examples`` over one turn of its crank, with the path of its foot.
"""

from io import BytesIO
from pathlib import Path
from runpy import run_path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from gauss.io.catalog import folder
from gauss.view.skeleton import lines, placed
from gauss.view.style import COLOURS

FRAMES, MILLISECONDS, COLOUR_COUNT = 48, 50, 32


def main(path: Path = Path(__file__).parent / "pages" / "pictures" / "walker.gif"):
    """Write the film."""
    example = run_path(str(folder() / "examples" / "loops" / "walking_leg.py"))
    motion, foot = example["motion"], example["foot"]
    samples = np.linspace(0, len(motion) - 1, FRAMES, endpoint=False).astype(int)
    shapes = {name: points[:, :, [0, 2]] for name, points in placed(motion).items() if name != "ground"}
    shapes["lower"] = np.concatenate([shapes["lower"], foot[:, None, [0, 2]]], axis=1)  # a triangle
    pictures = [_drawn(shapes, foot[:, [0, 2]], sample) for sample in samples]
    first, *others = [picture.quantize(COLOUR_COUNT, dither=Image.Dither.NONE) for picture in pictures]
    first.save(path, save_all=True, append_images=others, duration=MILLISECONDS, loop=0, optimize=True)
    print(path, path.stat().st_size)


def _drawn(shapes: dict[str, np.ndarray], foot: np.ndarray, sample: int) -> Image.Image:
    """One picture: bars, pins, the path of the foot."""
    figure = Figure(figsize=(4.4, 4.4), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.plot(*foot.T, color="#c0392b", linewidth=1.5, zorder=1)
    for k, points in enumerate(shapes.values()):
        for a, b in lines(points[0]):
            axes.plot(
                *points[sample, [a, b]].T, color=COLOURS[k % len(COLOURS)], linewidth=5, solid_capstyle="round", zorder=2
            )
        axes.plot(*points[sample].T, "o", color="white", markeredgecolor="#333333", markersize=5, zorder=3)
    axes.plot(*foot[sample], "o", color="#c0392b", markersize=8, zorder=4)
    axes.set(xlim=(-1.1, 0.3), ylim=(-0.98, 0.42), aspect="equal")
    axes.set_axis_off()
    stream = BytesIO()
    figure.savefig(stream, dpi=100, format="png")
    return Image.open(stream).convert("RGB")


if __name__ == "__main__":
    main()
