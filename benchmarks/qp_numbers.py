"""Numbers of the comparison of QP solvers in the README, from the tables as they are.

    python -m benchmarks.qp_numbers

Writes the section of ``benchmarks/README.md`` between its marks; measures nothing.
"""

from collections.abc import Iterator
from pathlib import Path

from benchmarks import maros_meszaros, published_form_report
from benchmarks.agreement import agreement
from benchmarks.command import RESULTS
from benchmarks.work_precision.beaten import rewrite
from gauss.bench.class_page import at_main_level, ordered
from gauss.bench.classes import name_of
from gauss.bench.fronts import cells
from gauss.bench.instances import GROUPS
from gauss.bench.levels import LEVELS
from gauss.bench.markdown import table
from gauss.bench.suite import CLASSES, recipes
from gauss.bench.suite_instances import SUITE
from gauss.bench.summary import asked, is_broken, is_right
from gauss.bench.table import header_of, read_table

BEGIN = "<!-- from the tables of results, by python -m benchmarks.qp_numbers -->"
END = "<!-- end of what is made from the tables of results -->"


def main():
    """Write the section."""
    rewrite(Path(__file__).parent / "README.md", section(), BEGIN, END)


def section() -> str:
    """The section, its marks included."""
    lines = [*_suite(), *_published(), *_by_qpbenchmark(), *_claims(), *_lies(), "", *_classes()]
    return "\n".join([BEGIN, "", *lines, "", END])


def _suite() -> Iterator[str]:
    count = sum(len(recipes(kind)) for kind in CLASSES)
    yield f"* The suite has {count} instances in {len(CLASSES)} classes."


def _published() -> Iterator[str]:
    """Agreement with what is published of Maros and Mészáros's problems, level by level."""
    path = RESULTS / "maros_meszaros.csv"
    pairs, form = maros_meszaros.read_pairs(path), read_table(maros_meszaros.FORM)
    for level in maros_meszaros.SETTINGS:
        here = [(ours["backend"], ours["kept"], theirs["kept"]) for ours, theirs in pairs if ours["level"] == level]
        words = [_words("bounds as rows", here)]
        for side in ("now", "then"):
            rows = [(row["solver"], row[side], row["published"]) for row in form if row["level"] == level]
            words.append(_words(f"published form, {published_form_report.SIDES[side]}", rows))
        asked_for = (
            {ours["problem"] for ours, _ in pairs} if here else {row["problem"] for row in form if row["level"] == level}
        )
        yield f"* Maros and Mészáros, {len(asked_for)} problems, level {level}: verdicts as published, and Kendall's τ of"
        yield f"  rankings by share of problems solved: {'; '.join(filter(None, words))}."


def _words(what: str, verdicts: list[tuple[str, bool, bool]]) -> str:
    """Equal verdicts and τ; "" where there is none."""
    found = agreement(verdicts)
    return f"{what} {found.same} of {found.count}, τ = {found.tau:.2f}" if found.count else ""


def _by_qpbenchmark() -> Iterator[str]:
    rows = maros_meszaros.read_pairs(RESULTS / "qpbenchmark.csv")
    found = {level: [ours["kept"] == theirs["kept"] for ours, theirs in rows if ours["level"] == level] for level in LEVELS}
    words = "; ".join(f"level {level} {sum(same)} of {len(same)}" for level, same in found.items() if same)
    yield f"* qpbenchmark itself on `benchmarks/qp`, the same verdicts: {words}."


def _claims() -> Iterator[str]:
    """Claims beyond what is promised, on the page of the mechanisms."""
    rows = [row for row in asked(read_table(RESULTS / "qp.csv")) if row["claimed"]]
    found = {level: [is_broken(row) for row in rows if row["level"] == level] for level in LEVELS}
    words = "; ".join(f"level {level} {sum(broken)} of {len(broken)}" for level, broken in found.items() if broken)
    yield f"* Claims beyond what a solver promises, [qp.md](results/qp.md): {words}."


def _lies() -> Iterator[str]:
    path = RESULTS / "liars.csv"
    yield f"* [Lies](results/liars.md) to the certificate: {header_of(path)[-1]}; none certified beyond what is right."


def _classes() -> list[str]:
    """The first of each class, at level high, of the solvers that take all of its problems."""
    body = []
    for kind in (*GROUPS, *SUITE):
        path = RESULTS / f"{name_of(kind)}.csv"
        if not path.exists():
            continue
        found = ordered(cells(at_main_level(asked(read_table(path)))))
        words = [f"{name} {sum(map(is_right, rows))}/{len(rows)}" for name, rows in list(found.items())[:3]]
        body.append([f"[{kind}](results/{path.stem}.md)", *words, *[""] * (3 - len(words))])
    return table(["class", "first", "second", "third"], body)


if __name__ == "__main__":
    main()
