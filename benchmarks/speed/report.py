"""What was measured, as raw rounds, as a table and as a chart."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from benchmarks.speed.dynamics import DGEMM, SMALLER  # noqa: E402
from benchmarks.speed.large_loops import TENTH  # noqa: E402
from gauss.bench import markdown  # noqa: E402
from gauss.bench.contest import OURS, Timings  # noqa: E402
from gauss.bench.markdown import in_time, when_and_where  # noqa: E402
from gauss.bench.table import write_table  # noqa: E402

AGREEMENT = 1e-12  # relative difference to Pinocchio that every row must keep
UNITS = {DGEMM: lambda s: f"{1e-9 / s:.1f} Gflop/s"}
MET_GREY, MISSED_GREY = "0.35", "0.75"  # greys of the bars


def lines(measured: list[Timings]) -> list[dict]:
    """One row for each goal."""
    rows = []
    for contest in measured:
        for goal in contest.contest.goals:
            ratio, low, high = contest.ratio(goal.peer)
            rows.append(
                {
                    "work": contest.contest.work,
                    "peer": goal.peer,
                    "gauss": _time(contest, OURS, goal.peer),
                    "theirs": _time(contest, goal.peer, goal.peer),
                    "ratio": ratio,
                    "low": low,
                    "high": high,
                    "goal": goal.ratio,
                    "agreement": contest.contest.agreement,
                    "met": ratio >= goal.ratio and contest.contest.agreement <= AGREEMENT,
                    "remarks": contest.contest.remarks,
                }
            )
    return rows


def table(rows: list[dict]) -> list[str]:
    """Lines of the table."""
    titles = ("work", "gauss", "peer", "its time", "times as fast (quartiles)", "goal", "met", "agreement")
    return markdown.table(titles, map(_cells, rows))


def _cells(row: dict) -> list[str]:
    ratio, low, high, goal = (_ratio(row["peer"], row[key]) for key in ("ratio", "low", "high", "goal"))
    cells = [row["work"], row["gauss"], row["peer"], row["theirs"], f"{ratio} ({low} … {high})", goal]
    return [*cells, "yes" if row["met"] else "**no**", f"{row['agreement']:.0e}"]


def remarks(measured: list[Timings]) -> str:
    """Settings of single rows."""
    return "\n".join(f"* {m.contest.work}: {m.contest.remarks}." for m in measured if m.contest.remarks)


def write_rounds(measured: list[Timings], header: list[str], path: Path):
    """Every round of every task."""
    rows = [
        {"work": one.contest.work, "competitor": name, "round": i, "seconds_per_unit": f"{value:.6e}"}
        for one in measured
        for name, seconds in one.seconds.items()
        for i, value in enumerate(seconds)
    ]
    write_table(path, header, rows)


def chart(rows: list[dict], header: list[str], path: Path):
    """Bars of the ratios on a logarithmic scale, with the goals; PNG and SVG."""
    shown = [row for row in rows if row["peer"] not in (DGEMM, SMALLER, TENTH)][::-1]
    figure, axes = plt.subplots(figsize=(11, 0.62 * len(shown) + 1.9), constrained_layout=True)
    for place, row in enumerate(shown):
        colour, hatch = (MET_GREY, "") if row["met"] else (MISSED_GREY, "///")
        axes.barh(place, row["ratio"] - 1, left=1, height=0.55, color=colour, hatch=hatch, edgecolor="black", linewidth=0.6)
        axes.errorbar(row["ratio"], place, xerr=[[row["ratio"] - row["low"]], [row["high"] - row["ratio"]]], color="black")
        axes.plot([row["goal"]] * 2, [place - 0.4, place + 0.4], color="black", linewidth=2.2)
        axes.text(
            max(row["ratio"], row["goal"], row["high"]) * 1.06, place, f"{row['ratio']:.3g} ×", va="center", fontsize=9
        )
    axes.set_yticks(range(len(shown)), [f"{row['work']}\nbeside {row['peer']}" for row in shown], fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(min(0.9, *(row["ratio"] for row in shown)), 1.6 * max(max(row["ratio"], row["goal"]) for row in shown))
    axes.set_xlabel("times as fast as the peer, one core [1]")
    axes.grid(axis="x", which="both", color="0.9")
    axes.set_axisbelow(True)
    handles = [
        plt.Rectangle((0, 0), 1, 1, facecolor=MET_GREY, edgecolor="black"),
        plt.Rectangle((0, 0), 1, 1, facecolor=MISSED_GREY, edgecolor="black", hatch="///"),
        plt.Line2D([], [], color="black", linewidth=2.2),
    ]
    axes.legend(handles, ["goal met", "goal missed", "goal"], loc="lower right", fontsize=9)
    axes.set_title(f"Speed of gauss; {when_and_where(header)}", fontsize=10)
    for ending in ("png", "svg"):
        figure.savefig(path.with_suffix(f".{ending}"), dpi=130)
    plt.close(figure)


def _time(measured: Timings, name: str, peer: str) -> str:
    seconds = measured.median(name)
    return UNITS[peer](seconds) if peer in UNITS else in_time(seconds)


def _ratio(peer: str, value: float) -> str:
    """A ratio as the goals say it: a share of dgemm, a multiple of the time of the smaller scene, or times as fast."""
    if peer == DGEMM:
        return f"{value:.0%}"
    return f"1/{1 / value:.3g}" if peer in (SMALLER, TENTH) else f"{value:.3g}"
