"""What a MJCF file may ask for before MuJoCo's parser sees it: no entities, no endless nesting, no files elsewhere."""

from pathlib import Path
from xml.etree import ElementTree

from gauss.errors import FileError

LARGEST = 20_000_000  # bytes
DEEPEST = 200  # elements inside elements; MuJoCo's parser calls itself for each
FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
FOLDERS = ("meshdir", "texturedir", "assetdir")
FORBIDDEN = ("plugin", "extension")


def guarded(path: Path, seen: tuple[Path, ...] = ()) -> ElementTree.Element:
    """Root of a file that may be parsed, and whose included files may be.

    Raises
    ------
    FileError
        If it cannot be read, or holds what is refused; the message names it.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise FileError(f"{path}: larger than {LARGEST / 1e6:g} MB; a mechanism needs less.")
        text = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}.") from error
    if b"<!" in text.replace(b"<!--", b"").replace(b"<![CDATA[", b""):
        raise FileError(f"{path}: declares a document type or entities, which MJCF does not need; remove them.")
    _require_shallow(path, text)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise FileError(f"{path}: not XML: {error}.") from error
    if root.tag not in ("mujoco", "mujocoinclude"):
        raise FileError(f"{path}: expected <mujoco>, got <{root.tag}>; other formats are read by their own endings.")
    _check(path, root, seen)
    return root


def _require_shallow(path: Path, text: bytes):
    parser, depth = ElementTree.XMLPullParser(events=("start", "end")), 0
    try:
        parser.feed(text)
        for event, _ in parser.read_events():
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise FileError(f"{path}: elements are nested more than {DEEPEST} deep.")
    except ElementTree.ParseError as error:
        raise FileError(f"{path}: not XML: {error}.") from error


def _check(path: Path, root: ElementTree.Element, seen: tuple[Path, ...]):
    home = path.resolve().parent
    folders = [element.get(key) for element in root.iter("compiler") for key in FOLDERS if element.get(key)]
    for element in root.iter():
        if element.tag in FORBIDDEN:
            raise FileError(f"{path}: <{element.tag}> asks for a plugin, which gauss does not load; remove it.")
        for named in (element.get(key) for key in FILES):
            if named is not None:
                for folder in ("", *folders):
                    _require_inside(path, home, Path(folder) / named)
        if element.tag == "include":
            included = (home / element.get("file", "")).resolve()
            if included in (*seen, path.resolve()):
                raise FileError(f"{path}: includes {included.name}, which includes it again.")
            guarded(included, (*seen, path.resolve()))


def _require_inside(path: Path, home: Path, named: Path):
    if not (home / named).resolve().is_relative_to(home):
        raise FileError(f"{path}: names the file {str(named)!r} outside its own folder; put a copy there.")
