"""What a GPU needs for an evaluation and a step: operations, memory, registers. An estimate without a GPU, no measurement.

Run it with:

    python -m benchmarks.gpu_estimate

Operations of a traced function are counted in its graph: a multiply–add as two, a sine or cosine as 25 (half of the pair by
its polynomials), a division or square root as 10. Bytes are those that a thread reads and writes in arrays; a step keeps its
state in the frame of its thread. Frame and spills [bytes] are those that ptxas finds for compute capability 9.0, where it is
installed (nvidia-cuda-nvcc-cu12). The bounds are those of an H100 as its maker states them, 34 Tflop/s in double precision
without tensor cores and 3.35 TB/s: no code gets beyond them, and none reaches them. Traffic of frames and spills, of which
caches hold an unknown part, is not in them. Writes benchmarks/results/gpu_estimate.csv and .md.
"""

import re
import subprocess
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import gauss
from benchmarks.command import Options, command
from benchmarks.latency.scenes import FEET, biped
from gauss.bench.machine import header
from gauss.bench.markdown import head, table
from gauss.codegen.gpu import devices
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.codegen.gpu.ptx import ptx
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.simulation.batch.machine_code import STEPPED, fixed_step_code
from gauss.simulation.compiled_steps.loop_functions import fixed
from models.families import n_four_bar

SCENES: dict[str, Callable[[], gauss.Scene]] = {
    "Panda": lambda: gauss.load("robot:panda"),
    "Talos, fixed base": lambda: gauss.load("robot:talos"),
    "four-bar": lambda: gauss.load("four_bar"),
    "Bricard linkage": lambda: gauss.load("bricard"),
    "ladder of 10 four-bars": lambda: n_four_bar(10),
    "biped, both feet fixed": lambda: biped(FEET),
}
WEIGHTS = {"sin": 25, "cos": 25, "div": 10, "sqrt": 10, "exp": 30, "log": 30, "atan2": 60, "call": 0, "item": 0}
PEAK, BANDWIDTH, CAPABILITY = 34e12, 3.35e12, 90
TITLES = (
    *("scene", "work", "operations", "bytes", "registers", "frame", "spills", "lines of PTX", "seconds of ptxas"),
    *("bound by operations", "bound by bandwidth"),
)
FOUND = {
    "registers": r"Used (\d+) registers",
    "frame": r"(\d+) bytes cumulative stack",
    "spills": r"(\d+) bytes spill (?:stores|loads)",
    "milliseconds": r"Compile time = ([\d.]+) ms",
}


def assembler() -> Path | None:
    """NVIDIA's assembler of PTX, where it is installed."""
    for package in ("nvidia-cuda-nvcc-cu12", "nvidia-cuda-nvcc"):
        try:
            files = metadata.files(package) or []
        except metadata.PackageNotFoundError:
            continue
        for file in files:
            if file.name == "ptxas":
                return Path(str(file.locate()))
    return None


class Assembling(LaneByLane):
    """Device 'lanes' that notes the resources of its code on a GPU."""

    def __init__(self):
        self.found: dict[str, object] = {}

    def lowered(self, code):
        """As of the base."""
        text, ptxas = ptx(code.gpu_text(), CAPABILITY), assembler()
        self.found = {"lines": text.count("\n")}
        if ptxas is not None:
            with TemporaryDirectory() as folder:
                source = Path(folder) / "code.ptx"
                source.write_text(text)
                arguments = [
                    str(ptxas),
                    f"-arch=sm_{CAPABILITY}",
                    "-v",
                    str(source),
                    "-o",
                    str(source.with_suffix(".cubin")),
                ]
                said = subprocess.run(arguments, capture_output=True, text=True, check=True).stderr
            parts = {name: [float(number) for number in re.findall(pattern, said)] for name, pattern in FOUND.items()}
            self.found |= {"registers": max(parts["registers"]), "frame": max(parts["frame"], default=0.0)}
            self.found |= {"spills": sum(parts["spills"]), "seconds": sum(parts["milliseconds"]) / 1e3}
        return super().lowered(code)


def flops(operations: dict[str, int]) -> float:
    """Floating-point operations, of operations by kind."""
    return sum(WEIGHTS.get(op, 1) * count for op, count in operations.items())


def measure() -> tuple[list[dict], list[str]]:
    """Rows of all scenes."""
    rows, recorder = [], Assembling()
    with patch.object(devices, "_device", lambda number: recorder), patch.dict("os.environ", {"GAUSS_CACHE": ""}):
        for name, make in SCENES.items():
            system = gauss.compile_scene(make())
            function: Any = system.function("forward_dynamics", device="lanes")
            one = {"operations": flops(function.rows.operations), "bytes": function.rows.bytes}
            rows.append({"scene": name, "work": "forward dynamics"} | one | recorder.found)
            method = STEPPED["rk4"]
            fixed_step_code(system, method, False, "lanes")
            one = {"operations": flops(fixed(Program(system, Laws(system)), method).step.operations()), "bytes": 0}
            rows.append({"scene": name, "work": "RK4 step"} | one | recorder.found)
    return rows, [*header("llvmlite", "nvidia-cuda-nvcc-cu12"), "an ESTIMATE: no GPU was used"]


def page(rows: list[dict], conditions) -> list[str]:
    """Lines of the page."""
    lines = []
    for row in rows:
        count, size = float(row["operations"]), float(row["bytes"])
        resources = [
            f"{float(row[name]):.0f}" if row.get(name) not in (None, "") else "–"
            for name in ("registers", "frame", "spills")
        ]
        seconds = f"{float(row['seconds']):.1f}" if row.get("seconds") not in (None, "") else "–"
        bounds = f"{PEAK / count:.1e}/s", f"{BANDWIDTH / size:.1e}/s" if size else "–"
        lines.append(
            [
                row["scene"],
                row["work"],
                f"{count:.0f}",
                f"{size:.0f}",
                *resources,
                f"{float(row['lines']):.0f}",
                seconds,
                *bounds,
            ]
        )
    about = __doc__.split("\n\n")[3].replace("\n", " ")
    return [*head("What a GPU needs: an estimate", conditions), about, "", *table(TITLES, lines)]


if __name__ == "__main__":
    OPTIONS: Options = {}
    command("gpu_estimate", __doc__, measure, page, OPTIONS)
