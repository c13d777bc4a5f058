"""Scenes by name: shipped models, families of models."""

import importlib.util
import inspect
from itertools import takewhile
from pathlib import Path

from gauss.errors import FileError


def folder() -> Path:
    """Folder of the shipped models: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).parent.parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def shipped() -> dict[str, Path]:
    """Scene files by name."""
    return {path.stem: path for path in sorted(folder().glob("*.toml"))}


def servo_files() -> dict[str, Path]:
    """Files of scenes with servos by name, e.g. "servo/crane"."""
    return {f"servo/{path.stem}": path for path in sorted((folder() / "servo").glob("*.toml"))}


def servos() -> dict[str, str]:
    """One line about every shipped scene with servos."""
    return {name: _first_comment(path) for name, path in servo_files().items()}


def linkage_files() -> dict[str, Path]:
    """Files of planar linkages by name."""
    return {path.stem: path for path in sorted((folder() / "linkages").glob("*.toml"))}


def linkages() -> dict[str, str]:
    """One line about every shipped linkage."""
    return {name: _first_comment(path) for name, path in linkage_files().items()}


def network_files() -> dict[str, Path]:
    """Files of rotor networks by name."""
    return {path.stem: path for path in sorted((folder() / "rotors").glob("*.toml"))}


def networks() -> dict[str, str]:
    """One line about every shipped rotor network."""
    return {name: _first_comment(path) for name, path in network_files().items()}


def families() -> dict:
    """Functions that make scenes of any size, by name."""
    spec = importlib.util.spec_from_file_location("gauss_model_families", folder() / "families.py")
    if spec is None or spec.loader is None:
        raise FileError(f"{folder()}: families.py cannot be imported.")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return {name: getattr(module, name) for name in module.__all__}


def catalog() -> dict[str, str]:
    """One line about every shipped model and family.

    Returns
    -------
    dict
        What each is, by name.
    """
    lines = {name: _first_comment(path) for name, path in shipped().items()}
    for name, family in families().items():
        arguments = ", ".join(inspect.signature(family).parameters)
        lines[name] = (inspect.getdoc(family) or "").partition("\n")[0] + (f" (family: {arguments})" if arguments else "")
    return lines


def _first_comment(path: Path) -> str:
    """First sentence of the comment that a file begins with."""
    lines = takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    sentence, end, _ = " ".join(line.removeprefix("#").strip() for line in lines).partition(". ")
    return sentence + end.strip()
