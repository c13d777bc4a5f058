"""XML files from anybody, looked at before the parser of their format: nothing hostile passes, every element has a line.

No document type and no entities, no endless nesting, no numbers beyond reason, no files elsewhere.
"""

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from gauss.errors import FileError
from gauss.io.numbers import number

LARGEST_FILE = 20_000_000  # bytes
DEEPEST = 200  # elements inside elements; parsers call themselves for each
LARGEST_MAGNITUDE = 1e20  # of a number, in any SI unit: above those of any mechanism
NAMES = ("name", "link", "joint", "body")  # attributes that may look like numbers and are none


@dataclass(frozen=True)
class Source:
    """One file that may be parsed.

    Parameters
    ----------
    path : Path
        The file.
    root : Element
        What it holds.
    places : dict
        File and line of every element, as "robot.urdf:12".
    """

    path: Path
    root: Element
    places: dict[Element, str] = field(repr=False)

    def place(self, element: Element | None) -> str:
        """File and line of an element; the file alone where there is none."""
        return str(self.path) if element is None else self.places.get(element, str(self.path))


def read_xml(path, roots: tuple[str, ...], limits: tuple[str, ...] = ()) -> Source:
    """Read a file that may come from anybody.

    Parameters
    ----------
    path : str or Path
        The file.
    roots : tuple of str
        What its outermost element may be.
    limits : tuple of str
        Elements whose numbers may be of any size: where there is no limit, files hold the largest double.

    Raises
    ------
    FileError
        If it cannot be read, or holds what is refused; the message says where.
    """
    path = Path(path)
    if not path.exists():
        raise FileError(f"{path}: no such file.")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise FileError(f"{path}: larger than {LARGEST_FILE / 1e6:g} MB; a mechanism needs less.")
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}.") from error
    try:
        source = _Parser(path).parsed(content)
    except expat.ExpatError as error:
        raise FileError(f"{path}: not XML: {error}.") from error
    if source.root.tag not in roots:
        got = source.root.tag
        raise FileError(f"{path}: expected <{roots[0]}>, got <{got}>; other formats are read by their own endings.")
    for element in source.root.iter():
        if element.tag not in limits:
            _require_reasonable(source, element)
    return source


def require_inside(source: Source, element: Element, home: Path, named: str):
    """Refuse a file that is not in a folder.

    Raises
    ------
    FileError
        Naming the file and where it is asked for.
    """
    if not (home / named).resolve().is_relative_to(home.resolve()):
        raise FileError(f"{source.place(element)}: names the file {named!r} outside its own folder; put a copy there.")


class _Parser:
    """Expat, which knows lines, with a builder of elements behind it."""

    def __init__(self, path: Path):
        self.path, self.depth, self.builder = path, 0, TreeBuilder()
        self.places: dict[Element, str] = {}
        self.expat = expat.ParserCreate()
        self.expat.buffer_text = True
        self.expat.StartElementHandler, self.expat.EndElementHandler = self._start, self._end
        self.expat.CharacterDataHandler = self.builder.data
        self.expat.StartDoctypeDeclHandler = self.expat.EntityDeclHandler = self._refuse

    def parsed(self, content: bytes) -> Source:
        self.expat.Parse(content, True)
        return Source(self.path, self.builder.close(), self.places)

    @property
    def _here(self) -> str:
        return f"{self.path}:{self.expat.CurrentLineNumber}"

    def _start(self, tag: str, attributes: dict):
        self.depth += 1
        if self.depth > DEEPEST:
            raise FileError(f"{self._here}: elements are nested more than {DEEPEST} deep.")
        self.places[self.builder.start(tag, attributes)] = self._here

    def _end(self, tag: str):
        self.depth -= 1
        self.builder.end(tag)

    def _refuse(self, *_):
        raise FileError(f"{self._here}: declares a document type or entities, which no format here needs; remove them.")


def _require_reasonable(source: Source, element: Element):
    values = [(f" {key}", value) for key, value in element.items() if key not in NAMES]
    for key, value in (*values, ("", element.text or "")):
        for token in value.split():
            if abs(number(token) or 0.0) > LARGEST_MAGNITUDE:
                short = token if len(token) < 20 else f"{token[:16]}…"
                place = source.place(element)
                raise FileError(f"{place}: <{element.tag}>{key} holds {short}, more than {LARGEST_MAGNITUDE:g}; check it.")
