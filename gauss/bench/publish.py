"""Reports and charts of the comparison, from its tables."""

from pathlib import Path

import numpy as np

from gauss.bench.class_page import at_main_level, class_page
from gauss.bench.classes import name_of
from gauss.bench.fronts import front, fronts
from gauss.bench.instances import MAIN_FORM
from gauss.bench.levels import MAIN_LEVEL
from gauss.bench.markdown import when_and_where
from gauss.bench.problems import INCONSISTENT
from gauss.bench.report import cells_shown, markdown
from gauss.bench.summary import asked, backends, groups, is_broken, profile
from gauss.bench.table import header_of, read_table

RATIOS = np.logspace(0, 4, 200)


def publish(folder: Path, table: Path, reused: Path | None) -> list[Path]:
    """Write ``qp.md`` and the charts beside the tables; return what was written."""
    rows, header = read_table(table), header_of(table)
    report = folder / "qp.md"
    again = read_table(reused) if reused is not None and reused.exists() else []
    report.write_text(markdown(rows, again, header), encoding="utf-8")
    return [report, *_charts(folder, asked(rows), header)]


def publish_class(folder: Path, kind: str, table: Path) -> list[Path]:
    """Write the page of a class, and its chart if its problems have solutions; return what was written."""
    rows, header, name = read_table(table), header_of(table), name_of(kind)
    chart, page = folder / f"{name}.png", folder / f"{name}.md"
    names, overall, panels = fronts(at_main_level(asked(rows)))
    page.write_text(class_page(kind, rows, header, chart.name if overall else ""), encoding="utf-8")
    if not overall:
        return [page]
    from gauss.view.backends import plot_fronts  # the library of figures is optional and takes long to import

    lines = {problem: (points, front(points)) for problem, points in panels.items()}
    plot_fronts(names, (overall, front(overall)), lines, chart, f"Class {kind}; {header[0].removeprefix('date: ')}")
    return [page, chart]


def _charts(folder: Path, rows, header) -> list[Path]:
    from gauss.view import backends as view  # the library of figures is optional and takes long to import

    names, classes = backends(rows), {g: found for g, found in groups(rows).items() if g != INCONSISTENT}
    problems = [name for found in classes.values() for name in found]
    where = when_and_where(header)
    errors, time_error, profiled = (folder / f"qp_{name}.png" for name in ("errors", "time_error", "profile"))
    if cells := cells_shown(rows):
        view.plot_errors(*_errors(cells, names, problems), errors, f"Form {MAIN_FORM}, level {MAIN_LEVEL}; {where}")
    view.plot_time_error(rows, names, time_error, f"All problems and forms; grey: all backends; {where}")
    profiles = {
        f"{group}, error ≤ {a:g}": profile(rows, found, MAIN_FORM, MAIN_LEVEL, a, RATIOS)
        for group, found in classes.items()
        for a in (1e-6, 1e-12)
    }
    view.plot_profiles(profiles, RATIOS, profiled, f"Form {MAIN_FORM}, level {MAIN_LEVEL}; {where}")
    return [*([errors] if cells else []), time_error, profiled]


def _errors(
    cells: dict[tuple[str, str], dict], names: list[str], problems: list[str]
) -> tuple[list[str], list[str], np.ndarray, np.ndarray]:
    """Backends, problems, errors of the answers (backends, problems), and which are claimed beyond the tolerance."""
    shown = [name for name in names if any(key[0] == name for key in cells)]
    errors = np.array([[cells[n, p]["error"] if (n, p) in cells else np.nan for p in problems] for n in shown])
    broken = np.array([[(n, p) in cells and is_broken(cells[n, p]) for p in problems] for n in shown])
    return shown, problems, errors, broken
