"""The table of all attempts, kept on disk while it grows; the report; the charts; a section of the README."""

import csv
from dataclasses import astuple, fields
from pathlib import Path

from benchmarks.work_precision.beaten import WHY, beaten, best, rewrite, section
from gauss.bench.machine import header
from gauss.bench.markdown import head, table, when_and_where
from gauss.bench.precision import Attempt
from gauss.bench.table import header_of, read_table, write_table
from gauss.view.precision import plot_precision

LEVELS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)  # m
PACKAGES = ("numpy", "scipy", "llvmlite", "pin", "mujoco", "exudyn", "drake", "heyoka")


class AttemptTable:
    """Attempts by scene, in a file to which every one is added at once."""

    def __init__(self, path: Path, fresh: bool):
        self.path, self.seconds = path, 0.0
        self.found: dict[str, list[Attempt]] = {}
        self.sources: dict[str, str] = {}
        if path.exists() and not fresh:
            self._read()
        else:
            columns = ["scene", *(field.name for field in fields(Attempt)), "reference"]
            write_table(path, header(*PACKAGES), [], columns)

    def _read(self):
        self.seconds = sum(float(line.split()[-2]) for line in header_of(self.path) if line.startswith("measured in"))
        for row in read_table(self.path):
            scene, source = row.pop("scene"), row.pop("reference")
            self.found.setdefault(scene, []).append(Attempt(**row))
            self.sources[scene] = source

    def has_method(self, scene: str, engine: str, method: str) -> bool:
        """Whether there is an attempt by this method."""
        return any((one.engine, one.method) == (engine, method) for one in self.found.get(scene, ()))

    def add(self, scene: str, attempts: list[Attempt], source: str):
        """Add attempts to the table and to the file."""
        self.found.setdefault(scene, []).extend(attempts)
        self.sources[scene] = source
        with open(self.path, "a", newline="") as file:
            for one in attempts:
                row = [f"{x:.6g}" if isinstance(x, float) else x for x in astuple(one)]
                csv.writer(file).writerow([scene, *row, source])

    def add_time(self, seconds: float):
        """Say how long measuring took."""
        self.seconds += seconds
        with open(self.path, "a") as file:
            file.write(f"# measured in {seconds:.1f} s\n" if seconds >= 0.1 else "")


def write(attempts: AttemptTable, folder: Path, readme: Path, about: str):
    """Report, charts, and what the README of the benchmarks says of them."""
    lines = [*conditions(attempts), f"measured in {attempts.seconds:.0f} s of processor time"]
    title = f"What a digit costs; {when_and_where(lines)}"
    note = "filled, solid: gauss; hollow, dashed: others; each from coarse to fine; at the right border: no result, and why"
    paths = [folder / f"work_precision.{ending}" for ending in ("png", "svg")]
    plot_precision(attempts.found, paths, title, note)
    text = [
        *head("Work against precision", lines),
        "![error against wall time](work_precision.svg)",
        "",
        "Least wall time [ms] with which an error of the centres of mass is reached at the end, by gauss (and its method),",
        "and by the best of the others (and which); –: by none.",
        "",
        *_levels(attempts),
        "",
        "## Where another engine is faster",
        "",
        *beaten(attempts.found),
        "",
        *WHY.split("\n"),
        "",
        "## Failures",
        "",
        *_failures(attempts),
        "",
        "## References",
        "",
        *(f"* {scene}: {source}." for scene, source in attempts.sources.items()),
        "",
        "## How it was measured",
        "",
        about,
        "",
    ]
    (folder / "work_precision.md").write_text("\n".join(text))
    rewrite(readme, section(attempts.found, conditions(attempts)))


def conditions(attempts: AttemptTable) -> list[str]:
    """Lines of the header: when, where, with which versions."""
    return [line for line in header_of(attempts.path) if not line.startswith("measured")]


def _levels(attempts: AttemptTable) -> list[str]:
    titles = ["scene", *(f"{level:.0e} m" for level in LEVELS)]
    return table(
        titles,
        (
            [scene, *(f"{_cell(best(found, level, True))}; {_cell(best(found, level, False))}" for level in LEVELS)]
            for scene, found in attempts.found.items()
        ),
    )


def _cell(one: Attempt | None) -> str:
    if one is None:
        return "–"
    return f"{1e3 * one.seconds:.3g} ({one.method if one.engine == 'gauss' else one.engine})"


def _failures(attempts: AttemptTable) -> list[str]:
    failed = ((scene, one) for scene, found in attempts.found.items() for one in found if one.failed)
    found = [f"* {scene}, {one.engine} {one.method} with {one.setting:.2g}: {one.reason}." for scene, one in failed]
    return found or ["None."]
