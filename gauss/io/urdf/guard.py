"""Checks of a URDF file before Pinocchio's parser: meshes of its own package only."""

import re
from contextlib import contextmanager
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

from gauss.errors import FileError, SceneError
from gauss.io.guard import Source, read_xml, require_inside

SCHEMES = ("package://", "model://")  # looked for in the folders above the file


def guarded(path) -> Source:
    """File that may be parsed: by Pinocchio not as it stands, but as what was read here is written down anew.

    FileError if it cannot be read, or holds what is refused; the message says where.
    """
    return read_xml(path, ("robot",), limits=("limit",), loose_comments=True)


def place_of(source: Source, message: str) -> str:
    """File and line of the link or joint that a message begins with; the file alone if it names none."""
    named = re.match(r"(joint|body|frame|start of joint) '(.+?)'", message)
    tag = "joint" if named and named[1].endswith("joint") else "link"
    found = [element for element in source.root.iter(tag) if named and element.get("name") == named[2]]
    return source.place(found[0] if found else None)


@contextmanager
def placed(source: Source, element: Element):
    """Context in which errors of a scene are raised with the file and line of an element.

    FileError in place of an error of the scene.
    """
    try:
        yield
    except SceneError as error:
        raise FileError(f"{source.place(element)}: {error}") from error


def require_own_meshes(source: Source):
    """Refuse meshes outside of the package of a file.

    FileError naming the first, and where it is asked for.
    """
    home = source.path.resolve().parent
    for element in source.root.iter("mesh"):
        named = element.get("filename", "")
        scheme = next((scheme for scheme in SCHEMES if named.startswith(scheme)), None)
        if scheme is None:  # robots keep meshes/ beside urdf/
            require_inside(source, element, home.parent, str(home / named.removeprefix("file://")))
        elif ".." in PurePosixPath(named.removeprefix(scheme)).parts:
            raise FileError(f"{source.place(element)}: names the file {named!r} outside its own package; put a copy there.")
