"""Ten thousand lies to the certificate: answers that are wrong in accelerations, multipliers, claims or shapes.

Right answers of seven problems (a tree, loops with and without redundant rows, a coupled chain, boxes on their feet,
stops) are made wrong in a part or as a whole, by 1e-12 to 10 times their size, and said with a claim and a message that
mean nothing. Each is counted by what became of it. None may be certified beyond what is right, in accelerations or
multipliers, and none may raise: an assertion ends the run. The lies are those of ``tests/validation/test_liars.py``, which
tells two hundred of them in the test suite, and besides answers of other shapes and types, exceptions, and writing to what
is given.
"""

from collections import Counter

from benchmarks.command import command
from gauss.bench.contest import with_time
from gauss.bench.machine import header
from gauss.bench.markdown import head, table
from tests.validation.test_liars import made, outcomes

COUNT = {"count": (10_000, "lies"), "seed": (1, "another seed, other lies")}


def measure(count: int, seed: int) -> tuple[list[dict], list[str]]:
    """Tell lies; rows of kinds, problems and outcomes with their numbers."""
    found, seconds = with_time(lambda: outcomes(made(), count, seed))
    rows = [dict(zip(("lie", "problem", "outcome"), key, strict=True)) | {"count": n} for key, n in sorted(found.items())]
    return rows, [*header("numpy", "scipy"), f"{count} lies, seed {seed}, {seconds:.0f} s of CPU time"]


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """The page: outcomes of each kind of lie."""
    became = sorted({row["outcome"] for row in rows})
    count: Counter = Counter()
    for row in rows:
        count[row["lie"], row["outcome"]] += int(row["count"])
    kinds = dict.fromkeys(row["lie"] for row in rows)
    body = [[kind, *(count[kind, one] for one in became)] for kind in kinds]
    whole = ["all", *(sum(count[kind, one] for kind in kinds) for one in became)]
    return [
        *head("Lies to the certificate", conditions),
        *__doc__.strip().split("\n\n")[1].splitlines(),
        "",
        *table(["lie", *became], [*body, whole]),
        "",
    ]


if __name__ == "__main__":
    command("liars", __doc__, measure, page, COUNT)
