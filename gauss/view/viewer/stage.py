"""The mechanism on the stage of a viser server: meshes, frames, paths, arrows; one call moves it to a sample."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gauss.analysis import reactions
from gauss.dynamics.kinematics import kinematics
from gauss.scene import GROUND
from gauss.view.style import COLOURS
from gauss.view.viewer.forms import BodyMesh, forms, size
from gauss.view.viewer.framing import FIELD, SIDE_SHARE, framing, joined, shifted
from gauss.view.viewer.shown import Shown, resampled
from gauss.view.viewer.touches import touches

STEEL = (0.32, 0.34, 0.38)  # colour of joints
TINT = 0.35  # of white in the colours of shapes of contact: links are seen against those of their body
LAND = (0.6, 0.66, 0.58)  # colour of shapes of contact on the ground
ARROW = 0.35  # longest arrow, of the size of the mechanism
RED, ORANGE = (200, 30, 30), (235, 120, 20)  # arrows of reactions and of contact forces
FAINT = 1e-3  # of the largest contact force: smaller ones are not drawn
POINT = 0.016  # radius of a contact point, of the size of the mechanism
SKY_LIGHT, GROUND_LIGHT, DIFFUSE = (255, 255, 255), (170, 175, 185), 3.2  # of the light that casts no shadows
SMOOTHNESS, FINEST_PATH = 6, 6000  # points of a path for each picture, and most of them
ROLES = ("link", "joint", "contact", "frame", "path")


def colour_of(form: BodyMesh, bodies: Sequence[str]) -> tuple[float, float, float]:
    """Colour of a mesh: its own, that of joints or of the ground, or that of its body; shapes of contact are lighter."""
    if form.colour or form.role == "joint":
        return form.colour or STEEL
    if form.body == GROUND:
        return LAND if form.role == "contact" else STEEL
    red, green, blue = body_colour(bodies.index(form.body))
    white = TINT if form.role == "contact" else 0.0
    return red + white * (1 - red), green + white * (1 - green), blue + white * (1 - blue)


def body_colour(number: int) -> tuple[float, float, float]:
    """Colour of a body by its number, red, green and blue from 0 to 1."""
    red, green, blue = (int(COLOURS[number % len(COLOURS)][k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


class ViewerStage:
    """Everything that is drawn.

    Parameters
    ----------
    shown : Shown
        What is drawn.
    dark : bool
        Whether the ground is dark.
    beside : ViewerStage, optional
        Stage of another motion, to the right of which this one stands.
    """

    def __init__(self, server, shown: Shown, dark: bool = False, beside: "ViewerStage | None" = None):
        self.server, self.trajectory, self.ground = server, shown.pictures, ground(dark)
        trajectory, self.framing = self.trajectory, framing(self.trajectory)
        self.bodies = trajectory.system.structure.bodies
        self.size = size(trajectory.system)
        self.positions, rotations = trajectory.poses()
        self.turns = _quaternions(rotations)
        self.reactions = {joint: reactions(trajectory, joint).force for joint in shown.joints}
        self.largest = max((float(np.linalg.norm(f, axis=1).max()) for f in self.reactions.values()), default=0.0)
        self.root = "" if beside is None else "/beside"
        with server.atomic():
            if beside is None:
                self._surroundings()
            else:
                server.scene.add_frame(self.root, show_axes=False, position=beside.place_beside(self))
            self._bodies(shown.visuals)
            self._paths(shown)
            self.arrows = server.scene.add_arrows(f"{self.root}/reactions", **self._arrows(0)) if self.reactions else None
            self.contacts = ContactMarks(server, touches(shown.motion, self.trajectory, self.size), self.size, self.root)
            self.to(0)

    def to(self, k: int):
        """Move everything to sample k."""
        for i, node in enumerate(self.nodes):
            node.position, node.wxyz = self.positions[k, i], self.turns[k, i]
        if self.arrows is not None:
            self.arrows.points = self._arrows(k)["points"]
        self.contacts.to(k)

    def at(self, t: float):
        """Move everything to the picture nearest to a time [s]."""
        self.to(int(abs(self.trajectory.t - t).argmin()))

    def place(self, state):
        """Move the bodies to a state."""
        motion = kinematics(self.trajectory.system, state)
        turns = _quaternions(np.array([motion.rotation(name) for name in self.bodies]).reshape(-1, 3, 3))
        for node, name, turn in zip(self.nodes, self.bodies, turns, strict=True):
            node.position, node.wxyz = motion.position(name), turn

    def stand_on(self, dark: bool):
        """Change to the light or the dark ground."""
        self.ground = ground(dark)
        with self.server.atomic():
            self.server.gui.configure_theme(dark_mode=dark, show_share_button=False)
            self.server.scene.set_background_image(sky(self.ground), format="png")
            self.floor.cell_color, self.floor.section_color = self.ground.cell, self.ground.section
            self.floor.shadow_opacity = self.ground.shadow

    def place_beside(self, other: "ViewerStage") -> np.ndarray:
        """Displacement (3,) of another stage that puts its motion to the right of this one, on the same floor [m]."""
        one, view = self.framing, other.framing
        apart = (one.reach + view.reach) / 2 * one.right
        return one.middle + apart - view.middle + ((one.floor - view.floor - one.middle + view.middle) @ one.up) * one.up

    def make_room(self, beside: "ViewerStage | None", aside: float = SIDE_SHARE):
        """Look at both stages, and a little to the right of the middle, where controls cover the picture."""
        if beside is not None:
            self.framing = joined(self.framing, beside.framing, self.place_beside(beside))
        view, camera = self.framing, self.server.initial_camera
        place, aim = shifted(view, view.eye, view.middle, aside)
        camera.look_at, camera.position = tuple(aim), tuple(place)

    def _surroundings(self):
        view, scene = self.framing, self.server.scene
        scene.set_up_direction(tuple(view.up))
        scene.configure_default_lights(enabled=True)
        scene.configure_environment_map(None)  # its picture would be decoded and filtered before the first one is drawn
        scene.add_light_hemisphere("/light of the sky", sky_color=SKY_LIGHT, ground_color=GROUND_LIGHT, intensity=DIFFUSE)
        self.server.gui.configure_theme(dark_mode=self.ground.dark, show_share_button=False)
        scene.set_background_image(sky(self.ground), format="png")
        turn = _quaternions(np.stack([view.right, view.away, view.up], axis=1)[None, None])[0, 0]
        cell = 10.0 ** np.round(np.log10(view.reach / 10))
        look = {"cell_size": cell, "section_size": 5 * cell, "fade_distance": 6 * view.reach}
        look |= {"shadow_opacity": self.ground.shadow, "cell_color": self.ground.cell}
        look |= {"section_color": self.ground.section}
        self.floor = scene.add_grid("/floor", plane="xy", infinite_grid=True, wxyz=turn, position=view.floor, **look)
        camera = self.server.initial_camera
        camera.look_at, camera.up, camera.position = tuple(view.middle), tuple(view.up), tuple(view.eye)
        camera.fov, camera.near, camera.far = FIELD, 0.01 * view.reach, 100 * view.reach

    def _bodies(self, visuals):
        scene = self.server.scene
        bodies = f"{self.root}/bodies"
        self.nodes = [scene.add_frame(f"{bodies}/{name}", show_axes=False) for name in map(_path, self.bodies)]
        self.solids: list[tuple[str, Any]] = []  # meshes of bodies, which a pointer can drag
        self.parts: dict[str, list] = {role: [] for role in ROLES}
        for number, form in enumerate(forms(self.trajectory.system, visuals)):
            parent = f"{self.root}/ground" if form.body == GROUND else f"{bodies}/{_path(form.body)}"
            colour = colour_of(form, self.bodies)
            faces, vertices = np.asarray(form.mesh.faces, np.uint32), np.asarray(form.mesh.vertices, np.float32)
            handle = scene.add_mesh_simple(f"{parent}/{form.role} {number}", vertices, faces, color=colour, side="double")
            self.parts[form.role].append(handle)
            self.solids += [(form.body, handle)] if form.body != GROUND else []
        look = {"axes_length": 0.12 * self.size, "axes_radius": 0.006 * self.size, "visible": False}
        for name, frame in self.trajectory.system.frames.items():
            if frame.body < 0 or name == GROUND:
                continue
            own = self.trajectory.system.frames[self.bodies[frame.body]]
            turn = _quaternions((own.R.T @ frame.R)[None, None])[0, 0]
            place = {"wxyz": turn, "position": own.R.T @ (frame.p - own.p)}
            node = f"{bodies}/{_path(self.bodies[frame.body])}/frame {_path(name)}"
            self.parts["frame"].append(scene.add_frame(node, **place, **look))

    def _paths(self, shown: Shown):
        """Paths of centres of mass, and of origins of frames, smoother than the pictures."""
        if len(self.trajectory) < 2 or not shown.traces:
            return
        fine = resampled(shown.motion, min(FINEST_PATH, SMOOTHNESS * len(self.trajectory)))
        poses, frames = fine.poses(), self.trajectory.system.frames  # of all bodies by one function
        for name in shown.traces:
            body = frames[name].body
            own = frames[self.bodies[body]]
            arm = own.R.T @ ((0.0 if name in self.bodies else frames[name].p) - own.p)
            points = np.asarray(poses[0][:, body] + poses[1][:, body] @ arm, np.float32)
            segments = np.stack([points[:-1], points[1:]], axis=1)
            look = {"thickness": 0.006 * self.size}
            handle = self.server.scene.add_line_segments(
                f"{self.root}/paths/{_path(name)}", segments, body_colour(body), **look
            )
            self.parts["path"].append(handle)

    def _arrows(self, k: int) -> dict:
        motion = kinematics(self.trajectory.system, self.trajectory.state(k))
        names = [joint.name for joint in self.trajectory.system.joints]
        roots = np.array([motion.joints[names.index(joint)].P for joint in self.reactions], dtype=np.float32)
        scale = ARROW * self.size / self.largest if self.largest else 0.0
        forces = np.array([force[k] for force in self.reactions.values()])
        look = {"shaft_radius": 0.008 * self.size, "head_radius": 0.02 * self.size, "head_length": 0.05 * self.size}
        return {
            "points": np.stack([roots, roots + scale * forces], axis=1).astype(np.float32),
            "colors": RED,
        } | look


class ContactMarks:
    """Points where bodies touch, and arrows of the forces there.

    Parameters
    ----------
    server : viser.ViserServer
        Where they are drawn.
    size : float
        Size of the mechanism [m].
    root : str
        Node of the stage.
    """

    def __init__(self, server, places: list, size: float, root: str = ""):
        self.places, self.visible = places, True
        self.largest = max((float(np.linalg.norm(place.forces, axis=1).max()) for place in places), default=0.0)
        self.scale = ARROW * size / self.largest if self.largest else 0.0
        look = {"shaft_radius": 0.008 * size, "head_radius": 0.02 * size, "head_length": 0.05 * size, "colors": ORANGE}
        self.handles, self.node = [], f"{root}/contacts"
        if places:
            server.scene.add_frame(self.node, show_axes=False)
        for number, place in enumerate(places):
            ball = server.scene.add_icosphere(f"{root}/contacts/point {number}", radius=POINT * size, color=ORANGE)
            arrow = server.scene.add_arrows(f"{root}/contacts/force {number}", self._points(place, 0), **look)
            self.handles.append((ball, arrow))

    def to(self, k: int):
        """Show what touches in sample k."""
        for (ball, arrow), place in zip(self.handles, self.places, strict=True):
            ball.visible = bool(self.visible and place.closed[k])
            arrow.visible = bool(ball.visible and np.linalg.norm(place.forces[k]) > FAINT * self.largest)
            if ball.visible:
                ball.position = place.points[k]
            if arrow.visible:
                arrow.points = self._points(place, k)

    def _points(self, place, k: int) -> np.ndarray:
        return np.stack([place.points[k], place.points[k] + self.scale * place.forces[k]])[None].astype(np.float32)


def _path(name: str) -> str:
    """Name without the slash, which separates the levels of the tree of nodes."""
    return name.replace("/", "∕")


def _quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), w first, of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*R.shape[:-2], 4)


class Ground(NamedTuple):
    """Colours behind and under a mechanism."""

    top: tuple[int, int, int]  # top, bottom: red, green, blue of the sky from 0 to 255, at its top and its bottom
    bottom: tuple[int, int, int]
    cell: tuple[int, int, int]  # cell, section: lines of the floor
    section: tuple[int, int, int]
    shadow: float  # opacity of shadows on the floor
    dark: bool  # whether controls are light on dark


LIGHT = Ground((168, 184, 204), (222, 227, 233), (198, 205, 214), (164, 174, 188), 0.3, False)  # white bodies are brighter
DARK = Ground((16, 20, 27), (44, 50, 60), (66, 73, 84), (94, 103, 117), 0.5, True)


def ground(dark: bool) -> Ground:
    """Light or dark ground."""
    return DARK if dark else LIGHT


def sky(colours: Ground) -> np.ndarray:
    """Background from top to bottom, shape (256, 8, 3)."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    shades = (1 - share) * np.array(colours.top) + share * np.array(colours.bottom)
    return np.broadcast_to(shades, (256, 8, 3)).astype(np.uint8)
