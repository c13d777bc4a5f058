"""Where another engine is faster than every method of gauss: a table by decades, in the report and in the README."""

from pathlib import Path

from gauss.bench.markdown import table
from gauss.bench.precision import Attempt

DECADES = tuple(10.0**-k for k in range(3, 12))  # m
# Profile of the scene where heyoka is ahead in most cells (double pendulum, 3 s; busy machine, both in one run).
WHY = """\
Of the double pendulum, at a tolerance of 1e-6, heyoka makes 147 steps of order 8 at 0.29 µs, gauss 55 of order 15 at 0.8 µs.
A step costs both 0.044 µs for each order, heyoka almost nothing else, gauss 0.15–0.2 µs: 0.08 µs to choose the step from six
terms (heyoka: two, which vanish together in symmetric motions), the rest for the checks of the accelerations, the energy and
the constraints, which heyoka does not make. The slider-crank is also projected onto its constraints."""
BEGIN = "<!-- from results/work_precision.csv, by python -m benchmarks.work_precision -->"
END = "<!-- end of what is made from results/work_precision.csv -->"


def best(found, level: float, ours: bool) -> Attempt | None:
    """Quickest attempt with at most this error, by gauss or by others."""
    good = [one for one in found if not one.failed and one.error <= level and (one.engine == "gauss") == ours]
    return min(good, key=lambda one: one.seconds, default=None)


def beaten(scenes: dict[str, list[Attempt]]) -> list[str]:
    """Lines of a table of winners and ratios, of the scenes and errors where the quickest attempt is not by gauss."""
    rows = {scene: [_winner(found, level) for level in DECADES] for scene, found in scenes.items()}
    rows = {scene: cells for scene, cells in rows.items() if any(cells)}
    count = f"{sum(bool(cell) for cells in rows.values() for cell in cells)} of {len(scenes) * len(DECADES)} cells"
    if not rows:
        return [f"Nowhere at these errors: {count}."]
    return [
        f"{count}: the winner, and how many times as fast as the quickest method of gauss it is.",
        "",
        *table(["scene", *(f"{level:.0e} m" for level in DECADES)], ([scene, *cells] for scene, cells in rows.items())),
    ]


def _winner(found: list[Attempt], level: float) -> str:
    """Who is faster than gauss, and by how much; empty where nobody is."""
    ours, theirs = best(found, level, True), best(found, level, False)
    if theirs is None or (ours is not None and ours.seconds <= theirs.seconds):
        return ""
    ratio = f"{ours.seconds / theirs.seconds:.3g} ×" if ours is not None else "gauss does not reach it"
    return f"{theirs.engine} {theirs.method}, {ratio}"


def section(scenes: dict[str, list[Attempt]], header: list[str]) -> str:
    """Section of the README, its marks included."""
    return "\n".join([BEGIN, "", *(f"- {line}" for line in header), "", *beaten(scenes), "", END])


def rewrite(readme: Path, text: str, begin: str = BEGIN, end: str = END):
    """Put a section where its marks are."""
    before, rest = readme.read_text(encoding="utf-8").split(begin)
    readme.write_text(before + text + rest.split(end)[1], encoding="utf-8")
