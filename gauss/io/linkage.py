"""Linkage files in TOML: links, joints, drive, motor and loads, one key per field of their classes. Nothing is executed."""

from gauss.errors import SceneError
from gauss.io.catalog import linkage_files
from gauss.linkages import Driver, Link, Linkage, LinkJoint, Load, Motor
from gauss.scene.toml import check_sections, element, entries_of, read_file

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

    Returns
    -------
    Linkage
        The linkage.

    Raises
    ------
    FileError
        If there is no such thing, or it says something that a linkage cannot be; the message names file and place.
    """
    return read_file(source, linkage_files(), "linkage", from_tables)


def from_tables(data: dict) -> Linkage:
    """Linkage of the tables of a file."""
    check_sections(data, [*HEAD, *SINGLE, *SECTIONS])
    linkage = Linkage(**{key: data[key] for key in HEAD if key in data})
    for section in SECTIONS:
        for number, entry in enumerate(entries_of(data, section), start=1):
            _add(linkage, section, entry, number)
    for section, kind in SINGLE.items():
        if section in data:
            if not isinstance(data[section], dict):
                raise SceneError(f"section {section!r}: write [{section}] with single brackets, once.")
            linkage.add(element(section, kind, data[section], 1))
    return linkage


def _add(linkage: Linkage, section: str, entry: dict, number: int):
    """Element of a table, and which assembly of it is meant."""
    said = {key: entry[key] for key in ASSEMBLY.get(section, {}) if key in entry}
    made = linkage.add(element(section, SECTIONS[section], {k: v for k, v in entry.items() if k not in said}, number))
    for key, value in said.items():
        ASSEMBLY[section][key](linkage, made, value)
