"""Other engines on a case: each is set up once, then run with settings from coarse to fine."""

import time
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.work_precision.scenes import TimedScene
from gauss.bench.contest import with_time
from gauss.bench.precision import LOST_DISTANCE, REPEATS, TOLERANCES, Attempt, ReferencePositions
from gauss.system import System

STEPS = tuple(4**k for k in range(3, 11))  # parts of the duration
ENGINES = {  # name: (module, package, methods)
    "Pinocchio": ("pinocchio_", "pinocchio", ("DOP853", "LSODA")),
    "MuJoCo": ("mujoco_", "mujoco", ("Euler", "RK4", "implicitfast")),
    "Exudyn": ("exudyn_", "exudyn", ("generalised-α",)),
    "Drake": ("drake_", "pydrake", ("runge_kutta3", "runge_kutta5", "radau3")),
    "heyoka": ("heyoka_", "heyoka", ("Taylor",)),
}
TOO_SLOW = {("Exudyn", 10): "not run: no result within 100 s when it was tried"}  # by engine, and windows of a ladder
BY_TOLERANCE = ("Pinocchio", "Drake", "heyoka")


def attempts(case: TimedScene, system: System, against: ReferencePositions, patience: float, known) -> Iterator[Attempt]:
    """Attempts of all engines that are installed; one line for each that is not, or that cannot have the scene."""
    for engine, (module, package, methods) in ENGINES.items():
        settings = TOLERANCES[::2] if engine in BY_TOLERANCE else [case.duration / n for n in STEPS]
        if all(known(engine, method, settings[0]) for method in methods):
            continue
        began = time.perf_counter()
        if (engine, case.windows) in TOO_SLOW:
            reason = TOO_SLOW[engine, case.windows]
            yield from (Attempt(engine, method, settings[0], reason=reason) for method in methods)
            continue
        try:
            import_module(package)
            run = _prepared(import_module(f"benchmarks.work_precision.{module}"), engine, system)
        except Exception as error:  # whatever another engine says
            reason = "not installed" if isinstance(error, ImportError) else _short(error)
            yield from (Attempt(engine, method, settings[0], reason=reason) for method in methods)
            continue
        made = time.perf_counter() - began
        for method in methods:
            yield from _ladder(engine, method, settings, run, case, against, patience, made)


def _prepared(module, engine: str, system: System):
    """Function (method, setting, duration) → centres of mass, or a function that finds them."""
    if engine == "heyoka":
        kept: dict[float, Any] = {}

        def taylor(method, tolerance, duration):
            if tolerance not in kept:
                kept.clear()
                kept[tolerance] = module.HeyokaTaylor(system, max(tolerance, 1e-15))
            kept[tolerance].move(duration)
            return kept[tolerance].centres  # they are found in Python, which is no part of its time

        taylor("Taylor", TOLERANCES[0], 1e-6)
        return taylor
    model = {"Pinocchio": "PinocchioModel", "MuJoCo": "MujocoModel", "Exudyn": "ExudynModel", "Drake": "DrakeModel"}[engine]
    return getattr(module, model)(system).centres


def _ladder(engine, method, settings, run, case, against, patience, made) -> Iterator[Attempt]:
    for setting in settings:
        try:
            best = np.inf
            if engine == "heyoka":
                run(method, setting, case.duration)  # makes its machine code
            for _ in range(1 + REPEATS):
                found, seconds = with_time(partial(run, method, setting, case.duration), time.perf_counter)
                best = min(best, seconds)
                found = found() if callable(found) else found
                if best > patience / 10:
                    break
        except Exception as error:  # whatever another engine says
            yield Attempt(engine, method, setting, reason=_short(error))
            continue
        off = float(np.abs(found - against.positions).max(initial=0.0)) if found.shape == against.positions.shape else np.inf
        yield Attempt(engine, method, setting, off, best, made, reason="" if off <= LOST_DISTANCE else "lost")
        if best > patience:
            return


def _short(error: Exception) -> str:
    return str(error).split("\n")[0].split(". ")[0].split(": ")[-1][:90] or type(error).__name__
