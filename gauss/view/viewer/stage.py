"""The mechanism on the stage of a viser server: meshes, frames, paths, arrows; one call moves it to a sample."""

import numpy as np

from gauss.analysis import reactions
from gauss.dynamics.kinematics import kinematics
from gauss.scene import GROUND
from gauss.view.style import COLOURS
from gauss.view.viewer.forms import forms, size
from gauss.view.viewer.framing import FIELD, framing
from gauss.view.viewer.shown import Shown
from gauss.view.viewer.touches import touches

STEEL, CONTACT = (0.32, 0.34, 0.38), (0.85, 0.65, 0.3)  # colours of joints and shapes of contact
ARROW = 0.35  # longest arrow, of the size of the mechanism
RED, ORANGE = (200, 30, 30), (235, 120, 20)  # arrows of reactions and of contact forces
ASIDE = 0.2  # of the reach of the motion: half the width of the controls
FAINT = 1e-3  # of the largest contact force: smaller ones are not drawn
POINT = 0.016  # radius of a contact point, of the size of the mechanism
TOP, BOTTOM = np.array([214, 224, 236]), np.array([250, 250, 251])  # colours of the background
LINES_OF_THE_FLOOR = {"cell_color": (218, 222, 228), "section_color": (190, 197, 207)}
ROLES = ("link", "joint", "contact", "frame", "path")


class ViewerStage:
    """Everything that is drawn.

    Parameters
    ----------
    server : viser.ViserServer
        Where it is drawn.
    shown : Shown
        What is drawn.
    """

    def __init__(self, server, shown: Shown):
        self.server, self.trajectory = server, shown.pictures
        trajectory, self.framing = self.trajectory, framing(self.trajectory)
        self.bodies = trajectory.system.structure.bodies
        self.size = size(trajectory.system)
        self.positions, rotations = trajectory.poses()
        self.turns = _quaternions(rotations)
        self.colours = {name: rgb(COLOURS[k % len(COLOURS)]) for k, name in enumerate(self.bodies)}
        self.reactions = {joint: reactions(trajectory, joint).force for joint in shown.joints}
        self.largest = max((float(np.linalg.norm(f, axis=1).max()) for f in self.reactions.values()), default=0.0)
        with server.atomic():
            self._surroundings()
            self._bodies(shown.visuals)
            self._paths(shown.traces)
            self.arrows = server.scene.add_arrows("/reactions", **self._arrows(0)) if self.reactions else None
            self.contacts = ContactMarks(server, touches(shown.motion, self.trajectory, self.size), self.size)
            self.to(0)

    def to(self, k: int):
        """Move everything to sample k."""
        for i, node in enumerate(self.nodes):
            node.position, node.wxyz = self.positions[k, i], self.turns[k, i]
        if self.arrows is not None:
            self.arrows.points = self._arrows(k)["points"]
        self.contacts.to(k)

    def make_room(self):
        """Look a little to the right of the middle, where controls cover the picture."""
        view, camera = self.framing, self.server.initial_camera
        ahead = view.middle - view.eye
        right = np.cross(ahead, view.up)
        aside = ASIDE * view.reach * right / np.linalg.norm(right)
        camera.look_at, camera.position = tuple(view.middle + aside), tuple(view.eye + aside)

    def _surroundings(self):
        view, scene = self.framing, self.server.scene
        scene.set_up_direction(tuple(view.up))
        scene.configure_default_lights(enabled=True)
        scene.set_background_image(_sky(), format="png")
        turn = _quaternions(np.stack([view.right, view.away, view.up], axis=1)[None, None])[0, 0]
        cell = 10.0 ** np.round(np.log10(view.reach / 10))
        look = {"cell_size": cell, "section_size": 5 * cell, "fade_distance": 6 * view.reach, "shadow_opacity": 0.22}
        scene.add_grid(
            "/floor", plane="xy", infinite_grid=True, wxyz=turn, position=view.floor, **look, **LINES_OF_THE_FLOOR
        )
        camera = self.server.initial_camera
        camera.look_at, camera.up, camera.position = tuple(view.middle), tuple(view.up), tuple(view.eye)
        camera.fov, camera.near, camera.far = FIELD, 0.01 * view.reach, 100 * view.reach

    def _bodies(self, visuals):
        scene = self.server.scene
        self.nodes = [scene.add_frame(f"/bodies/{name}", show_axes=False) for name in map(_path, self.bodies)]
        self.parts: dict[str, list] = {role: [] for role in ROLES}
        for number, form in enumerate(forms(self.trajectory.system, visuals)):
            parent = "/ground" if form.body == GROUND else f"/bodies/{_path(form.body)}"
            role = {"joint": STEEL, "contact": CONTACT}.get(form.role)
            colour = form.colour or role or self.colours.get(form.body, STEEL)
            faces, vertices = np.asarray(form.mesh.faces, np.uint32), np.asarray(form.mesh.vertices, np.float32)
            handle = scene.add_mesh_simple(f"{parent}/{form.role} {number}", vertices, faces, color=colour, side="double")
            self.parts[form.role].append(handle)
        look = {"axes_length": 0.12 * self.size, "axes_radius": 0.006 * self.size, "visible": False}
        for name, frame in self.trajectory.system.frames.items():
            if frame.body < 0 or name == GROUND:
                continue
            own = self.trajectory.system.frames[self.bodies[frame.body]]
            turn = _quaternions((own.R.T @ frame.R)[None, None])[0, 0]
            place = {"wxyz": turn, "position": own.R.T @ (frame.p - own.p)}
            node = f"/bodies/{_path(self.bodies[frame.body])}/frame {_path(name)}"
            self.parts["frame"].append(scene.add_frame(node, **place, **look))

    def _paths(self, traces):
        """Paths of centres of mass, and of origins of frames."""
        if len(self.trajectory) < 2:
            return
        for name in traces:
            moved = self.trajectory.body(name)
            carrier = name if name in self.bodies else self.bodies[self.trajectory.system.frames[name].body]
            points = np.asarray(moved.com if name in self.bodies else moved.position, np.float32)
            segments = np.stack([points[:-1], points[1:]], axis=1)
            look = {"thickness": 0.006 * self.size}
            handle = self.server.scene.add_line_segments(f"/paths/{_path(name)}", segments, self.colours[carrier], **look)
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
    places : list of TouchingPoint
        The places.
    size : float
        Size of the mechanism [m].
    """

    def __init__(self, server, places: list, size: float):
        self.places, self.visible = places, True
        self.largest = max((float(np.linalg.norm(place.forces, axis=1).max()) for place in places), default=0.0)
        self.scale = ARROW * size / self.largest if self.largest else 0.0
        look = {"shaft_radius": 0.008 * size, "head_radius": 0.02 * size, "head_length": 0.05 * size, "colors": ORANGE}
        self.handles = []
        for number, place in enumerate(places):
            ball = server.scene.add_icosphere(f"/contacts/point {number}", radius=POINT * size, color=ORANGE)
            arrow = server.scene.add_arrows(f"/contacts/force {number}", self._points(place, 0), **look)
            self.handles.append((ball, arrow))

    def to(self, k: int):
        """Show what touches in sample k."""
        for (ball, arrow), place in zip(self.handles, self.places, strict=True):
            ball.visible = bool(self.visible and place.closed[k])
            arrow.visible = bool(ball.visible and np.linalg.norm(place.forces[k]) > FAINT * self.largest)
            ball.position = place.points[k]
            if arrow.visible:
                arrow.points = self._points(place, k)

    def _points(self, place, k: int) -> np.ndarray:
        return np.stack([place.points[k], place.points[k] + self.scale * place.forces[k]])[None].astype(np.float32)


def _sky() -> np.ndarray:
    """Background from top to bottom, (height, 1, 3)."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    return np.broadcast_to((1 - share) * TOP + share * BOTTOM, (256, 8, 3)).astype(np.uint8)


def _path(name: str) -> str:
    """Name without the slash, which separates the levels of the tree of nodes."""
    return name.replace("/", "∕")


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, from 0 to 1, of a colour such as "#0072B2"."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), w first, of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*R.shape[:-2], 4)
