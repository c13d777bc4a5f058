"""Models that an MJCF file attaches (``<model file=…>``, ``<attach model=…>``): they are files that MuJoCo reads by itself.

Their number is the product along a chain of files that attach one another, so it is counted before MuJoCo makes them.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import Source, require_inside, resolved

MOST_ATTACHED = 50_000  # elements of attached models: MuJoCo's compiler takes 2 s for 22 000, ever longer for more

Reader = Callable[[Path, Path, dict[Path, int], tuple[Path, ...]], int]


def count_attached(
    source: Source, root_folder: Path | None, read: Reader, known: dict[Path, int], seen: tuple[Path, ...]
) -> int:
    """Number of elements of the models that a file attaches, with those that they attach.

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
