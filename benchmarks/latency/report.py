"""Page and chart of the first answers."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from benchmarks.latency.child import BEFORE, PARTS  # noqa: E402
from gauss.bench.markdown import head, table, when_and_where  # noqa: E402
from gauss.bench.table import header_of, read_table  # noqa: E402

WARM_LIMIT = 0.08  # s
COLD_LIMITS = {  # what the first motion may take with an empty cache [s]
    "four_bar": 0.15,
    "robot:panda": 0.3,
    "robot:talos": 0.8,
    "robot:anymal": 0.5,
    "ladder of 10": 0.5,
    "delta robot": 1.0,
    "Stewart platform": 1.0,
    "tree of 40 hinges": 1.0,
    "ladder of 40": 2.0,
    "biped, both feet fixed": 1.0,
}
SERIES = (  # of the chart: label, state of the cache, figure, marker
    ("cold", "cold", "first", "C0o"),
    ("warm", "warm", "first", "C1o"),
    ("later in the same process", "warm", "later", "C2o"),
)
SHARES = [part for part in PARTS if part not in BEFORE] + ["rest"]


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the table."""
    best = least(rows)
    cases = list(dict.fromkeys((row["scene"], row["answer"]) for row in rows if row["answer"] != "process"))
    titles = ["scene", "answer", "rates", "cold", "at most", *SHARES, "warm", "later", "import", "read"]
    lines = [_cells(scene, answer, best) for scene, answer in cases]
    scale = [[name, _s(row["first"])] for (name, answer, _), row in best.items() if answer == "process"]
    text = [
        "CPU time of the main thread of a fresh process from a scene to its answer: cold with an empty cache of machine",
        "code, warm with optimised code in it; later is another call in the warm process. The parts are those of cold;",
        f"imports and reading of the scene are in neither. Warm goal: {WARM_LIMIT} s everywhere. The least of the rounds.",
    ]
    scales = ["", "CPU time of whole processes:", "", *table(["process", "whole"], scale)] if scale else []
    picture = ["", "![CPU time of first and later motions of all scenes](latency.png)"]
    return [*head("First answers", conditions), *text, *picture, "", *table(titles, lines), *scales, ""]


def least(rows: list[dict]) -> dict[tuple, dict]:
    """Quickest round of each scene, answer and cache state."""
    best: dict[tuple, dict] = {}
    for row in rows:
        key = (row["scene"], row["answer"], row["cache"])
        if key not in best or row["first"] != "" and (best[key]["first"] == "" or row["first"] < best[key]["first"]):
            best[key] = row
    return best


def chart(folder: Path):
    """First motions, cold and warm, and later ones, as latency.png."""
    path = folder / "latency.csv"
    best, conditions = least(read_table(path)), header_of(path)
    names = [scene for scene, answer, cache in best if (answer, cache) == ("motion", "cold")]
    names = [name for name in names if all(best[name, "motion", cache]["first"] != "" for cache in ("cold", "warm"))]
    names.sort(key=lambda name: best[name, "motion", "cold"]["first"])
    figure, axes = plt.subplots(figsize=(8, 1.2 + 0.16 * len(names)), layout="constrained")
    for label, cache, figure_of, style in SERIES:
        axes.plot([best[name, "motion", cache][figure_of] for name in names], names, style, markersize=5, label=label)
    limited = [name for name in names if name in COLD_LIMITS]
    axes.plot([COLD_LIMITS[name] for name in limited], limited, "|", color="0.4", markersize=9, label="cold, at most")
    axes.axvline(WARM_LIMIT, color="0.7", linewidth=0.8, label="warm, at most")
    axes.set(xscale="log", xlabel="CPU time of a motion of 0.2 s [s]")
    axes.grid(axis="x", color="0.9")
    axes.tick_params(axis="y", labelsize=6)
    axes.margins(y=0.01)
    axes.legend(fontsize=7, loc="lower right")
    axes.set_title(when_and_where(conditions), fontsize=8)
    figure.savefig(folder / "latency.png", dpi=150)


def _cells(scene: str, answer: str, best: dict) -> list[str]:
    cold, warm = (best[scene, answer, cache] for cache in ("cold", "warm"))
    if cold["first"] == "":
        return [scene, answer, "", str(cold["failed"]), *[""] * (len(SHARES) + 5)]
    limit = COLD_LIMITS.get(scene, "") if answer == "motion" else 1.0
    parts = [_s(cold[part]) for part in SHARES]
    times = [_s(warm["first"]), f"{1e3 * warm['later']:.2g} ms", _s(warm["import"]), _s(warm["read"])]
    return [scene, answer, f"{cold['rates']:.0f}", _s(cold["first"]), f"{limit} s" if limit else "", *parts, *times]


def _s(seconds) -> str:
    return f"{seconds:.2g} s" if seconds != "" else ""
