"""Checks of an MJCF file, and of those that it includes, before MuJoCo's parser: no plugins, no files elsewhere."""

from collections import Counter
from collections.abc import Callable
from math import prod
from operator import itemgetter
from pathlib import Path
from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import MOST_INCLUDES, Source, read_xml, require_inside, resolved

ROOTS = ("mujoco", "mujocoinclude")
ATTACHED_ROOTS = (*ROOTS, "robot")  # MuJoCo attaches URDF files, too
FILES = ("file", "filename", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
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
NUMERIC |= {"elevation"}
RANGES = {"range", "ctrlrange", "forcerange", "actuatorfrcrange"}  # which may be infinite
FORBIDDEN = ("plugin", "extension")
COPIES = "replicate", "composite", "flexcomp"  # elements that stand for many
MOST_COPIES = 10_000  # elements that these make: MuJoCo's compiler takes 5 s for 8 000, four times as long for twice as many
GRIDS = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
SIDES_OF_CUBE = 6
LARGEST_GRID = 1e8  # numbers: 10 000 × 10 000, of which each takes memory before anything is read
MOST_ATTACHED = 50_000  # elements of attached models: MuJoCo's compiler takes 2 s for 22 000, ever longer for more

Reader = Callable[[Path, Path, dict[Path, int], tuple[Path, ...]], int]


def guarded(path: Path, root_folder: Path | None = None) -> Source:
    """File that may be parsed, with the files that it includes in their places; those that it attaches are checked alike.

    FileError if it cannot be read, or holds what is refused; the message says where.

    Parameters
    ----------
    root_folder : Path, optional
        Folder that named files may lie in, beside that of the file.
    """
    source = _checked(path, root_folder, ROOTS)
    count_attached(source, root_folder, _attached, {}, (path.resolve(),))
    return source


def _attached(path: Path, root_folder: Path, known: dict[Path, int], seen: tuple[Path, ...]) -> int:
    """Number of elements of an attached file, after its checks."""
    source = _checked(path, root_folder, ATTACHED_ROOTS)
    own = sum(1.0 + _copies(element) for element in source.root.iter())
    return int(own) + count_attached(source, root_folder, _attached, known, seen)


def _checked(path: Path, root_folder: Path | None, roots: tuple[str, ...]) -> Source:
    source, home = read_xml(path, roots), path.resolve().parent
    _Includes(source, home, root_folder).put(source, (path.resolve(),))
    folders = ["", *(element.get(key, "") for element in source.root.iter("compiler") for key in FOLDERS)]
    _require_few(source)
    for element in source.root.iter():
        _require_numbers(source, element)
        if element.tag in FORBIDDEN:
            raise FileError(f"{source.place(element)}: <{element.tag}> asks for a plugin, which is not loaded; remove it.")
        for named in (element.get(key) for key in FILES):
            if named is not None:
                for folder in folders:
                    require_inside(source, element, home, str(Path(folder) / named), root_folder)
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


def _require_few(source: Source):
    """Refuse elements that stand for so many that parsing them would not end, grids and sizes that fill the memory."""
    for element in source.root.iter():
        if element.tag in COPIES and (copies := _copies(element)) > MOST_COPIES:
            raise FileError(
                f"{source.place(element)}: <{element.tag}> makes {copies:.3g} elements, more than {MOST_COPIES}; give a "
                "smaller count."
            )
        keys, numbers = _stored(element)
        if numbers > LARGEST_GRID:
            raise FileError(
                f"{source.place(element)}: <{element.tag}> has {numbers:.3g} numbers; give a smaller {' and '.join(keys)}."
            )


def _stored(element: Element) -> tuple[tuple[str, ...], float]:
    """Attributes that say how much memory an element takes, and how many numbers that is."""
    if element.tag == "size":
        return max(
            (((key,), _count(word)) for key, word in element.items() if key != "memory"), key=itemgetter(1), default=((), 0)
        )
    if element.tag == "texture" and element.get("type", "cube") != "2d":
        return ("width",), SIDES_OF_CUBE * _count(element.get("width", "0")) ** 2
    keys = GRIDS.get(element.tag, ())
    return keys, prod(_count(element.get(key, "0")) for key in keys)


def _copies(element: Element) -> float:
    """Number of elements that one stands for, with those inside it."""
    own = prod(map(_count, element.get("count", "1").split())) if element.tag in COPIES else 1.0
    return own * (1.0 + sum(map(_copies, element)))


def _count(word: str) -> float:
    """A number of a file; what is none is left to MuJoCo's parser."""
    try:
        return max(float(word), 1.0)
    except ValueError:
        return 1.0


class _Includes:
    """Includes of one file."""

    def __init__(self, whole: Source, home: Path, root_folder: Path | None):
        self.whole, self.home, self.root_folder, self.count = whole, home, root_folder, 0

    def put(self, part: Source, seen: tuple[Path, ...]):
        """Put the elements of included files in the places of what asks for them."""
        for element in list(part.root.iter()):
            for number, child in reversed(list(enumerate(element))):
                if child.tag == "include":
                    included = self._file(child, part, seen)
                    inner = read_xml(included, ROOTS)
                    self.whole.places.update(inner.places)
                    self.put(inner, (*seen, included))
                    element[number : number + 1] = list(inner.root)

    def _file(self, include: Element, part: Source, seen: tuple[Path, ...]) -> Path:
        """File that an include names."""
        named, place = include.get("file", ""), self.whole.place(include)
        self.count += 1
        if self.count > MOST_INCLUDES:
            raise FileError(f"{place}: more than {MOST_INCLUDES} files are included; write them into fewer files.")
        folders = (self.home, part.path.resolve().parent)
        for folder in folders:
            require_inside(self.whole, include, self.home, str(folder / named), self.root_folder)
        found = {resolved(folder / named, place) for folder in folders}
        included = min(found, key=lambda file: not file.is_file())
        if sum(file.is_file() for file in found) > 1:
            raise FileError(f"{place}: two files are called {named!r}; rename one of them.")
        if included in seen:
            raise FileError(f"{place}: includes {included.name}, which includes it again.")
        return included


def count_attached(
    source: Source, root_folder: Path | None, read: Reader, known: dict[Path, int], seen: tuple[Path, ...]
) -> int:
    """Number of elements of the models that a file attaches, with those that they attach.

    They are files that MuJoCo reads by itself (``<model file=…>``, ``<attach model=…>``). Their number is the product along
    a chain of files that attach one another, so it is counted before MuJoCo makes them.

    FileError if a model attaches itself, or there are too many.

    Parameters
    ----------
    root_folder : Path, optional
        Folder that named files may lie in, beside that of the file.
    read : callable
        Checks the file of a model, and counts its elements: (file, folder that its files may lie in, known, seen).
    known : dict
        Counts of files that were read.
    seen : tuple of Path
        Files within which this one is attached, and this one.
    """
    total, home = 0, source.path.resolve().parent
    attached = Counter(element.get("model") for element in source.root.iter("attach"))
    for model in _models(source):
        place, named = source.place(model), model.get("file", "")
        require_inside(source, model, home, named, root_folder)
        file = resolved(home / named, place)
        if file in seen:
            raise FileError(f"{place}: attaches {file.name}, which attaches it again.")
        if file not in known:
            known[file] = read(file, root_folder or home, known, (*seen, file))
        times = attached[model.get("name")] if model.get("name") else attached.total()
        total += known[file] * (1 + times)  # it is read where it is not attached, too
        if total > MOST_ATTACHED:
            raise FileError(f"{place}: more than {MOST_ATTACHED} elements are attached; attach fewer.")
    return total


def _models(source: Source) -> list[Element]:
    return [model for asset in source.root.iter("asset") for model in asset.iter("model") if model.get("file") is not None]
