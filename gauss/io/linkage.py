"""Linkage files in TOML: links, joints, drive, motor and loads, one key per field of their classes. Nothing is executed."""

from pathlib import Path

from gauss.errors import FileError, SceneError, known
from gauss.io.catalog import linkage_files
from gauss.io.toml import element, entries_of, tables
from gauss.linkages import Driver, Link, Linkage, LinkJoint, Load, Motor

SECTIONS = {"link": Link, "joint": LinkJoint, "load": Load}
SINGLE = {"crank": Driver, "motor": Motor}
ASSEMBLY = {"joint": {"mode": Linkage.mode}, "link": {"pose": Linkage.pose}}  # keys that say which assembly is meant
HEAD = ("name", "gravity")


def load_linkage(source) -> Linkage:
    """Linkage of a file, or a shipped one by name.

    Parameters
    ----------
    source : str or Path
        Path of a .toml file, or the name of a shipped linkage such as "four_bar" (`gauss models` lists them).

    Raises
    ------
    FileError
        If there is no such thing, or it says something that a linkage cannot be; the message names file and place.
    """
    name, path = str(source), Path(source)
    if path.suffix.lower() != ".toml":
        shipped = linkage_files()
        if path.suffix or path.exists() or name not in shipped:
            raise FileError(f"{name!r} is neither a linkage file (.toml) nor a shipped linkage. {known(name, shipped)}")
        path = shipped[name]
    data = tables(path)
    try:
        return from_tables(data)
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error


def from_tables(data: dict) -> Linkage:
    """Linkage of the tables of a file."""
    everything = [*HEAD, *SINGLE, *SECTIONS]
    for key in data:
        if key not in everything:
            raise SceneError(f"unknown section {key!r}. {known(key, everything)}")
    linkage = Linkage(**{key: data[key] for key in HEAD if key in data})
    for section, kind in SECTIONS.items():
        for number, entry in enumerate(entries_of(data, section), start=1):
            said = {key: entry[key] for key in ASSEMBLY.get(section, {}) if key in entry}
            made = linkage.add(element(section, kind, {k: v for k, v in entry.items() if k not in said}, number))
            for key, value in said.items():
                ASSEMBLY[section][key](linkage, made, value)
    for section, kind in SINGLE.items():
        if section in data:
            if not isinstance(data[section], dict):
                raise SceneError(f"section {section!r}: write [{section}] with single brackets, once.")
            linkage.add(element(section, kind, data[section], 1))
    return linkage
