"""Page and chart of the first answers."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from benchmarks.latency.child import PARTS  # noqa: E402
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
SHARES = [part for part in PARTS if part not in ("import", "read")] + ["rest"]


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
    return [*head("First answers", conditions), *text, "", *table(titles, lines), *scales, ""]


def least(rows: list[dict]) -> dict[tuple, dict]:
    """Quickest round of each scene, answer and cache state."""
    best: dict[tuple, dict] = {}
    for row in rows:
        key = (row["scene"], row["answer"], row["cache"])
        if key not in best or row["first"] != "" and (best[key]["first"] == "" or row["first"] < best[key]["first"]):
            best[key] = row
    return best


def chart(folder: Path):
    """Bars of the first motions, cold by parts and warm, as latency.png."""
    path = folder / "latency.csv"
    best, conditions = least(read_table(path)), header_of(path)
    names = [scene for scene, answer, cache in best if (answer, cache) == ("motion", "cold")]
    names = [name for name in names if all(best[name, "motion", cache]["first"] != "" for cache in ("cold", "warm"))]
    names.sort(key=lambda name: best[name, "motion", "cold"]["first"])
    figure, axes = plt.subplots(figsize=(8, 0.6 + 0.17 * len(names)), layout="constrained")
    left = [0.0] * len(names)
    for part in SHARES:
        widths = [best[name, "motion", "cold"][part] for name in names]
        axes.barh(names, widths, left=left, label=f"cold: {part}", height=0.7)
        left = [a + b for a, b in zip(left, widths, strict=True)]
    axes.plot([best[name, "motion", "warm"]["first"] for name in names], names, "k|", markersize=8, label="warm")
    axes.plot([best[name, "motion", "warm"]["later"] for name in names], names, "k.", markersize=3, label="later")
    axes.set(xscale="symlog", xlabel="CPU time to the first motion of 0.2 s [s]", xlim=(0.0, None))
    axes.set_xscale("symlog", linthresh=0.1)
    axes.tick_params(axis="y", labelsize=6)
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
