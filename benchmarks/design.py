"""From simulation to design: linear models, gradients of motions, identification and exported code of a Panda, timed.

Run it with:

    python -m benchmarks.design [--rounds 5]

Each line is measured beside what it is compared with, in turn; the least time of the rounds is kept, for others use the
machine as well, and processor time is measured. The motion of the gradient has 100 steps of "rk4" in 1 s, under nine inputs
held in each.
"""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import gauss
from benchmarks.command import command, load_at_the_end
from gauss import export
from gauss.bench.contest import Competitor, interleaved, repeated
from gauss.bench.machine import header
from gauss.bench.markdown import head, table
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from models import families

DURATION, STEPS = 1.0, 100
SAMPLES = 10_000


def panda(inputs: bool = False) -> gauss.Scene:
    """A Panda with its two fingers: nine freedoms; with an input on each."""
    scene = gauss.load("robot:panda", mimic=False)
    for joint in [name for name, one in scene.joints.items() if one.pair.n_v] if inputs else []:
        scene.input(f"u of {joint}", joint)
    return scene


def least(rounds: int, *calls: Callable, repeats: int = 1) -> list[float]:
    """Least processor time of each call [s], taken in turn."""
    found = interleaved({k: Competitor(repeated(call, repeats), repeats) for k, call in enumerate(calls)}, rounds)
    return [min(found[k]) for k in range(len(calls))]


MODELS = [
    ("Panda", lambda: panda(inputs=True)),
    ("four-bar", lambda: gauss.load("four_bar")),
    ("slider-crank", lambda: gauss.load("slider_crank")),
    ("flyball governor", families.flyball_governor),
]


def linear_models(rounds: int) -> list[dict]:
    """A and B of a tree are the derivatives of its accelerations."""
    system = gauss.compile_scene(panda())
    rng = np.random.default_rng(0)
    q, v, load = (rng.normal(size=system.n_v) for _ in range(3))
    state = system.state(q, v)
    calls = (
        lambda: system.acceleration_derivatives(q, v, load),
        lambda: gauss.linearise(system, state, inputs=[], load=load),
    )
    for call in calls:
        call()
    slopes, whole = least(rounds, calls[0], repeats=200)[0], least(rounds, calls[1])[0]
    return [
        *[_row(f"A, B, C, D of a state, prepared: {name}", prepared(rounds, scene), "s", 20e-6) for name, scene in MODELS],
        _row("derivatives of the accelerations alone (System.acceleration_derivatives)", slopes, "s", None),
        _row("gauss.linearise with names and checks", whole, "s", None),
    ]


def prepared(rounds: int, scene: Callable[[], gauss.Scene]) -> float:
    """Least time [s] of a model that :func:`gauss.prepare_linear_model` has prepared."""
    model = gauss.prepare_linear_model(scene())
    start = model.system.initial_state()
    call = lambda: model(start.q, start.v)  # noqa: E731
    call()
    return least(rounds, call, repeats=200)[0]


def gradients(rounds: int) -> list[dict]:
    """Gradient of a motion by 900 inputs, and the motion."""
    from gauss.analysis.sensitivity.differentiable import DifferentiableMotion

    system = gauss.compile_scene(panda(inputs=True))
    motion = DifferentiableMotion(system, DURATION, DURATION / STEPS)
    start = system.initial_state()
    inputs = np.random.default_rng(0).normal(size=(STEPS, len(system.scene.inputs)))
    weights = np.zeros((STEPS + 1, system.n_q + system.n_v))
    weights[-1] = 1.0
    value = lambda: motion.value(start.q, start.v, inputs)  # noqa: E731
    pullback = lambda: motion.pullback(start.q, start.v, inputs, weights)  # noqa: E731
    value(), pullback()
    alone, both = least(rounds, value, pullback)
    return [
        _row("motion of 1 s, 100 steps", alone, "s", None),
        _row("the motion and its gradient by 9 × 100 inputs", both, "s", None),
        _row("gradient / motion", both / alone, "", 5.0),
    ]


def identification(rounds: int) -> list[dict]:
    """Identification from samples of random states."""
    system = gauss.compile_scene(panda())
    rng = np.random.default_rng(0)
    q, v, a = (rng.normal(size=(SAMPLES, system.n_v)) for _ in range(3))
    forces = system.inverse_dynamics(q, v, a) + 0.1 * rng.standard_normal(v.shape)
    call = lambda: gauss.identify(system, q, v, a, forces, consistent=False)  # noqa: E731
    call()
    return [_row(f"identification from {SAMPLES} samples", least(rounds, call)[0], "s", 1.0)]


def exported(rounds: int) -> list[dict]:
    """Export to C, and the exported function beside ours."""
    system = gauss.compile_scene(panda())
    export.to_c(system)
    rows = [_row("export of five functions to C", least(rounds, lambda: export.to_c(system))[0], "s", 1.0)]
    if shutil.which("cc") is None:
        return rows
    with tempfile.TemporaryDirectory() as folder:
        _, source = export.to_c(system, "forward_dynamics", "panda").save(folder)
        library = Path(folder) / "panda.so"
        flags = ["-std=c99", "-O3", "-march=native", "-fPIC", "-shared"]
        subprocess.run(["cc", *flags, str(source), "-o", str(library), "-lm"], check=True)
        theirs = ctypes.CDLL(str(library)).panda_forward_dynamics_batch
    n, rng = 20_000, np.random.default_rng(0)
    q, v, load = (rng.normal(size=(n, system.n_v)) for _ in range(3))
    t, result = np.zeros(n), np.empty((n, system.n_v))
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (q, v, load, t, result)]
    c_code = lambda: theirs(ctypes.c_size_t(n), *pointers)  # noqa: E731
    scalar = Program(system, Laws(system)).forward()
    columns = np.concatenate([np.zeros((1, n)), q.T, v.T, load.T])
    one = lambda: [system.forward_dynamics(*row) for row in zip(q[:2000], v[:2000], load[:2000], strict=True)]  # noqa: E731
    batch = lambda: system.forward_dynamics(q, v, load)  # noqa: E731
    alone = lambda: scalar(columns)  # noqa: E731
    c_code(), one(), batch(), alone()
    ours, theirs_time, calls, single = least(rounds, batch, c_code, one, alone)
    assert np.allclose(result, batch(), rtol=1e-9, atol=1e-9)
    return [
        *rows,
        _row("forward dynamics by the C code, a state", theirs_time / n, "s", None),
        _row("forward dynamics by our machine code, a state", single / n, "s", None),
        _row("C code / our machine code", theirs_time / single, "", 1.3),
        _row("forward dynamics by our machine code, a state of a batch in SIMD lanes", ours / n, "s", None),
        _row("forward dynamics by our machine code, a call from Python", calls / 2000, "s", None),
    ]


def _row(line: str, value: float, unit: str, goal: float | None) -> dict:
    return {"line": line, "value": value, "unit": unit, "goal": "" if goal is None else goal}


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """All lines, with the conditions."""
    conditions = header("numpy")
    rows = [row for part in (linear_models, gradients, identification, exported) for row in part(rounds)]
    return rows, [*conditions, load_at_the_end()]


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """The table as a page."""
    lines = []
    for row in rows:
        value = float(row["value"])
        shown = f"{value * 1e6:.3g} µs" if row["unit"] and value < 1e-3 else f"{value:.3g} {row['unit']}".strip()
        goal = "" if row["goal"] in ("", None) else f"≤ {float(row['goal']):g} {row['unit']}".strip()
        lines.append((row["line"], shown, goal))
    return [*head("From simulation to design", conditions), *table(("Panda", "measured", "goal"), lines), ""]


if __name__ == "__main__":
    command("design", __doc__, measure, page, {"rounds": (5, "interleaved repetitions")})
