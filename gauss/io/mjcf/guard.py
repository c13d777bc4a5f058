"""What a MJCF file may ask for before MuJoCo's parser sees it: no plugins, no files elsewhere; with what it includes."""

from pathlib import Path
from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import Source, read_xml, require_inside

ROOTS = ("mujoco", "mujocoinclude")
FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
FOLDERS = ("meshdir", "texturedir", "assetdir")
# Attributes of numbers that move a mechanism. MuJoCo takes its default where one is empty or nan, without a word.
NUMERIC = {"pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "fromto", "size", "mass", "density", "inertia"}
NUMERIC |= {"diaginertia", "fullinertia", "axis", "range", "ref", "springref", "stiffness", "damping", "armature"}
NUMERIC |= {
    "frictionloss",
    "springlength",
    "springdamper",
    "gear",
    "gainprm",
    "biasprm",
    "dynprm",
    "ctrlrange",
    "forcerange",
}
NUMERIC |= {"actuatorfrcrange", "kp", "kv", "dampratio", "polycoef", "coef", "anchor", "relpose", "gravity", "viscosity"}
NUMERIC |= {"wind", "scale", "refpos", "refquat", "friction", "gravcomp", "cranklength", "timeconst", "qpos", "qvel"}
NUMERIC |= {"settotalmass", "boundmass", "boundinertia", "inertiagrouprange", "divisor", "offset", "margin", "gap"}
RANGES = {"range", "ctrlrange", "forcerange", "actuatorfrcrange"}  # which may be infinite
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
    folders = ["", *(element.get(key, "") for element in source.root.iter("compiler") for key in FOLDERS)]
    for element in source.root.iter():
        _require_numbers(source, element)
        if element.tag in FORBIDDEN:
            raise FileError(f"{source.place(element)}: <{element.tag}> asks for a plugin, which is not loaded; remove it.")
        for named in (element.get(key) for key in FILES):
            if named is not None:
                for folder in folders:
                    require_inside(source, element, home, str(Path(folder) / named))
    return source


def _require_numbers(source: Source, element: Element):
    for key in NUMERIC & set(element.keys()):
        words = element.get(key, "").lower().split()
        undefined = [
            word for word in words if word.lstrip("+-") in (("nan",) if key in RANGES else ("nan", "inf", "infinity"))
        ]
        if undefined or not words:
            raise FileError(
                f"{source.place(element)}: <{element.tag}> {key}: expected finite numbers, got {element.get(key)!r}."
            )


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
