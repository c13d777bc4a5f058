"""Order of the sections of the gallery."""

from pathlib import Path

SECTIONS = ("first", "arms", "loops", "linkages", "rotors", "servo", "contact", "control", "analysis", "solvers", "issues")


def of_sections(folder: str) -> int:
    """Place of a folder of examples among the others."""
    name = Path(folder).name
    return SECTIONS.index(name) if name in SECTIONS else len(SECTIONS)
