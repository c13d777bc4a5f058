"""Panel beside the scene of a page: steps, cameras, layers, and curves with a cursor that moves with the scene."""

import io
import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from gauss.analysis import energy
from gauss.simulation import Trajectory
from gauss.system import coordinate_units, rate_units
from gauss.view.style import NAMED, keep_flat, looks, unit_sizes
from gauss.view.viewer.framing import CAMERAS, eye
from gauss.view.viewer.stage import ViewerStage

WIDTH, HEIGHT = 3.3, 1.5  # of the axes of one quantity [inch]
LEFT, RIGHT = 0.17, 0.97  # ends of all time axes, of the width
MOST_POINTS = 500  # points of a curve
SIDES = (", left", ", right")  # where two motions are beside each other
INK = {False: "#333333", True: "#dfe3e8"}  # on light and on dark
LAYERS = {"link": "links", "joint": "joints", "contact": "shapes", "frame": "frames", "path": "paths"}


def with_panel(page: str, stages: list[ViewerStage]) -> str:
    """Page with the panel beside its scene.

    Parameters
    ----------
    page : str
        Page of viser.
    stages : list of ViewerStage
        Stages that are recorded on it; times are those of the longest.
    """
    first = stages[0]
    t = max((stage.trajectory.t for stage in stages), key=lambda t: float(t[-1]))
    given = {
        "cameras": {name: eye(first.framing, name).tolist() for name in CAMERAS},
        "middle": first.framing.middle.tolist(),
        "layers": _layers(stages),
        "span": float(t[-1] - t[0]),
        "step": float(t[1] - t[0]) if len(t) > 1 else 0.0,
        "left": LEFT,
        "right": RIGHT,
    }
    title = " | ".join(stage.trajectory.system.scene.name for stage in stages)
    sides = SIDES if len(stages) > 1 else ("",)
    figures = [
        _curves(stage.trajectory, float(t[-1]), first.ground.dark, side)
        for stage, side in zip(stages if len(t) > 1 else [], sides, strict=False)
    ]
    text = Path(__file__).with_name("panel.html").read_text(encoding="utf-8")
    text = text.replace("CLASS", "dark" if first.ground.dark else "light").replace("TITLE", escape(title))
    text = text.replace("CURVES", "".join(figures)).replace("GIVEN", json.dumps(given).replace("<", "\\u003c"))
    head, end, tail = page.rpartition("</body>")
    return head + text + end + tail


def _layers(stages: list[ViewerStage]) -> dict[str, dict]:
    """Nodes of each layer, and whether they are seen at first."""
    found = {}
    for role, label in LAYERS.items():
        handles = [handle for stage in stages for handle in stage.parts[role]]
        if handles:
            found[label] = {"nodes": [handle.name for handle in handles], "visible": bool(handles[0].visible)}
    reactions = [stage.arrows.name for stage in stages if stage.arrows is not None]
    contacts = [stage.contacts.node for stage in stages if stage.contacts.places]
    for label, nodes in (("reactions", reactions), ("contact forces", contacts)):
        if nodes:
            found[label] = {"nodes": nodes, "visible": True}
    return found


def _curves(trajectory: Trajectory, end: float, dark: bool, side: str) -> str:
    """Coordinates, rates and energies against time, as SVG."""
    found, ink, sizes = _quantities(trajectory), INK[dark], unit_sizes(trajectory.system)
    kept = np.unique(np.linspace(0, len(trajectory) - 1, MOST_POINTS).astype(int))
    style: Any = {"svg.fonttype": "none", "font.size": 7, "text.color": ink, "axes.edgecolor": ink, "axes.labelcolor": ink}
    with rc_context(style | {"xtick.color": ink, "ytick.color": ink}):
        high = HEIGHT * len(found)
        figure = Figure(figsize=(WIDTH, high))
        for row, (label, columns) in enumerate(found.items()):
            low = (len(found) - row - 1 + 0.2) / len(found)
            axes = figure.add_axes((LEFT, low, RIGHT - LEFT, 0.66 / len(found)), facecolor="none")
            for k, (name, column) in enumerate(columns.items()):
                axes.plot(trajectory.t[kept], column[kept], label=name, **looks(k))
            axes.set_xlim(trajectory.t[0], end)
            keep_flat(axes, sizes[label.partition("[")[2].removesuffix("]")])
            axes.set_title(label + side, loc="left", pad=3)
            axes.grid(alpha=0.25)
            if len(columns) <= NAMED:
                axes.legend(fontsize=6, frameon=False, handlelength=1.2, ncols=2 if len(columns) > 4 else 1)
        axes.set_xlabel("t [s]", labelpad=1)
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def _quantities(trajectory: Trajectory) -> dict[str, dict[str, np.ndarray]]:
    """Curves by name of each pair of axes."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for unit, label in (("rad", "coordinates [rad]"), ("m", "coordinates [m]")):
        columns = zip(coordinate_units(trajectory.system).items(), trajectory.q.T, strict=True)
        found[label] = {name: column for (name, own), column in columns if own == unit}
    for unit, label in (("rad/s", "rates [rad/s]"), ("m/s", "rates [m/s]")):
        columns = zip(rate_units(trajectory.system).items(), trajectory.v.T, strict=True)
        found[label] = {name: column for (name, own), column in columns if own == unit}
    parts = energy(trajectory)
    energies = {"kinetic": parts.kinetic, "potential": parts.potential, "sum": parts.kinetic + parts.potential}
    return {label: columns for label, columns in found.items() if columns} | {"energies [J]": energies}
