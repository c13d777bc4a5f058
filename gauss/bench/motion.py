"""``gauss bench motion``: what the tolerance of a backend does to ten seconds of motion.

All backends drive the same integrator with the same steps; a motion is compared with that of the certified recursion, so
that what differs is the error of the solver alone. Solvers have the settings of the comparison, and are believed as they
claim.
"""

import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss.analysis import energy
from gauss.backends import available, make
from gauss.backends.backend import BACKENDS
from gauss.bench.atlas.methods import Believing
from gauss.bench.contestants import backend as contestant
from gauss.bench.levels import LEVELS, OWN
from gauss.bench.markdown import head, table
from gauss.bench.table import Measurement, ResultTable, chosen
from gauss.bench.worker import Workers
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.stabilisation import drift
from gauss.errors import SimulationError
from gauss.integrators import METHODS, Tolerance
from gauss.io import load
from gauss.simulation import Trajectory, simulate
from gauss.simulation.python_run import PythonRun
from gauss.system import System

SCENES = {"double_pendulum": "projection", "four_bar": "baumgarte"}  # and what is done against drift
DURATION, STEP, SAMPLES = 10.0, 0.02, 51  # [s], [s], and how often motions are compared
PURPOSES = ((1e-9, "reference solutions"), (1e-5, "engineering"), (1e-2, "animation"))  # and errors that they bear
DEFAULT_LEVELS = ("low", "high")
MOTION_TIME = 60.0  # [s] that a motion may take by the clock
MOTION = Measurement(
    "motion",
    ("scene", "backend", "level"),
    ("reached", "error", "energy", "gap", "seconds", "words"),
    ("numpy", "scipy", "qpsolvers", "clarabel", "daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "scs"),
)


def drive(scene: str, backend: str, level: str, expected: np.ndarray) -> dict:
    """One motion: how far it came, and how far off it is.

    Parameters
    ----------
    scene, backend, level : str
        Model, solver, accuracy.
    expected : ndarray, shape (k, n_q)
        Motion of the certified recursion.
    """
    system = compile_scene(load(scene))
    method = make(backend) if backend in BACKENDS else contestant(backend, level)
    against = drift(system, SCENES[scene], start := system.initial_state())
    solver, tolerance = Believing(method, against.gains), Tolerance(1.0, 1.0, 1.0)
    run = PythonRun(system, METHODS["rk4"], solver, tolerance, STEP, DURATION, against.projects)
    begin, words = time.perf_counter(), ""
    try:
        motion = run.collect(start, np.linspace(0.0, DURATION, SAMPLES), False)
    except SimulationError as error:
        motion, words = error.trajectory, str(error)
    return _figures(system, motion, expected) | {"seconds": time.perf_counter() - begin, "words": words}


def _figures(system: System, motion: Trajectory, expected: np.ndarray) -> dict:
    found, count = energy(motion), len(motion)
    gaps = [np.abs(position_residual(kinematics(system, motion.state(i)))).max(initial=0.0) for i in range(count)]
    return {
        "reached": float(motion.t[-1]),
        "error": float(np.abs(motion.q - expected[:count]).max()),
        "energy": float(np.abs(found.balance).max() / found.scale),
        "gap": float(max(gaps)),
    }


def compare_motions(
    folder: Path,
    *,
    backends: Iterable[str] | None = None,
    scenes: Iterable[str] | None = None,
    levels: Iterable[str] = DEFAULT_LEVELS,
    fresh: bool = False,
    progress: bool = True,
) -> ResultTable:
    """Drive all motions that are not driven yet, and return the table.

    BackendError if there is no such backend, scene or level.
    """
    backends, scenes = chosen(backends, ("recursion", *_foreign()), "backend"), chosen(scenes, SCENES, "scene")
    levels = chosen(levels, LEVELS, "level")
    table = MOTION.table(folder, fresh)
    cells = _cells(scenes, backends, levels)
    missing = [cell for cell in cells if not table.has(**dict(zip(MOTION.keys, cell, strict=True)))]
    expected: dict[str, np.ndarray] = {}
    with Workers() as workers:
        for scene, backend, level in tqdm(missing, unit="motion", disable=not progress, desc="bench motion"):
            if scene not in expected:
                expected[scene] = _certified(scene).q
            reply = workers[backend].call(drive, scene, backend, level, expected[scene], timeout=MOTION_TIME)
            nothing = {"reached": 0.0, "error": np.nan, "energy": np.nan, "gap": np.nan, "seconds": np.nan}
            row = reply.value or nothing | {"words": f"{reply.outcome}: {reply.reason}"}
            table.add({"scene": scene, "backend": backend, "level": level} | row)
    return table


def _cells(scenes, backends, levels) -> list[tuple[str, str, str]]:
    return [(s, b, level) for s in scenes for b in backends for level in ((OWN,) if b in BACKENDS else levels)]


def _key(row) -> tuple[str, str, str]:
    return row["scene"], row["backend"], row["level"]


def _foreign() -> list[str]:
    return [name for name in available() if name not in BACKENDS]


def _certified(scene: str) -> Trajectory:
    times = np.linspace(0.0, DURATION, SAMPLES)
    return simulate(
        load(scene),
        DURATION,
        integrator="rk4",
        step=STEP,
        backend="recursion",
        stabilisation=SCENES[scene],
        times=times,
        progress=False,
    )


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``motion.md`` beside the table; return what was written."""
    return [MOTION.write_page(folder, path, markdown)]


def markdown(rows, header) -> str:
    """Report as Markdown."""
    text = [
        *head("What the tolerance of a backend does to a motion", header),
        f"{DURATION:g} s by RK4 with steps of {1e3 * STEP:g} ms. Error: largest difference of a coordinate [rad, m] to the",
        "motion with certified accelerations and the same steps, so what the solver alone is to blame for; a chaotic motion",
        "magnifies it. Energy: error of the balance over its scale, that of the integrator included. Residual: largest",
        "of the loop constraints [m, rad]. Baumgarte's method on the four-bar leaves the residual to the solver. QP",
        "solvers have the settings of [the comparison](qp.md), tuned for none, and are believed as they claim.",
        "",
        *_summary(rows),
        *table(["scene", "backend", "level", "reached [s]", "error", "energy", "residual", "good for"], map(_line, rows)),
    ]
    missing = sorted(set(_cells(SCENES, ("recursion", *_foreign()), DEFAULT_LEVELS)) - {_key(row) for row in rows})
    if missing:
        text += ["", "Not measured yet: " + "; ".join(", ".join(cell) for cell in missing) + "."]
    said = [f"* {row['scene']}, {row['backend']}, {row['level']}: {row['words']}" for row in rows if row["words"]]
    return "\n".join([*text, "", *(["What was said on the way:", "", *said] if said else [])]) + "\n"


def _line(row) -> list[str]:
    cells = [f"{row[key]:.0e}" if np.isfinite(row[key]) else "–" for key in ("error", "energy", "gap")]
    return [row["scene"], row["backend"], row["level"], f"{row['reached']:g}", *cells, _purpose(row)]


def _summary(rows) -> list[str]:
    """Lines on the backends that serve a purpose in all measured scenes."""
    limits = [*(limit for limit, _ in PURPOSES), np.inf]
    methods: dict[str, float] = {}
    for row in rows:
        limit = next((limit for limit in limits if row["reached"] >= DURATION and row["error"] <= limit), np.inf)
        name = f"{row['backend']} {row['level']}"
        methods[name] = max(limit, methods.get(name, 0.0))
    lines = ["In every scene that was measured, good for"]
    for limit, purpose in (*PURPOSES, (np.inf, "nothing in one of them")):
        names = ", ".join(name for name, worst in methods.items() if worst == limit)
        said = f" (error up to {limit:g})" if np.isfinite(limit) else ""
        lines.append(f"* {purpose}{said}: {names or 'none'}.")
    return [*lines[:1], "", *lines[1:], ""]


def _purpose(row) -> str:
    if row["reached"] < DURATION:
        return "nothing: it stopped"
    for limit, purpose in PURPOSES:
        if row["error"] <= limit:
            return purpose
    return "nothing: another motion"
