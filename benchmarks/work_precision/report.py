"""The table of all attempts, kept on disk while it grows; the report; the charts; a section of the README."""

import csv
from dataclasses import astuple, fields
from pathlib import Path

from benchmarks.machine import header
from benchmarks.work_precision.beaten import beaten, best, rewrite, section
from gauss.bench.precision import Attempt
from gauss.bench.table import header_of
from gauss.view.precision import plot_precision

LEVELS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)  # m
NUMBERS = ("setting", "error", "seconds", "compile_seconds", "drift", "gap")
PACKAGES = ("numpy", "scipy", "llvmlite", "pin", "mujoco", "exudyn", "drake", "heyoka")


class Table:
    """Attempts by scene, in a file to which every one is added at once."""

    def __init__(self, path: Path, fresh: bool):
        self.path, self.found, self.sources, self.seconds = path, {}, {}, 0.0
        if path.exists() and not fresh:
            self._read()
        else:
            path.parent.mkdir(exist_ok=True)
            with open(path, "w", newline="") as file:
                file.writelines(f"# {line}\n" for line in header(*PACKAGES))
                csv.writer(file).writerow(["scene", *(field.name for field in fields(Attempt)), "reference"])

    def _read(self):
        with open(self.path, newline="") as file:
            lines = file.readlines()
        self.seconds = sum(float(line.split()[-2]) for line in lines if line.startswith("# measured in"))
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            scene, source = row.pop("scene"), row.pop("reference")
            numbers = {name: float(row[name]) for name in NUMBERS}
            self.found.setdefault(scene, []).append(Attempt(**(row | numbers)))
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


def write(table: Table, folder: Path, readme: Path, about: str):
    """Report, charts, and what the README of the benchmarks says of them."""
    lines = [*conditions(table), f"measured in {table.seconds:.0f} s of processor time"]
    title = f"What a digit costs; {lines[0].removeprefix('date: ')}, {lines[1].removeprefix('machine: ')}"
    note = "filled, solid: gauss; hollow, dashed: others; each from coarse to fine; at the right border: no result, and why"
    paths = [folder / f"work_precision.{ending}" for ending in ("png", "svg")]
    plot_precision(table.found, paths, title, note)
    text = [
        "# Work against precision",
        "",
        *(f"- {line}" for line in lines),
        "",
        "![error against wall time](work_precision.svg)",
        "",
        "Least wall time [ms] with which an error of the centres of mass is reached at the end, by gauss (and its method),",
        "and by the best of the others (and which); –: by none.",
        "",
        _levels(table),
        "",
        "## Where another engine is faster",
        "",
        *beaten(table.found),
        "",
        "## Failures",
        "",
        *_failures(table),
        "",
        "## References",
        "",
        *(f"* {scene}: {source}." for scene, source in table.sources.items()),
        "",
        "## How it was measured",
        "",
        about,
        "",
    ]
    (folder / "work_precision.md").write_text("\n".join(text))
    rewrite(readme, section(table.found, conditions(table)))


def conditions(table: Table) -> list[str]:
    """Lines of the header: when, where, with which versions."""
    return [line for line in header_of(table.path) if not line.startswith("measured")]


def _levels(table: Table) -> str:
    rows = [f"| scene | {' | '.join(f'{level:.0e} m' for level in LEVELS)} |", "|---" * (len(LEVELS) + 1) + "|"]
    for scene, found in table.found.items():
        cells = [f"{_cell(best(found, level, True))}; {_cell(best(found, level, False))}" for level in LEVELS]
        rows.append(f"| {scene} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _cell(one: Attempt | None) -> str:
    if one is None:
        return "–"
    return f"{1e3 * one.seconds:.3g} ({one.method if one.engine == 'gauss' else one.engine})"


def _failures(table: Table) -> list[str]:
    found = []
    for scene, attempts in table.found.items():
        for one in attempts:
            if one.failed:
                found.append(f"* {scene}, {one.engine} {one.method} with {one.setting:.2g}: {one.reason}.")
    return found or ["None."]
