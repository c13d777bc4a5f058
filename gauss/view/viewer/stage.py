"""The mechanism on the stage of a viser server: meshes, frames, paths, arrows; one call moves it to a sample."""

import numpy as np

from gauss.assembly import kinematics
from gauss.audit import reactions
from gauss.scene import GROUND
from gauss.simulation import Trajectory
from gauss.view.skeleton import placed
from gauss.view.style import COLOURS
from gauss.view.viewer.forms import forms, size

STEEL, CONTACT = (0.32, 0.34, 0.38), (0.85, 0.65, 0.3)  # colours of joints and shapes of contact
ARROW = 0.35  # longest arrow, of the size of the mechanism
VIEW = np.array([0.35, -0.8, 0.4])  # from what is seen to the camera: right, away, up
RED = (200, 30, 30)
CLOSE = 0.95  # distance of the camera over the diagonal of all that is seen


class Stage:
    """Everything that is drawn.

    Parameters
    ----------
    server : viser.ViserServer
        Where it is drawn.
    trajectory : Trajectory
        Equally spaced samples.
    visuals : iterable
        Given meshes.
    joints : iterable of str
        Joints whose reactions are drawn as arrows.
    """

    def __init__(self, server, trajectory: Trajectory, visuals=(), joints=()):
        self.server, self.trajectory = server, trajectory
        self.bodies = trajectory.system.structure.bodies
        self.size = size(trajectory.system)
        self.positions, rotations = trajectory.poses()
        self.turns = _quaternions(rotations)
        self.colours = {name: _rgb(COLOURS[k % len(COLOURS)]) for k, name in enumerate(self.bodies)}
        self.reactions = {joint: reactions(trajectory, joint).force for joint in joints}
        self.largest = max((float(np.linalg.norm(f, axis=1).max()) for f in self.reactions.values()), default=0.0)
        with server.atomic():
            self._surroundings()
            self._bodies(visuals)
            self._paths()
            self.arrows = server.scene.add_arrows("/reactions", **self._arrows(0)) if self.reactions else None
            self.to(0)

    def to(self, k: int):
        """Move everything to sample k."""
        for i, node in enumerate(self.nodes):
            node.position, node.wxyz = self.positions[k, i], self.turns[k, i]
        if self.arrows is not None:
            self.arrows.points = self._arrows(k)["points"]

    def _surroundings(self):
        gravity = np.array(self.trajectory.system.scene.gravity)
        up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
        seen = np.concatenate([points.reshape(-1, 3) for points in placed(self.trajectory).values()])
        low, high = seen.min(axis=0), seen.max(axis=0)
        middle, reach = (low + high) / 2, max(float(np.linalg.norm(high - low)), self.size)
        right, away = _beside(up)
        scene = self.server.scene
        scene.set_up_direction(tuple(up))
        scene.configure_default_lights(enabled=True)
        floor = middle + (((seen - middle) @ up).min() - 0.1 * self.size) * up
        turn = _quaternions(np.stack([right, away, up], axis=1)[None, None])[0, 0]
        cell = 10.0 ** np.floor(np.log10(reach))
        look = {"cell_size": cell / 10, "section_size": cell / 2, "fade_distance": 5 * reach}
        scene.add_grid("/floor", 3 * reach, 3 * reach, plane="xy", wxyz=turn, position=floor, **look)
        camera = self.server.initial_camera
        camera.look_at, camera.up = tuple(middle), tuple(up)
        camera.position = tuple(middle + CLOSE * reach * VIEW @ np.stack([right, away, up]))

    def _bodies(self, visuals):
        scene = self.server.scene
        self.nodes = [scene.add_frame(f"/bodies/{name}", show_axes=False) for name in map(_path, self.bodies)]
        self.parts: dict[str, list] = {"link": [], "joint": [], "contact": [], "frame": [], "path": []}
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

    def _paths(self):
        """Paths of the centres of mass of the bodies that carry no others; of all if there are none."""
        if len(self.trajectory) < 2:
            return
        carrying = {joint.parent for joint in self.trajectory.system.joints}
        tips = [name for i, name in enumerate(self.bodies) if i not in carrying]
        for name in tips or self.bodies:
            points = np.asarray(self.trajectory.body(name).com, np.float32)
            segments = np.stack([points[:-1], points[1:]], axis=1)
            look = {"thickness": 0.006 * self.size}
            handle = self.server.scene.add_line_segments(f"/paths/{_path(name)}", segments, self.colours[name], **look)
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
            "colors": (200, 30, 30),
        } | look


def _beside(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two directions across "up": right and away, such that right × away = up; along world axes as far as it goes."""
    world = np.eye(3)[np.argmin(abs(up))]
    right = world - (world @ up) * up
    right /= np.linalg.norm(right)
    return right, np.cross(up, right)


def _path(name: str) -> str:
    """Name without the slash, which separates the levels of the tree of nodes."""
    return name.replace("/", "∕")


def _rgb(colour: str) -> tuple[float, float, float]:
    return tuple(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))


def _quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), w first, of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*R.shape[:-2], 4)
