"""Style of all figures: formats, colours, curves with units on the axes, saving."""

from pathlib import Path

from matplotlib.figure import Figure

from gauss.errors import FileError, writing

FORMATS = (".png", ".svg", ".pdf")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#7F7F7F")  # Okabe and Ito
LINES = ("-", "--", "-.", ":")
INK = "#333333"
NAMED = 12  # more curves than this are not distinguished by name
FLAT_CHANGE = 1e-9  # relative to a unit of the scene: what changes by less is rounding, and is drawn as a flat line
DPI = 150
PAGE_DPI = 140  # of figures beside pages of results


def check_format(path):
    """Refuse, before anything is computed, a path that no figure can be saved to.

    FileError if its format is none of :data:`FORMATS`, or there is no such folder.
    """
    if path is None:
        return
    if Path(path).suffix.lower() not in FORMATS:
        raise FileError(f"{path}: a figure is saved as one of {', '.join(FORMATS)}.")
    if not Path(path).parent.is_dir():
        raise FileError(f"{path}: there is no folder {str(Path(path).parent)!r}.")


def saved(figure: Figure, path, dpi: int = DPI) -> Figure:
    """Figure, saved if there is a path; FileError if the file cannot be written."""
    if path is not None:
        with writing(path):
            figure.savefig(path, dpi=dpi)
    return figure


def looks(k: int) -> dict:
    """Colour and line of the k-th curve: all colours, then all colours again with another line."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": LINES[k // len(COLOURS) % len(LINES)], "linewidth": 1.3}


def curves(axes, t, columns: dict, label: str):
    """Draw named curves against time, with the label of their axis; of many, those of one element have one colour."""
    elements = list(dict.fromkeys(name.partition(".")[0] for name in columns))
    many = len(columns) > NAMED and len(elements) < len(columns)
    drawn: dict[str, int] = dict.fromkeys(elements, 0)
    for k, (name, column) in enumerate(columns.items()):
        element = name.partition(".")[0]
        look = looks(elements.index(element)) | {"linestyle": LINES[drawn[element] % len(LINES)]} if many else looks(k)
        axes.plot(t, column, label="_" * bool(drawn[element]) + element if many else name, **look)
        drawn[element] += 1
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)


def legend(axes, beside: bool = True):
    """Legend beside the axes, or inside; none if there are no curves, or too many to tell apart."""
    if 0 < len(axes.get_legend_handles_labels()[1]) <= NAMED:
        place = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if beside else {}
        axes.legend(fontsize="small", frameon=False, **place)


def unit_sizes(system) -> dict[str, float]:
    """Sizes of quantities by their units, from the scale of a system."""
    scale = system.scale
    speed = scale.length / scale.time
    return {"rad": 1.0, "m": scale.length, "1": 1.0, "rad/s": 1.0 / scale.time, "m/s": speed, "J": scale.mass * speed**2}


def keep_flat(axes, size: float):
    """Widen the ordinate to a share of a size, if all curves are within it."""
    low, high = axes.get_ylim()
    if high - low < 2 * FLAT_CHANGE * size:
        axes.set_ylim((low + high) / 2 - FLAT_CHANGE * size, (low + high) / 2 + FLAT_CHANGE * size)
