"""Measure and write: python -m benchmarks.iftomm."""

import argparse
import csv
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import benchmarks.iftomm  # noqa: E402
from benchmarks.iftomm import RESULTS, measure, problems, report  # noqa: E402
from benchmarks.machine import header  # noqa: E402


def main():
    """Measure and write."""
    about = benchmarks.iftomm.__doc__.split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.iftomm", description=about)
    parser.add_argument("--rounds", type=int, default=15, help="interleaved repetitions")
    rounds = parser.parse_args().rounds
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    rows = measure(problems(), rounds)
    lines = header("numpy", "llvmlite")
    lines.append(f"load average when it ended: {', '.join(f'{load:.1f}' for load in os.getloadavg())}")
    with open(RESULTS / "iftomm.csv", "w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}\n" for line in lines)
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    text = report(rows, lines)
    (RESULTS / "iftomm.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
