"""A measurement: what is chosen, the table that it fills, the versions that it depends on, and the page of the table."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from gauss.bench.levels import digest_of_settings
from gauss.bench.machine import header
from gauss.bench.table import ResultTable, header_of, read_table
from gauss.errors import BackendError, did_you_mean


@dataclass(frozen=True)
class Measurement:
    """Measurement of a command of ``gauss bench``."""

    name: str  # of its table, ``NAME.csv``, and its page, ``NAME.md``
    keys: tuple[str, ...]  # keys, values: columns that name a row, and those that are measured
    values: tuple[str, ...]
    packages: tuple[str, ...]  # packages whose versions the header tells

    def table(self, folder: Path, fresh: bool) -> ResultTable:
        """The table in a folder, with the rows that are there unless it begins afresh."""
        conditions = [*header(*self.packages), f"settings of QP solvers: digest {digest_of_settings()}"]
        return ResultTable(Path(folder) / f"{self.name}.csv", conditions, self.keys, self.values, fresh)

    def write_page(self, folder: Path, table: Path, markdown: Callable[[list[dict], list[str]], str]) -> Path:
        """Write the page beside the table, and return its path."""
        page = folder / f"{self.name}.md"
        page.write_text(markdown(read_table(table), header_of(table)), encoding="utf-8")
        return page


def chosen(names: Iterable[str] | None, existing: Iterable[str], what: str) -> tuple[str, ...]:
    """Return the names, each once, or all if none is given; BackendError if one does not exist."""
    existing, names = tuple(existing), tuple(names or ())
    for name in names:
        if name not in existing:
            raise BackendError(f"no {what} {name!r}. {did_you_mean(name, existing)}")
    return tuple(dict.fromkeys(names)) if names else existing
