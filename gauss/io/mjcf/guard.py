"""What a MJCF file may ask for before MuJoCo's parser sees it: no plugins, no files elsewhere; with what it includes."""

from pathlib import Path

from gauss.errors import FileError
from gauss.io.guard import Source, read_xml, require_inside

ROOTS = ("mujoco", "mujocoinclude")
FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
FOLDERS = ("meshdir", "texturedir", "assetdir")
FORBIDDEN = ("plugin", "extension")


def guarded(path: Path) -> Source:
    """File that may be parsed, with the files that it includes in their places.

    Raises
    ------
    FileError
        If it cannot be read, or holds what is refused; the message says where.
    """
    source, home = read_xml(path, ROOTS), path.resolve().parent
    _include(source, source, home, (path.resolve(),))
    folders = ["", *(element.get(key) for element in source.root.iter("compiler") for key in FOLDERS if element.get(key))]
    for element in source.root.iter():
        if element.tag in FORBIDDEN:
            raise FileError(f"{source.place(element)}: <{element.tag}> asks for a plugin, which is not loaded; remove it.")
        for named in (element.get(key) for key in FILES):
            if named is not None:
                for folder in folders:
                    require_inside(source, element, home, str(Path(folder) / named))
    return source


def _include(whole: Source, part: Source, home: Path, seen: tuple[Path, ...]):
    """Put the elements of included files in the places of what asks for them."""
    for element in list(part.root.iter()):
        for number, child in reversed(list(enumerate(element))):
            if child.tag != "include":
                continue
            named = child.get("file", "")
            found = {(folder / named).resolve() for folder in (home, part.path.resolve().parent)}
            for folder in (home, part.path.resolve().parent):
                require_inside(whole, child, home, str(folder / named))
            included = min(found, key=lambda file: not file.is_file())
            if sum(file.is_file() for file in found) > 1:
                raise FileError(f"{whole.place(child)}: two files are called {named!r}; rename one of them.")
            if included in seen:
                raise FileError(f"{whole.place(child)}: includes {included.name}, which includes it again.")
            inner = read_xml(included, ROOTS)
            whole.places.update(inner.places)
            _include(whole, inner, home, (*seen, included))
            element[number : number + 1] = list(inner.root)
