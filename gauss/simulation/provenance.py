"""Provenance of results: scene, versions, settings and statistics, as attributes of labelled arrays."""

import hashlib
import json
import platform
from collections.abc import Callable
from importlib import import_module

import numpy as np

from gauss.dynamics import Plan
from gauss.errors import FileError, extra
from gauss.scene import Scene
from gauss.scene.toml import toml_text
from gauss.simulation import Trajectory
from gauss.simulation.motion_records import SleepRecord
from gauss.versions import version_of

MADE_BY = ("gauss", "numpy", "scipy", "llvmlite")


def provenance(trajectory: Trajectory) -> dict[str, str | float]:
    """Provenance of a motion as texts and numbers, the types of netCDF attributes."""
    made = {"title": f"motion of {trajectory.system.scene.name}", "scene": trajectory.system.scene.name}
    made |= scene_text(trajectory.system.scene) | made_by() | {"source": trajectory.system.scene.source}
    about = [("setting", trajectory.settings), ("cost", trajectory.stats._asdict())]
    return made | {f"{kind}_{key}": plain(value) for kind, of in about for key, value in of.items() if value is not None}


def made_by() -> dict[str, str]:
    """Versions of the packages that results depend on."""
    versions = {f"version_{name}": version_of(name) or "not installed as a package" for name in MADE_BY}
    return versions | {"version_python": platform.python_version()}


def scene_text(scene: Scene) -> dict[str, str]:
    """Scene as TOML and its SHA-256; empty, with a remark, where it has no file form."""
    return written(lambda: toml_text(scene), "scene")


def written(write: Callable[[], str], what: str) -> dict[str, str]:
    """Text of a scene or network with its SHA-256; empty, with a remark, where it has no file form."""
    try:
        text = write()
    except FileError as error:
        return {f"{what}_toml": "", f"{what}_sha256": "", f"{what}_remark": f"cannot be written as a file: {error}"}
    return {f"{what}_toml": text, f"{what}_sha256": hashlib.sha256(text.encode()).hexdigest()}


def plain(value):
    """Value as a type of netCDF attributes: number, text, array of a tuple, JSON of plans and dicts."""
    if isinstance(value, Plan):
        return value.to_json()
    if isinstance(value, SleepRecord):
        return json.dumps(value._asdict())
    if isinstance(value, tuple):
        return np.array(value, dtype=float)
    if isinstance(value, dict):
        return json.dumps(value, default=lambda each: np.asarray(each).tolist())
    return value if isinstance(value, int | float | str) and not isinstance(value, bool) else str(value)


def library(name: str):
    """Package of the extra ``results``."""
    with extra("results"):
        return import_module(name)
