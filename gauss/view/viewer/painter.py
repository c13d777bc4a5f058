"""Pictures of a motion without a browser: triangles in perspective, the far ones first, with light and shadow."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from gauss.analysis import reactions
from gauss.scene import GROUND
from gauss.view.style import COLOURS, INK
from gauss.view.viewer.forms import BodyMesh, forms, size
from gauss.view.viewer.framing import FIELD, framing
from gauss.view.viewer.shown import Shown
from gauss.view.viewer.stage import ARROW, colour_of
from gauss.view.viewer.touches import TouchingPoint, touches

DPI = 100
FINEST = 1500  # triangles of one mesh; a finer one is drawn as its convex hull
LIGHT = np.array([-0.45, -0.55, 1.0]) / np.linalg.norm([-0.45, -0.55, 1.0])  # right, away, up: towards the lamp
GLOSS = 1.08  # brightness of what faces the light
SHADE = 0.5  # brightness of what no light falls on
TOP, BOTTOM = np.array([214, 224, 236]), np.array([250, 250, 251])  # colours of the background
SHADOW, GRID, TRACE = "#dde1e7", "#d3d8df", 1.6  # colours of shadow and floor, width of a trace [points]
CELLS = 10  # of the floor, over all that is seen
ARROWS = ("#C81E1E", "#EB7814")  # of reactions and contact forces


@dataclass(frozen=True)
class PaintedMesh:
    """Triangles (m, 3, 3) in the frame of a body [m], with their colour; body −1 is the ground.

    Of a closed surface only what faces the eye is drawn.
    """

    body: int
    triangles: np.ndarray
    colour: np.ndarray
    closed: bool


class Painter:
    """Draws one picture after the other.

    Parameters
    ----------
    shown : Shown
        What is drawn.
    width, height : int
        Of the picture [pixels].
    """

    def __init__(self, shown: Shown, width: int, height: int):
        self.motion, self.view = shown.pictures, framing(shown.pictures)
        self.size = size(self.motion.system)
        self.bodies = self.motion.system.structure.bodies
        self.parts = [self._painted_mesh(form) for form in forms(self.motion.system, shown.visuals)]
        self.positions, self.rotations = self.motion.poses()
        self.contacts = touches(shown.motion, self.motion, self.size)
        self.reactions = [self._reaction(joint) for joint in shown.joints]
        self.figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        self.canvas, self.axes = FigureCanvasAgg(self.figure), self.figure.add_axes((0, 0, 1, 1))
        self._eye(width / height)
        self._set_up(shown.traces)

    def picture(self, k: int) -> np.ndarray:
        """Pixels (height, width, 3) of sample k."""
        placed = [(self._placed(part, k), part) for part in self.parts]
        drawn = [self._lit(triangles, part) for triangles, part in placed]
        colours: Any
        triangles, colours = (np.concatenate(pieces) for pieces in zip(*drawn, strict=True))
        flat, depth = self._seen(triangles)
        order = np.argsort(-depth.mean(axis=1))
        self.solid.set_verts(flat[order])
        self.solid.set_facecolor(colours[order])
        self.solid.set_edgecolor(colours[order])  # closes the seams between triangles
        self.shadow.set_verts(self._seen(np.concatenate([self._cast(*pair) for pair in placed]))[0])
        self._press(k)
        self.text.set_text(f"t = {self.motion.t[k]:.2f} s" if len(self.motion) > 1 else "")
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()

    def _painted_mesh(self, form: BodyMesh) -> PaintedMesh:
        mesh = form.mesh if len(form.mesh.faces) <= FINEST else form.mesh.convex_hull
        body = -1 if form.body == GROUND else self.bodies.index(form.body)
        colour = np.array(colour_of(form, self.bodies))
        return PaintedMesh(body, np.asarray(mesh.vertices)[np.asarray(mesh.faces)], colour, mesh.is_watertight)

    def _eye(self, aspect: float):
        """Axes of the eye: right, up, towards what is seen."""
        view = self.view
        ahead = view.middle - view.eye
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, view.up)
        right /= np.linalg.norm(right)
        self.sight = np.stack([right, np.cross(right, ahead), ahead])
        high = np.tan(FIELD / 2)
        self.axes.set(xlim=(-high * aspect, high * aspect), ylim=(-high, high))
        self.axes.axis("off")

    def _seen(self, points: np.ndarray) -> tuple[Any, np.ndarray]:  # matplotlib takes arrays, but does not say so
        """Points (…, 3) in the picture (…, 2), and how far they are [m]."""
        x, y, far = np.moveaxis((points - self.view.eye) @ self.sight.T, -1, 0)
        far = np.maximum(far, 1e-3 * self.view.reach)
        return np.stack([x / far, y / far], axis=-1), far

    def _placed(self, part: PaintedMesh, k: int) -> np.ndarray:
        if part.body < 0:
            return part.triangles
        return part.triangles @ self.rotations[k, part.body].T + self.positions[k, part.body]

    def _room(self) -> np.ndarray:
        return np.stack([self.view.right, self.view.away, self.view.up])

    def _lit(self, triangles: np.ndarray, part: PaintedMesh) -> tuple[np.ndarray, np.ndarray]:
        """Triangles that are seen, and their colours."""
        normals = _normals(triangles)
        facing = np.sign((normals * (self.view.eye - triangles.mean(axis=1))).sum(axis=1))
        seen = facing > 0 if part.closed else np.ones(len(triangles), dtype=bool)
        towards = (facing[:, None] * normals)[seen] @ (LIGHT @ self._room())  # an open surface is seen from both sides
        brightness = SHADE + (1 - SHADE) * np.clip(towards, 0.0, 1.0)
        return triangles[seen], np.clip(GLOSS * brightness[:, None] * part.colour, 0.0, 1.0)

    def _cast(self, triangles: np.ndarray, part: PaintedMesh) -> np.ndarray:
        """Shadows on the floor."""
        view, light = self.view, LIGHT @ self._room()
        if part.closed:
            triangles = triangles[_normals(triangles) @ light > 0]
        height = (triangles - view.floor) @ view.up
        return triangles - (height / (light @ view.up))[..., None] * light

    def _set_up(self, traces):
        sky = np.linspace(0.0, 1.0, 64)[:, None, None]
        limits = (*self.axes.get_xlim(), *self.axes.get_ylim())
        self.axes.imshow(((1 - sky) * TOP + sky * BOTTOM) / 255, extent=limits, aspect="auto", zorder=0)
        view, cell = self.view, _round(self.view.reach / CELLS)
        reach = 2 * CELLS * cell
        steps = np.linspace(-reach, reach, 4 * CELLS + 1)
        ends = [(a, b) for s in steps for a, b in (((s, -reach), (s, reach)), ((-reach, s), (reach, s)))]
        lines = np.array(ends) @ np.stack([view.right, view.away]) + view.floor
        self.axes.add_collection(LineCollection(self._seen(lines)[0], colors=GRID, linewidths=0.7, zorder=1))
        self.shadow = PolyCollection([], facecolor=SHADOW, edgecolor=SHADOW, linewidths=0.3, zorder=2)
        self.solid = PolyCollection([], linewidths=0.3, zorder=4)
        self.axes.add_collection(self.shadow)
        self.axes.add_collection(self.solid)
        for name in traces if len(self.motion) > 1 else ():
            moved = self.motion.body(name)
            body = self.bodies.index(name) if name in self.bodies else self.motion.system.frames[name].body
            path = self._seen(moved.com if name in self.bodies else moved.position)[0]
            self.axes.plot(*path.T, color=COLOURS[body % len(COLOURS)], linewidth=TRACE, alpha=0.8, zorder=3)
        self.arrows = [LineCollection([], colors=colour, linewidths=2.5, zorder=5) for colour in ARROWS]
        for arrows in self.arrows:
            self.axes.add_collection(arrows)
        (self.dots,) = self.axes.plot([], [], "o", color=ARROWS[1], markersize=5, zorder=6)
        self.text = self.axes.text(0.02, 0.03, "", transform=self.axes.transAxes, color=INK, zorder=7)
        self.axes.text(0.02, 0.94, self.motion.system.scene.name, transform=self.axes.transAxes, color=INK, zorder=7)

    def _press(self, k: int):
        """Reactions, points of contact, and forces there."""
        for arrows, places in zip(self.arrows, (self.reactions, self.contacts), strict=True):
            largest = max((float(np.linalg.norm(place.forces, axis=1).max()) for place in places), default=0.0)
            scale = ARROW * self.size / largest if largest else 0.0
            points, forces = (_rows(part, places, k) for part in ("points", "forces"))
            arrows.set_segments(self._seen(np.stack([points, points + scale * forces], axis=1))[0])
        self.dots.set_data(*self._seen(points)[0].T)

    def _reaction(self, joint: str) -> TouchingPoint:
        """Reaction on the child of a joint, at the joint."""
        number = [placed.name for placed in self.motion.system.joints].index(joint)
        points = np.array([at.joints[number].P for at in self.motion.motions])
        return TouchingPoint(points, reactions(self.motion, joint).force, np.ones(len(points), dtype=bool))


def _normals(triangles: np.ndarray) -> np.ndarray:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)


def _round(length: float) -> float:
    """Nearest length of 1, 2 or 5 times a power of ten."""
    steps = np.outer(10.0 ** np.arange(np.floor(np.log10(length)), np.floor(np.log10(length)) + 2), (1, 2, 5)).ravel()
    return float(steps[np.argmin(abs(np.log(steps / length)))])


def _rows(part: str, places: list[TouchingPoint], k: int) -> np.ndarray:
    """Points or forces (n, 3) of the places that are closed in a picture."""
    return np.array([getattr(place, part)[k] for place in places if place.closed[k]]).reshape(-1, 3)
