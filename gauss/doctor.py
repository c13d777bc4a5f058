"""State of an installation: environment, processor, machine code, cache, solvers, optional packages."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss.analysis.crosscheck import crosscheck
from gauss.backends import available
from gauss.backends.backend import BACKENDS
from gauss.bench.machine import header
from gauss.codegen import cache_size, file_trust, object_cache, trace, write
from gauss.codegen.cpython_layout import is_known
from gauss.codegen.gpu.batches import DeviceKernel
from gauss.codegen.gpu.cuda_driver import device_names
from gauss.codegen.gpu.devices import device
from gauss.codegen.optimiser import OPTIMISER
from gauss.errors import DeviceError, MissingPackageError
from gauss.io import load
from gauss.simulation import simulate
from gauss.versions import DISTRIBUTION, version_of

CORE = ("numpy", "scipy", "llvmlite", "pin", "qpsolvers", "osqp")
SOLVERS = ("clarabel", "cvxopt", "daqp", "ecos", "highs", "osqp", "piqp", "proxqp", "qpalm", "quadprog", "scs")
EXTRAS = {
    "view": ("matplotlib", "viser"),
    "film": ("imageio-ffmpeg",),
    "results": ("xarray", "h5netcdf", "h5py", "pandas"),
    "sweep": ("zarr", "loky"),
    "cluster": ("distributed",),
    "docs": ("sphinx", "myst-parser", "furo", "sphinx-gallery"),
    "cuda": ("cuda-bindings",),
    "control": ("control",),
    "robots": ("example-robot-data",),
    "mjcf": ("mujoco",),
    "descriptions": ("robot_descriptions",),
    "xacro": ("xacro",),
    "yaml": ("pyyaml",),
    "usd": ("usd-core",),
    "gym": ("gymnasium",),
    "export": ("casadi",),
    "symbolic": ("sympy",),
    "jax": ("jax",),
    "fmi": ("fmpy",),
    "peers": ("scikit-sundae", "mujoco"),
}
CACHED = {"object code": "", "by content": "made", "sources": "sources"}  # kinds of cached files, starts of their names
TOLERANCE = 1e-10  # relative difference of accelerations to Pinocchio's


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    name: str  # what it is
    text: str  # what was found
    remedy: str = ""  # what to do; empty where nothing is to be done
    works: bool = True  # whether gauss runs as it is


def examine() -> list[Finding]:
    """Look at everything; a check that raises is a finding, not an error."""
    checks = {"machine code": _machine_code, "calls": _calls, "cache": _cache, "GPU": _gpu}
    checks |= {"solvers": _solvers, "a motion": _motion}
    return [*_environment(), *(_tried(name, check) for name, check in checks.items()), *_extras()]


def examine_cache(empty: bool = False) -> list[Finding]:
    """Look at the cache of machine code alone.

    Parameters
    ----------
    empty : bool
        Remove its files first.
    """
    place = object_cache.folder()
    findings = []
    if empty and place is not None:
        findings.append(Finding("emptied", f"{cache_size.empty(place)} files removed"))
    sizes = object_cache.file_sizes()
    for kind, prefix in CACHED.items():
        found = [size for name, size in sizes.items() if name.rpartition("-")[0] == prefix]
        findings.append(Finding(kind, f"{len(found)} files, {sum(found) / 1e6:.1f} MB"))
    return [_tried("cache", _cache), *findings]


def _tried(name: str, check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except Exception as error:  # whatever it is, the user wants to see it beside the rest
        return Finding(name, f"fails: {type(error).__name__}: {error}", f"pip install --upgrade {DISTRIBUTION}", False)


def _environment() -> list[Finding]:
    _, machine, packages, *_ = header(*CORE)
    return [Finding("environment", packages), Finding("machine", machine.removeprefix("machine: "))]


def _machine_code() -> Finding:
    began = time.perf_counter()
    kernel = trace(lambda x: x * x[0] + 1.0, 2)
    right = (kernel([3.0, 5.0]) == [10.0, 16.0]).all()
    if not right:
        return Finding("machine code", "compiled code gives wrong numbers", "pip install --upgrade llvmlite", False)
    made = f"compiles and is right, {1e3 * (time.perf_counter() - began):.0f} ms; {OPTIMISER.status()}"
    return Finding("machine code", made, "send this output to the maintainers" if OPTIMISER.failures else "")


def _calls() -> Finding:
    if is_known():
        return Finding("calls", "machine code takes arrays from this Python directly")
    return Finding("calls", "arrays go through ctypes: a call takes about a microsecond more", "use CPython 3.11 to 3.14")


def _cache() -> Finding:
    place = object_cache.folder()
    if place is None:
        return Finding("cache", "machine code is not kept: GAUSS_CACHE is empty", "unset GAUSS_CACHE to keep it")
    kept = object_cache.file_sizes()
    text = f"{place}: {len(kept)} files, {sum(kept.values()) / 1e6:.1f} MB of {cache_size.largest_size() / 1e6:g}"
    nearest = next(folder for folder in (place, *place.parents) if folder.exists())
    if not (nearest.is_dir() and os.access(nearest, os.W_OK)):
        return Finding("cache", f"{text}; cannot be written to", "name another folder in GAUSS_CACHE")
    if place.is_dir() and not file_trust.is_own(place.stat()):
        why, remedy = file_trust.reason_and_remedy(place, place.stat())
        return Finding("cache", f"{text}; not used: {why}", remedy)
    return Finding("cache", text)


def _solvers() -> Finding:
    found = [name for name in available() if name not in BACKENDS]
    missing = [name for name in SOLVERS if name not in found]
    text = f"{len(BACKENDS)} methods of gauss; {len(found)} QP solvers: {', '.join(found)}"
    return Finding("solvers", text, f"for {', '.join(missing)}: pip install 'qpsolvers[NAME]'" if missing else "")


def _gpu() -> Finding:
    try:
        names = device_names()
    except (DeviceError, MissingPackageError) as error:
        return Finding("GPU", f"none: {error}")
    texts = []
    for number, name in enumerate(names):
        own = f"cuda:{number}"
        try:
            found = DeviceKernel(own, write(lambda x: x * x[0] + 1.0, 2))(np.array([[3.0], [5.0]]))
            free = device(own).free_bytes()
        except (DeviceError, MissingPackageError) as error:  # gauss runs on the other devices, and on this CPU
            texts.append(f"{own} {name}: {error}")
            continue
        if (found.ravel() != [10.0, 16.0]).any():
            return Finding("GPU", f"{own} {name}: programs give wrong numbers", "update the driver of NVIDIA", False)
        texts.append(f"{own} {name}: programs run and are right, {free / 1e9:.3g} GB free")
    return Finding("GPU", "; ".join(texts) or "none: the driver of NVIDIA has no device")


def _motion() -> Finding:
    motion = simulate(load("double_pendulum"), 0.1, progress=False)
    compared = crosscheck(motion.system, [motion.state(-1)], tolerance=TOLERANCE)
    if not compared.passed:
        return Finding("a motion", f"differs from Pinocchio:\n{compared}", "send this output to the maintainers", False)
    return Finding("a motion", f"double pendulum, 0.1 s: as Pinocchio within {TOLERANCE:g}")


def _extras() -> list[Finding]:
    findings = []
    for extra, packages in EXTRAS.items():
        versions = {name: version_of(name) for name in packages}
        there = [f"{name} {found}" for name, found in versions.items() if found]
        missing = [name for name, found in versions.items() if not found]
        text = ", ".join(there + [f"{name} not installed" for name in missing])
        findings.append(Finding(f"[{extra}]", text, f"pip install {' '.join(missing)}" if missing else ""))
    return findings
