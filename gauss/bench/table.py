"""A measurement: what is chosen, its table, written row by row so that an interruption costs one row, and its page."""

import csv
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gauss.bench.levels import digest_of_settings
from gauss.bench.machine import header
from gauss.errors import BackendError, FileError, did_you_mean

TEXTS = ("problem", "group", "backend", "reason", "data", "settings")  # columns of names and words, be they "001" or "nan"
COMMIT = "# commit:"  # line of a header that may differ where a measurement goes on, as the first, the date, does
OWN_VERSION = r"\bgauss \d[\w.]*, "


class ResultTable:
    """Rows of one measurement in a CSV file with a header of comments; rows that are there are not measured again.

    FileError if the file holds rows of other versions, of another machine, or of another table, or cannot be read or
    written.

    Parameters
    ----------
    header : list of str
        Lines that say when, where and with which versions; rows measured under others are not mixed with new ones.
    keys, values : tuple of str
        Columns that name a row, and those that are measured.
    fresh : bool
        Start over.
    """

    def __init__(self, path: Path, header: list[str], keys: tuple[str, ...], values: tuple[str, ...], fresh: bool):
        self.path, self.keys, self.columns = path, keys, (*keys, *values)
        self.rows: dict[tuple, dict] = {}
        comments = [f"# {line}\n" for line in header]
        try:
            if path.exists() and not fresh:
                self._take_up(comments)
                self._drop_half_a_row()
            else:
                path.parent.mkdir(parents=True, exist_ok=True)
                with open(path, "w", newline="", encoding="utf-8") as file:
                    file.writelines(comments)
                    csv.writer(file).writerow(self.columns)
        except UnicodeDecodeError:
            raise FileError(f"{path} is no table of words and numbers; --fresh starts over.") from None
        except (OSError, csv.Error) as error:
            raise FileError(f"{path}: {error}") from None

    def add(self, row: dict):
        """Write a row at once, in the place of one of the same key."""
        key, written = self._key(row), {column: _text(row[column]) for column in self.columns}
        if self.rows.pop(key, None) is not None:
            write_table(self.path, header_of(self.path), list(self.rows.values()), self.columns)
        with open(self.path, "a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(written.values())
        self.rows[key] = written

    def has(self, **cells) -> bool:
        """Whether a row is there already: one of this key, whose other given cells are the same."""
        found = self.rows.get(self._key(cells))
        return found is not None and all(found[column] == _text(cell) for column, cell in cells.items())

    def numbers(self) -> list[dict]:
        """All rows, numbers and truths as such."""
        return [_values(row) for row in self.rows.values()]

    def _key(self, row: dict) -> tuple:
        return tuple(_text(row[key]) for key in self.keys)

    def _take_up(self, comments: list[str]):
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        found, rest = _parted(lines)
        if _lasting(found) != _lasting(comments):
            raise FileError(f"{self.path} was measured elsewhere or with other versions; --fresh starts over.")
        reader = csv.DictReader(line for line in rest if line.endswith("\n"))
        if reader.fieldnames != list(self.columns):
            raise FileError(f"{self.path} has other columns than this table; --fresh starts over.")
        self.rows = {self._key(row): row for row in reader if None not in row.values() and None not in row}

    def _drop_half_a_row(self):
        """Write the file anew if an interruption has left a piece of a row."""
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):
            self.path.write_text("".join(lines[:-1]), encoding="utf-8")


def write_table(path: Path, header: Iterable[str], rows: Sequence[dict], columns: Iterable[str] | None = None):
    """Write a finished table: the header as comments, then the columns, those of the first row when not given.

    Missing cells of a row stay empty.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}\n" for line in header)
        writer = csv.DictWriter(file, list(columns or rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def read_table(path: Path) -> list[dict]:
    """Rows of a finished table."""
    with open(path, newline="", encoding="utf-8") as file:
        return [_values(row) for row in csv.DictReader(_parted(file)[1])]


def header_of(path: Path) -> list[str]:
    """Lines of the header of a table."""
    return [line.removeprefix("# ") for line in _parted(path.read_text(encoding="utf-8").splitlines())[0]]


def _parted(lines: Iterable[str]) -> tuple[list[str], list[str]]:
    """Lines of comments at the head, and the rows after them without further comments; a name may begin with a hash sign."""
    lines = list(lines)
    count = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return lines[:count], [line for line in lines[count:] if not line.startswith("# ")]


def _lasting(comments: list[str]) -> list[str]:
    """Lines of a header without date, commit, and the version of gauss, which the commit tells."""
    return [re.sub(OWN_VERSION, "", line) for line in comments[1:] if not line.startswith(COMMIT)]


def _text(value) -> str:
    """A number in six digits; of words, what can be printed in one line: solvers and names of files hold anything."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return "".join(c if c.isprintable() else " " for c in str(value).removeprefix("# "))[:200]


def _values(row: dict) -> dict:
    return {column: text if column in TEXTS else _value(text) for column, text in row.items()}


def _value(text: str):
    if text in ("True", "False"):
        return text == "True"
    try:
        return float(text)
    except ValueError:
        return text


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
