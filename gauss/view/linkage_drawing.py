"""A linkage drawn in the plane: links, pins, sliders on their guides, and the ground."""

from typing import Any

import numpy as np
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from gauss.linkages import Chain, Cycle
from gauss.scene import GROUND
from gauss.view.style import COLOURS, INK

PIN = 0.018  # sizes relative to the size of the drawing
SLIDER = (0.05, 0.03)
SUPPORT = 0.045
MARGIN = 0.08


def colours(chain: Chain) -> dict[str, str]:
    """Colour of each link, the same in every picture."""
    return {link.name: COLOURS[k % len(COLOURS)] for k, link in enumerate(chain.links)}


class Drawing:
    """Artists of one linkage on one axes.

    Parameters
    ----------
    found : Cycle
        Motion; its extent sets the limits of the axes.
    """

    def __init__(self, axes, found: Cycle):
        self.axes, self.found, self.colours = axes, found, colours(found.chain)
        self.corners = {link.name: self.corners_of(found.chain, link.name) for link in found.chain.links}
        everything = np.concatenate([*(self._world(name) for name in self.corners), *self._fixed(), *self._slots(GROUND)])
        low, high = (f([everything.real, everything.imag], axis=1) for f in (np.min, np.max))
        self.size = float(max(high - low))
        low, high = low - MARGIN * self.size, high + MARGIN * self.size
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]")
        axes.set_aspect("equal")

    @staticmethod
    def corners_of(chain: Chain, link: str) -> list[complex]:
        """Joint points of a link in its own frame; the guides that it carries are not among them."""
        joints = [j for j in chain.joints if link in (j.parent, j.child)]
        points = [j.point(link) for j in joints if j.kind == "revolute" or link == j.child]
        return list(dict.fromkeys(points))

    @staticmethod
    def _carries(joint, link: str) -> bool:
        return joint.kind == "prismatic" and joint.parent == link

    def _reach(self, joint) -> tuple[float, float]:
        """Ends of the part of a guide that its slider uses."""
        position = self.found.slide(joint.name).position + np.zeros(len(self.found))
        return float(position.min()), float(position.max())

    def _world(self, link: str) -> np.ndarray:
        moving, slots = self.found.link(link), [end for slot in self._slots(link) for end in slot]
        return np.concatenate([np.ravel(moving.point(c) + np.zeros(len(self.found))) for c in (*self.corners[link], *slots)])

    def _fixed(self) -> list[np.ndarray]:
        joints = self.found.chain.joints
        return [np.array([j.point(GROUND)]) for j in joints if j.kind == "revolute" and GROUND in (j.parent, j.child)]

    def _slots(self, link: str) -> list[np.ndarray]:
        """Ends of the guides that a link carries, in its frame, as far as their sliders use them."""
        joints = [j for j in self.found.chain.joints if self._carries(j, link)]
        return [np.array([j.point(link) + s * j.direction(link) for s in self._reach(j)]) for j in joints]

    def ground(self):
        """Draw supports and guides of the frame."""
        for (pin,) in self._fixed():
            d = SUPPORT * self.size
            foot = pin + d * np.array([-0.6 - 1j, 0.6 - 1j])
            self.axes.add_patch(Polygon(_columns([pin, *foot]), facecolor="white", edgecolor=INK, linewidth=1.0, zorder=1))
            self._hatch(foot[0] - 0.3 * d, foot[1] + 0.3 * d)
        for ends in self._slots(GROUND):
            along = (ends[1] - ends[0]) / max(abs(ends[1] - ends[0]), 1e-12)
            offset = -1j * along * SLIDER[1] * self.size
            self._hatch(*(ends + np.array([-1, 1]) * along * SLIDER[0] * self.size + offset))

    def _hatch(self, start: complex, end: complex):
        """Ground line with strokes on its right."""
        self.axes.plot(*_columns([start, end]).T, color=INK, linewidth=1.2, zorder=1)
        along = (end - start) / abs(end - start)
        for x in np.linspace(start, end, max(4, int(abs(end - start) / (0.025 * self.size)))):
            stroke = x + 0.02 * self.size * along * np.exp(-0.75j * np.pi)
            self.axes.plot(*_columns([x, stroke]).T, color=INK, linewidth=0.7, zorder=1)

    def path(self, link: str, at: complex, **style):
        """Draw the curve of a point over the cycle."""
        x = self.found.link(link).point(at) + np.zeros(len(self.found))
        self.axes.plot(x.real, x.imag, **({"color": "0.6", "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 0} | style))

    def links(self, index: int, alpha: float = 1.0) -> list:
        """Draw all links at one crank angle and return the artists."""
        artists = []
        for name in self.corners:
            artists += self._link(name, index, alpha)
        for joint in self.found.chain.joints:
            if joint.kind == "revolute":
                x = _at(self.found.link(joint.child).point(joint.point(joint.child)), index)
                size = 72 * PIN * 4
                artists += self.axes.plot(
                    x.real, x.imag, "o", markersize=size, color="white", markeredgecolor=INK, alpha=alpha, zorder=4
                )
        return artists

    def names(self, index: int):
        """Write the names of joints and links beside them."""
        places: dict[tuple, list[str]] = {}
        for joint in self.found.chain.joints:
            x = _at(self.found.link(joint.child).point(joint.point(joint.child)), index)
            places.setdefault((round(x.real / self.size, 3), round(x.imag / self.size, 3)), []).append(joint.name)
        for place, names in places.items():
            self._text(self.size * complex(*place), ", ".join(names), INK, (6, 6))
        for name, corners in self.corners.items():
            if len(corners) > 1:
                middle = _at(self.found.link(name).point(sum(corners) / len(corners)), index)
                self._text(middle, name, self.colours[name], (-4, -13))

    def _text(self, x: complex, text: str, colour: str, offset: tuple[int, int]):
        style = {"xytext": offset, "textcoords": "offset points", "fontsize": "small", "color": colour, "zorder": 5}
        halo = [withStroke(linewidth=2.5, foreground="white")]
        self.axes.annotate(text, (x.real, x.imag), path_effects=halo, **style)

    def _link(self, name: str, index: int, alpha: float) -> list:
        moving = self.found.link(name)
        corners = np.array([_at(moving.point(c), index) for c in self.corners[name]])
        style: dict[str, Any] = {"color": self.colours[name], "alpha": alpha, "zorder": 3}
        artists = []
        if corners.size > 2 and _area(corners) > 1e-4 * self.size**2:
            corners = corners[np.argsort(np.angle(corners - corners.mean()))]
            artists.append(self.axes.add_patch(Polygon(_columns(corners), **(style | {"alpha": 0.35 * alpha, "zorder": 2}))))
            corners = np.append(corners, corners[0])
        if corners.size > 1:
            artists += self.axes.plot(corners.real, corners.imag, linewidth=3.0, solid_capstyle="round", **style)
        pale = style | {"alpha": 0.35 * alpha}
        for slot in self._slots(name):
            x = np.array([_at(moving.point(c), index) for c in slot])
            artists += self.axes.plot(x.real, x.imag, linewidth=6.0, solid_capstyle="round", **pale)
        for joint in self.found.chain.joints:
            if joint.kind == "prismatic" and joint.child == name:
                at, u = _at(moving.point(joint.point(name)), index), joint.direction(name) * _at(moving.e, index)
                half = np.array([1, -1, -1, 1]) * SLIDER[0] + 1j * np.array([1, 1, -1, -1]) * SLIDER[1]
                box = at + self.size * u * half / 1.2
                artists.append(self.axes.add_patch(Polygon(_columns(box), **(style | {"alpha": 0.8 * alpha}))))
        return artists


def _at(values, index: int) -> complex:
    return complex(values if np.ndim(values) == 0 else values[index])


def _columns(points) -> np.ndarray:
    z = np.asarray(points)
    return np.stack([z.real, z.imag], axis=1)


def _area(z: np.ndarray) -> float:
    z = z[np.argsort(np.angle(z - z.mean()))]
    return abs(np.sum(np.conj(z) * np.roll(z, -1)).imag) / 2
