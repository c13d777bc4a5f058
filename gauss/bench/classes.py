"""``gauss bench qp --class``: the comparison on one class of problems, with a table of its own."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from gauss.bench.instances import GROUPS, Instance, group_of, of_selection
from gauss.bench.measurement import chosen
from gauss.bench.problems import SELECTION, make_problem
from gauss.bench.qp import NAME, compare
from gauss.bench.suite import CLASSES, recipes
from gauss.bench.suite_instances import SUITE, of_suite, suite_class
from gauss.bench.table import ResultTable

FEW = 8  # problems of a class in a quick run, evenly spread
TOGETHER = {"friction": ("cones", "coulomb")}  # names of several classes
STORIES = {
    "equality": "Accelerations of open and closed mechanisms: equality rows alone.",
    "inequality": "Joints at stops and boxes on points.",
    "inconsistent": "Rows that contradict each other by noise.",
}


def compare_class(
    folder: Path, kind: str, *, problems: Iterable[str] | None = None, quick: bool = False, **how
) -> ResultTable:
    """Measure a class of the selection or of the suite, and return its table, ``qp_<class>.csv``.

    Parameters
    ----------
    folder : Path
        Where the table is, or shall be.
    kind : str
        The class: "equality", "inequality" or "inconsistent" of the selection, or a class of the suite.
    problems : sequence of str, optional
        Only these of its problems.
    quick : bool
        No more than eight problems, unless they are named.
    **how
        Backends, forms, levels, solvers, workers, fresh and progress, as for :func:`gauss.bench.qp.compare`.

    Raises
    ------
    BackendError
        If there is no such class, or no such problem of it.
    """
    chosen([kind], (*GROUPS, *SUITE), "class")
    names = problems_of(kind)
    wanted = chosen(problems, names, f"problem of class {kind!r}")
    if quick and not problems:
        wanted = spread(wanted)
    return compare(folder, instances=_instances(kind, wanted), name=name_of(kind), **how)


def classes_named(kinds: Iterable[str]) -> list[str]:
    """Classes by name, with those that a name stands for in its place, each once."""
    return list(dict.fromkeys(one for kind in kinds for one in TOGETHER.get(kind, (kind,))))


def problems_of(kind: str) -> tuple[str, ...]:
    """Names of the problems of a class."""
    if kind in GROUPS:
        return tuple(name for name in SELECTION if group_of(make_problem(name)) == kind)
    return tuple(recipe.name for recipe in recipes(suite_class(kind)))


def spread(names: tuple[str, ...]) -> tuple[str, ...]:
    """Few names of many, evenly spread."""
    places = np.unique(np.linspace(0, len(names) - 1, min(FEW, len(names))).round().astype(int))
    return tuple(names[place] for place in places)


def name_of(kind: str) -> str:
    """Name of the files of a class."""
    return f"{NAME}_{kind.replace(' ', '_')}"


def story_of(kind: str) -> str:
    """What is in a class."""
    return STORIES.get(kind) or CLASSES[suite_class(kind)]


def _instances(kind: str, names: tuple[str, ...]) -> Iterator[Instance]:
    return of_selection(names, (kind,)) if kind in GROUPS else of_suite(kind, list(names))
