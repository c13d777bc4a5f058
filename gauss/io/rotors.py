"""Rotor networks in TOML: shafts, links and torques, one key per field of their classes. Nothing is executed."""

import json
from pathlib import Path
from typing import Any

from gauss.errors import FileError, SceneError, writing
from gauss.io.catalog import network_files
from gauss.rotors import (
    FrictionClutch,
    FrictionDrive,
    GearPair,
    Hyperbola,
    Measured,
    Network,
    OneWayClutch,
    Shaft,
    Torque,
    TorqueLimiter,
    TorsionSpring,
    law_of,
)
from gauss.rotors.interpolant import Interpolant
from gauss.rotors.laws import LAWS
from gauss.scene.toml import check_sections, elements, entries_of, read_file

SECTIONS: dict[str, type] = {
    "shaft": Shaft,
    "gear": GearPair,
    "friction_drive": FrictionDrive,
    "spring": TorsionSpring,
    "clutch": FrictionClutch,
    "torque_limiter": TorqueLimiter,
    "one_way": OneWayClutch,
}
HEAD = ("name",)
OF_TORQUE = {"name": "name", "shaft": "shaft", "from": "begin", "until": "until", "role": "role"}  # key → field


def load_rotors(source) -> Network:
    """Rotor network of a file, or a shipped one by name.

    Parameters
    ----------
    source : str or Path
        Path of a .toml file, or the name of a shipped network such as "gear_runup" (`gauss models` lists them).

    Returns
    -------
    Network
        The network.

    Raises
    ------
    FileError
        If there is no such thing, or it says something that a network cannot be; the message names file and place.
    """
    return read_file(source, network_files(), "rotor network", from_tables)


def from_tables(data: dict) -> Network:
    """Network of the tables of a file."""
    check_sections(data, [*HEAD, *SECTIONS, "torque"])
    network = Network(**{key: data[key] for key in HEAD if key in data})
    for made in elements(data, SECTIONS):
        network.add(made)
    for number, entry in enumerate(entries_of(data, "torque"), start=1):
        network.add(_torque(network, entry, number))
    return network


def _torque(network: Network, entry: dict, number: int) -> Torque:
    """Torque of a table: what is not the torque's own is a value of its law."""
    what = f"[[torque]] {entry.get('name', f'number {number}')!r}"
    for key in ("shaft", "law"):
        if not isinstance(entry.get(key), str):
            raise SceneError(f"{what}: missing {key}.")
    given = {OF_TORQUE[key]: value for key, value in entry.items() if key in OF_TORQUE}
    values = {key: value for key, value in entry.items() if key not in OF_TORQUE and key != "law"}
    law = law_of(entry["law"], {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}, what)
    return Torque(**{"name": network.fresh(f"torque on {entry['shaft']}")} | given, law=law)


def save_rotors(network: Network, path) -> Path:
    """Write a network; reading it back gives an equal one.

    Parameters
    ----------
    network : Network
        The network.
    path : str or Path
        The file, .toml.

    Returns
    -------
    Path
        Where it went.

    Raises
    ------
    FileError
        If a law or curve is a Python function, which no file can hold, or the file cannot be written.
    """
    path, text = Path(path), toml_text(network)
    if path.suffix.lower() != ".toml":
        raise FileError(f"{path}: a rotor network is written as .toml.")
    with writing(path):
        path.write_text(text, encoding="utf-8")
    return path


def toml_text(network: Network) -> str:
    """Network as TOML; FileError if a law or curve is a Python function, which no file can hold."""
    lines = [_line("name", network.name)]
    things: list[Any] = [*network.shafts.values(), *network.links.values()]
    for thing in things:
        section = next(name for name, kind in SECTIONS.items() if type(thing) is kind)
        lines += ["", f"[[{section}]]", *(_line(key, value) for key, value in _entries(thing, thing.name))]
    for torque in network.torques.values():
        lines += ["", "[[torque]]", *_torque_lines(torque)]
    return "\n".join(lines) + "\n"


def _torque_lines(torque: Torque) -> list[str]:
    laws, keys = {kind: name for name, kind in LAWS.items()}, {field: key for key, field in OF_TORQUE.items()}
    if type(torque.law) not in laws:
        raise FileError(f"torque {torque.name!r}: its law is a Python function, which a file cannot hold.")
    said = {keys[key]: value for key, value in _entries(torque, torque.name) if key in keys}
    if said.get("role") == torque.law.role:
        del said["role"]
    of_law = [_line(key, value) for key, value in _entries(torque.law, torque.name)]
    return [*(_line(key, value) for key, value in said.items()), _line("law", laws[type(torque.law)]), *of_law]


def _entries(thing, name: str):
    """Keys and values of an element that differ from their defaults."""
    for key, field in type(thing).__dataclass_fields__.items():
        value = getattr(thing, key)
        if isinstance(value, Hyperbola):
            value = [value.A, value.B, value.C]
        elif isinstance(value, Measured):
            value = {"slip": value.slip, "torque": value.torque}
        elif isinstance(value, Interpolant):
            value = {"time": value.x, "torque": value.y}
        elif callable(value) and key == "curve":
            raise FileError(f"{name!r}: its curve is a Python function, which a file cannot hold.")
        if value is not None and value != field.default:
            yield key, value


def _line(key: str, value) -> str:
    if isinstance(value, dict):
        return f"{key} = {{ {', '.join(_line(k, v) for k, v in value.items())} }}"
    return f"{key} = {json.dumps(value, ensure_ascii=False)}".replace("\x7f", "\\u007f")
