"""Robots of a folder with their reference states: ``references.json`` beside the files, as its README defines it."""

import json
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

import gauss
from gauss import rotations
from gauss.errors import NotImportedWarning, UnphysicalInertiaWarning
from gauss.system import State, System

WXYZ = [3, 0, 1, 2]  # of a quaternion (x, y, z, w)


@dataclass(frozen=True)
class Instant:
    """A state of a robot with its loads and the reference."""

    state: State  # consistent coordinates and rates
    load: np.ndarray  # (n_v,): generalised forces [N m, N]
    expected: np.ndarray  # (k,): reference accelerations of the joints of the file
    columns: np.ndarray  # (k,): their places among the rates

    def error(self, accelerations) -> float:
        """Largest difference to the reference relative to the largest acceleration."""
        return float(np.abs(accelerations[self.columns] - self.expected).max() / np.abs(self.expected).max())


@dataclass(frozen=True)
class Robot:
    """A robot of the folder."""

    folder: Path  # the folder
    given: dict  # its entry in the references

    @property
    def name(self) -> str:
        """Short name: the path without what all paths have in common."""
        parts = self.given["id"].split("/")
        return "/".join(part for part in parts if part not in ("robot-models", "parallel_chains"))

    def scene(self) -> gauss.Scene:
        """Scene of its file, without mimic joints, with inertias as given."""
        root = "free" if self.given["added_free_flyer"] else "fixed"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotImportedWarning)
            warnings.simplefilter("ignore", UnphysicalInertiaWarning)
            return gauss.load(self.folder / self.given["urdf"], root=root, mimic=False, inertia="as given")

    @cached_property
    def system(self) -> System:
        """System of the scene."""
        return gauss.compile_scene(self.scene())

    def instants(self) -> list[Instant]:
        """States of the references, in the coordinates of gauss."""
        return [self._instant(given) for given in self.given["states"]]

    def _instant(self, given: dict) -> Instant:
        system, load = self.system, np.zeros(self.system.n_v)
        q, v, expected = system.reference.q, np.zeros(system.n_v), np.zeros(system.n_v)
        for name, kind in self.given["joints"].items():
            joint = system.joint(name)
            values = [given[key][name] for key in ("q", "v", "qdd", "tau")]
            if kind == "floating":
                q[joint.q], v[joint.v], expected[joint.v] = _floating(*values[:3])
            elif kind == "spherical":
                q[joint.q] = np.array(values[0]["quaternion_xyzw"])[WXYZ]
                v[joint.v], expected[joint.v] = values[1]["angular"], values[2]["angular"]
            else:
                q[joint.q], v[joint.v], expected[joint.v], load[joint.v] = values
        state, kept = system.state(q, v), list(self.given["joints"])
        if system.has_closures:  # the coordinates of loop joints follow
            state = system.initial_state(q, v, keep=kept)
        columns = np.concatenate([np.arange(j.v.start, j.v.stop) for j in map(system.joint, kept)])
        return Instant(state, load, expected[columns], columns)


def _floating(q: dict, v: dict, qdd: dict) -> tuple[list, list, list]:
    """Coordinates, rates and accelerations of a free joint: positions and velocities along the axes of its parent."""
    Q = np.array(q["quaternion_xyzw"])[WXYZ]
    R, omega = rotations.from_quaternion(Q), np.array(v["angular"])
    linear = np.array(v["linear"])
    acceleration = R @ (np.array(qdd["linear"]) + np.cross(omega, linear))
    return [*q["position"], *Q], [*(R @ linear), *omega], [*acceleration, *qdd["angular"]]


def robots(folder, only: str = "") -> list[Robot]:
    """Robots of a folder whose names hold a text."""
    folder = Path(folder)
    listed = json.loads((folder / "references.json").read_text(encoding="utf-8"))["robots"]
    return [Robot(folder, given) for given in listed if only in given["id"]]
