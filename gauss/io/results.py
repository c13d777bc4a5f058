"""Results on disk: motions as compressed numpy archives that any numpy can read, tables as CSV, JSON and such archives."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gauss.errors import FileError, writing
from gauss.simulation import Trajectory

BETWEEN = ", "


def write_npz(trajectory: Trajectory, path: Path) -> Path:
    """Write times, coordinates, rates, work, the names of the rates, and the positions of all bodies.

    Arrays: ``t`` (k,) [s], ``q`` (k, n_q), ``v`` (k, n_v), ``work`` (k, 3) [J] of drives, of forces, lost in dampers,
    ``coordinates`` (n_v,) names, ``bodies`` (n,) names, ``positions`` (k, n, 3) [m] of the body frames; of the events of
    one-sided constraints ``event_t`` [s], ``event_kind``, ``event_gaps`` (names, comma between, or JSON where one has a
    comma), ``event_loss`` [J] and ``event_impulses`` (JSON).
    """
    np.savez_compressed(path, **arrays(trajectory))
    return path


def arrays(trajectory: Trajectory) -> dict[str, Any]:
    """Arrays of a motion by name."""
    system = trajectory.system
    return {
        "scene": np.array(system.scene.name),
        "t": trajectory.t,
        "q": trajectory.q,
        "v": trajectory.v,
        "work": trajectory.work,
        "coordinates": np.array(system.coordinates),
        "bodies": np.array(system.structure.bodies),
        "positions": trajectory.poses()[0],
        "event_t": np.array([event.t for event in trajectory.events]),
        "event_kind": np.array([event.kind for event in trajectory.events], dtype=str),
        "event_gaps": np.array([joined(event.gaps) for event in trajectory.events], dtype=str),
        "event_loss": np.array([event.loss for event in trajectory.events]),
        "event_impulses": np.array([json.dumps(event.impulses) for event in trajectory.events], dtype=str),
    }


def write_csv(columns: dict[str, np.ndarray], path: Path) -> Path:
    """Write a table, one column for each name, in all digits.

    Raises
    ------
    FileError
        If the ending is not .csv, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise FileError(f"{path}: a table is written as .csv.")
    with writing(path), open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True))
    return path


def write_json(columns: dict[str, np.ndarray], path: Path) -> Path:
    """Write a table as one JSON object: a list for each column, null for what is not finite."""
    lists = {
        name: [
            None if isinstance(value, float) and not np.isfinite(value) else value for value in np.asarray(column).tolist()
        ]
        for name, column in columns.items()
    }
    path.write_text(json.dumps(lists, ensure_ascii=False, allow_nan=False), encoding="utf-8")
    return path


def write_arrays(columns: dict[str, np.ndarray], path: Path) -> Path:
    """Write a table as a compressed archive of numpy, an array for each column."""
    named: dict[str, Any] = {name: np.asarray(column) for name, column in columns.items()}
    with open(path, "wb") as file:
        np.savez_compressed(file, **named)
    return path


def joined(names: Sequence[str]) -> str:
    """One text of several names, which :func:`separated` takes apart again."""
    plain = not any(BETWEEN in name or name.startswith("[") for name in names)
    return BETWEEN.join(names) if plain else json.dumps(list(names), ensure_ascii=False)


def separated(text: str) -> tuple[str, ...]:
    """Names of a text."""
    return tuple(json.loads(text) if text.startswith("[") else text.split(BETWEEN) if text else ())
