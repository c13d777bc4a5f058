"""Servos in files. In scene files: constraints that servos hold, and their actuators, in tables below ``servo``.

A constraint in ``[[guided]]`` is kept by a contact; the same table as ``[[servo.guided]]`` is held by the actuators.
"""

from pathlib import Path
from typing import Any

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import SceneError, did_you_mean
from gauss.io.results import arrays
from gauss.scene import Relation
from gauss.scene.toml import SECTIONS, elements, from_tables
from gauss.servo import AuxiliarySupport, Cable, Motor, Servo, Thruster, Tracking

RELATIONS = {section: kind for section, kind in SECTIONS.items() if issubclass(kind, Relation)}
ACTUATORS = {"motor": Motor, "thruster": Thruster, "cable": Cable, "support": AuxiliarySupport}
TABLES = ("weights", "preload")


def servo_from_tables(data: dict) -> Servo:
    """Servo of the tables of a file, with the scene that it is about.

    SceneError if a section or key is unknown, or says something impossible.
    """
    data = dict(data)
    given = data.pop("servo")
    everything = [*RELATIONS, *ACTUATORS, *TABLES]
    if not isinstance(given, dict):
        raise SceneError("section 'servo': write tables below it, e.g. [[servo.motor]].")
    for key in given:
        if key not in everything:
            raise SceneError(f"section 'servo': unknown table {key!r}. {did_you_mean(key, everything)}")
    for key in TABLES:
        if not isinstance(given.get(key, {}), dict):
            raise SceneError(f"section 'servo': write [servo.{key}] with single brackets, once.")
    relations, actuators = (tuple(elements(given, kinds)) for kinds in (RELATIONS, ACTUATORS))
    return Servo(compile_scene(from_tables(data)), relations, actuators, *(given.get(key, {}) for key in TABLES))


def write_tracking(tracking: Tracking, path: Path) -> Path:
    """Write a motion under servos: everything of its motion, and what the servos did.

    Besides the arrays of :func:`gauss.io.results.write_npz`: ``efforts`` (k, j) [N, N m], ``effort_names`` (j,),
    ``effort_work`` (k, j) [J], ``gaps`` (k, r), ``relation_names`` (r,), ``smallest`` (k,) singular values.
    """
    servo = tracking.servo
    found: dict[str, Any] = arrays(tracking.motion) | {
        "efforts": tracking.efforts,
        "effort_names": np.array(servo.efforts),
        "effort_work": tracking.work,
        "gaps": tracking.residuals,
        "relation_names": np.array(servo.held),
        "smallest": tracking.smallest,
    }
    np.savez_compressed(path, **found)
    return path
