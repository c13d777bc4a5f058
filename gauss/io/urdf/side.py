"""Elements beyond URDF, in a file beside it: robot.loops.toml beside robot.urdf, in tables of the scene format.

Loop closures are joints, mimic joints are couplings; loads, contacts, starts and gravity may stand there, too.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gauss.errors import FileError, SceneError
from gauss.scene import Force, Frame, Joint, Scene, Spring
from gauss.scene.toml import HEADER_KEYS, SECTIONS, check_sections, elements, tables
from gauss.scene.values import rotation_matrix

ENDING = ".loops.toml"
ENDS = (("body", "at"), ("other", "other_at"))


def side_file(path: Path) -> Path:
    """File beside a URDF file."""
    return Path(path).with_suffix(ENDING)


def with_side(scene: Scene, path: Path) -> Scene:
    """Scene of a URDF file with what the file beside it adds, if there is one.

    Links may be named that fixed joints weld to others.

    FileError if a table of it is not understood; the message names the file and the table.
    """
    beside = side_file(path)
    if not beside.is_file():
        return scene
    data = tables(beside)
    try:
        check_sections(data, [*HEADER_KEYS, *SECTIONS])
        scene = replace(scene, **{key: data[key] for key in HEADER_KEYS if key in data})
        for element in elements(data, SECTIONS):
            scene.add(_on_bodies(element, scene))
    except SceneError as error:
        raise FileError(f"{beside}: {error}") from error
    return scene


def _on_bodies(element, scene: Scene):
    """Element that names bodies where it named links that are welded to them."""
    if isinstance(element, Joint):
        ends: dict[str, Any] = {end: _carrier(scene, getattr(element, end))[0] for end in ("parent", "child")}
        frame = scene.frames.get(element.frame)
        if frame is None:
            return replace(element, **ends)
        R, p = rotation_matrix(frame.rotation), np.array(frame.position)
        turned: dict[str, Any] = {
            "at": p + R @ element.at,
            "axis": R @ element.axis,
            "rotation": R @ rotation_matrix(element.rotation),
        }
        if element.second_axis is not None:
            turned["second_axis"] = R @ element.second_axis
        if element.kind not in ("ball", "free", "fixed"):
            del turned["rotation"]
        plain = {key: _plain(value) for key, value in turned.items()}
        return replace(element, **(ends | plain), frame=frame.body)
    if isinstance(element, Spring | Force):
        moved: dict[str, Any] = {}
        for end, at in ENDS[: 2 if isinstance(element, Spring) else 1]:
            moved[end], frame = _carrier(scene, getattr(element, end))
            if frame is not None and getattr(element, at) is not None:
                place = np.array(frame.position) + rotation_matrix(frame.rotation) @ getattr(element, at)
                moved[at] = _plain(place)
        return replace(element, **moved)
    return element


def _carrier(scene: Scene, name: str) -> tuple[str, Frame | None]:
    frame = scene.frames.get(name)
    return (name, None) if frame is None else (frame.body, frame)


def _plain(value) -> tuple:
    return tuple(map(tuple, value.tolist())) if value.ndim == 2 else tuple(value.tolist())
