"""``gauss bench qp --class``: the comparison on one class of problems, with a table of its own."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from gauss.bench.instances import GROUPS, MAIN_FORM, Instance, group_of, of_selection
from gauss.bench.levels import MAIN_LEVEL
from gauss.bench.problems import SELECTION, make_problem
from gauss.bench.qp import NAME, compare, quick_backends
from gauss.bench.suite import CLASSES, recipes
from gauss.bench.suite_instances import SUITE, of_suite, suite_class
from gauss.bench.table import ResultTable, chosen

QUICK_PROBLEMS = 8  # problems of a class in a quick run, and of levels other than the main one, evenly spread
OTHER_LEVELS = ("low", "mid")
LARGE_CLASS = "large"  # class whose problems take solvers seconds each
CLASSES_OF_NAME = {"friction": ("cones", "coulomb")}  # names of several classes
STORIES = {
    "equality": "Accelerations of open and closed mechanisms: equality rows alone.",
    "inequality": "Joints at stops and boxes on points.",
    "inconsistent": "Rows that contradict each other by noise.",
}


def compare_class(
    folder: Path,
    kind: str,
    *,
    problems: Iterable[str] | None = None,
    quick: bool = False,
    backends: Iterable[str] | None = None,
    forms: Iterable[str] | None = None,
    levels: Iterable[str] | None = None,
    fresh: bool = False,
    **how,
) -> ResultTable:
    """Measure a class of the selection or of the suite, and return its table, ``qp_<class>.csv``.

    BackendError if there is no such class, or no such problem of it.

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
    backends, forms : sequence of str, optional
        As for :func:`gauss.bench.qp.compare`; when not given, the form of the pages, and in classes of the suite no solvers
        that compile for every size of problem.
    levels : sequence of str, optional
        When not given, level high of all problems, and low and mid of eight; of "large" high alone.
    fresh : bool
        Measure again what has been measured.
    **how
        Solvers, workers and progress, as for :func:`gauss.bench.qp.compare`.
    """
    chosen([kind], (*GROUPS, *SUITE), "class")
    names = problems_of(kind)
    wanted = chosen(problems, names, f"problem of class {kind!r}")
    few = wanted if problems else spread(wanted)
    how |= {"forms": forms or (MAIN_FORM,), "backends": backends or (quick_backends() if kind in SUITE else None)}
    how |= {"name": name_of(kind)}
    main = few if quick else wanted
    table = compare(folder, instances=_instances(kind, main), levels=levels or (MAIN_LEVEL,), fresh=fresh, **how)
    if levels is None and kind != LARGE_CLASS:
        table = compare(folder, instances=_instances(kind, few), levels=OTHER_LEVELS, **how)
    return table


def classes_named(kinds: Iterable[str]) -> list[str]:
    """Classes by name, with those that a name stands for in its place, each once."""
    return list(dict.fromkeys(one for kind in kinds for one in CLASSES_OF_NAME.get(kind, (kind,))))


def problems_of(kind: str) -> tuple[str, ...]:
    """Names of the problems of a class."""
    if kind in GROUPS:
        return tuple(name for name in SELECTION if group_of(make_problem(name)) == kind)
    return tuple(recipe.name for recipe in recipes(suite_class(kind)))


def spread(names: tuple[str, ...]) -> tuple[str, ...]:
    """Few names of many, evenly spread."""
    places = np.unique(np.linspace(0, len(names) - 1, min(QUICK_PROBLEMS, len(names))).round().astype(int))
    return tuple(names[place] for place in places)


def name_of(kind: str) -> str:
    """Name of the files of a class."""
    return f"{NAME}_{kind.replace(' ', '_')}"


def story_of(kind: str) -> str:
    """Content of a class."""
    return STORIES.get(kind) or CLASSES[suite_class(kind)]


def _instances(kind: str, names: tuple[str, ...]) -> Iterator[Instance]:
    return of_selection(names, (kind,)) if kind in GROUPS else of_suite(kind, list(names))
