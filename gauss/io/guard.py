"""Untrusted XML files, checked before the parser of their format: nothing hostile passes, every element has a line.

No document type and no entities, no endless nesting, no numbers beyond reason, no files elsewhere.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from gauss.errors import FileError
from gauss.io.numbers import number
from gauss.scene.file_contents import contents

MOST_INCLUDES = 1000  # included files of one file, nested ones counted: more is a mistake, or an attack
DEEPEST = 200  # elements inside elements; parsers call themselves for each
DEEPEST_OF = {"mujoco": 499, "mujocoinclude": 499}  # by the outermost element: chains of bodies; the limit of MuJoCo
LARGEST_MAGNITUDE = 1e20  # of a number, in any SI unit: above those of any mechanism
MOST_ATTRIBUTES = 1000  # of one element: parsers compare each with all others
NAMES = ("name", "link", "joint", "body")  # attributes that may look like numbers and are none


@dataclass(frozen=True)
class Source:
    """One file that may be parsed."""

    path: Path
    root: Element  # what it holds
    places: dict[Element, str] = field(repr=False)  # file and line of every element, as "robot.urdf:12"

    def place(self, element: Element | None) -> str:
        """File and line of an element; the file alone where there is none."""
        return str(self.path) if element is None else self.places.get(element, str(self.path))


def read_xml(path, roots: tuple[str, ...], limits: tuple[str, ...] = (), loose_comments: bool = False) -> Source:
    """Read an untrusted file.

    FileError if it cannot be read, or holds what is refused; the message says where.

    Parameters
    ----------
    roots : tuple of str
        What its outermost element may be.
    limits : tuple of str
        Elements whose numbers may be of any size: where there is no limit, files hold the largest double.
    loose_comments : bool
        Whether comments may hold "--", and blanks precede the declaration: only where no other parser reads the file again,
        which might see other elements.
    """
    path = Path(path)
    content = contents(path)
    try:
        source = _parsed(path, content, loose_comments)
    except expat.ExpatError as error:
        raise FileError(f"{path}: not XML: {error}.") from error
    except FileError:
        raise
    except (LookupError, ValueError) as error:  # of the encoding that the file names
        raise FileError(f"{path}: cannot be decoded: {error}; write it in UTF-8.") from error
    if source.root.tag not in roots:
        got = source.root.tag
        raise FileError(f"{path}: expected <{roots[0]}>, got <{got}>; other formats are read by their own endings.")
    for element in source.root.iter():
        if element.tag not in limits:
            _require_reasonable(source, element)
    return source


def require_inside(source: Source, element: Element, home: Path, named: str, root_folder: Path | None = None):
    """Refuse a file that is neither in a folder nor in the one that the user named.

    FileError naming the file and where it is asked for; also of a pipe or device, from which reading may not end.
    """
    file = resolved(home / named, source.place(element))
    allowed = [folder for folder in (home, root_folder) if folder is not None]
    if any(file.is_relative_to(folder.resolve()) for folder in allowed):
        if file.exists() and not (file.is_file() or file.is_dir()):
            raise FileError(f"{source.place(element)}: names {named!r}, a pipe or device; name a file.")
        return
    if root_folder is None:
        remedy = "put a copy there, or name a folder that holds both, where it can be: gauss.load(..., root_folder=...)"
    else:
        remedy = f"and outside root_folder {str(root_folder)!r}; name a folder that holds both"
    raise FileError(f"{source.place(element)}: names the file {named!r} outside its own folder; {remedy}.")


def resolved(path: Path, place: str) -> Path:
    """Path without links; FileError if its links go round in a circle."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:
        raise FileError(f"{place}: names the file {path.name!r}, whose links lead round in a circle.") from error


def checked_root(path, root_folder) -> Path | None:
    """Folder that a file may name files in, as the user gave it; FileError if it is no folder."""
    if root_folder is None:
        return None
    if not isinstance(root_folder, str | Path) or not Path(root_folder).is_dir():
        raise FileError(f"{path}: root_folder: expected a folder, got {root_folder!r}.")
    return Path(root_folder).resolve()


def _parsed(path: Path, content: bytes, loose_comments: bool) -> Source:
    try:
        return _Parser(path).parsed(content)
    except expat.ExpatError as error:
        if not loose_comments:
            raise
        try:
            return _Parser(path).parsed(_without_comments(content))
        except expat.ExpatError:
            raise error from None


def _without_comments(content: bytes) -> bytes:
    """Text of the same lines without comments and declaration."""
    blank = lambda found: b"\n" * found[0].count(b"\n")  # noqa: E731
    return re.sub(rb"<!--.*?-->", blank, re.sub(rb"^\s*<\?xml.*?\?>", blank, content, flags=re.S), flags=re.S)


class _Parser:
    """Expat, which knows lines, with a builder of elements behind it."""

    def __init__(self, path: Path):
        self.path, self.depth, self.deepest, self.builder = path, 0, DEEPEST, TreeBuilder()
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
        if not self.depth:
            self.deepest = DEEPEST_OF.get(tag, DEEPEST)
        if len(attributes) > MOST_ATTRIBUTES:
            raise FileError(f"{self._here}: <{tag}> has {len(attributes)} attributes, more than {MOST_ATTRIBUTES}.")
        self.depth += 1
        if self.depth > self.deepest:
            raise FileError(f"{self._here}: elements are nested more than {self.deepest} deep.")
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
