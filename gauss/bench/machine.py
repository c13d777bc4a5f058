"""The header that every result carries: when, on what machine, with which versions; all versions as pip reads them."""

import os
import platform
import subprocess
from datetime import date
from pathlib import Path

import numpy as np

from gauss.codegen.processor import width
from gauss.versions import version_of

GIT_TIME = 10.0  # [s] that git may take


def header(*packages: str) -> list[str]:
    """Lines of the header."""
    versions = [f"{name} {version_of(name) or 'not installed'}" for name in ("gauss", *packages)]
    lines = [
        f"date: {date.today().isoformat()}{_load()}",
        f"machine: {_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, "
        f"vectors of {width()} doubles",
        f"python {platform.python_version()}; " + ", ".join(versions),
    ]
    return [*lines, *_commit()]


def libraries() -> str:
    """Line that names the BLAS of numpy, the threads that workers may use, and the precision of JAX."""
    blas = np.show_config(mode="dicts").get("Build Dependencies", {}).get("blas", {})
    named = f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip()
    return f"BLAS of numpy: {named}; one thread each; JAX in double precision"


def _load() -> str:
    """Load of the machine when the measurement starts: single times on a shared one are no records."""
    return f", load average {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""


def _commit() -> list[str]:
    """Line of the commit, and whether files differ from it, where the package is in a checkout of its repository."""
    folder = Path(__file__).resolve().parents[2]
    if not (folder / ".git").exists():
        return []
    ask = ["git", "-C", str(folder)]
    try:
        name, changed = (
            subprocess.run([*ask, *words], capture_output=True, text=True, check=True, timeout=GIT_TIME).stdout.strip()
            for words in (("rev-parse", "--short=12", "HEAD"), ("status", "--porcelain", "--untracked-files=no", "gauss"))
        )
    except (OSError, subprocess.SubprocessError):
        return []
    return [f"commit: {name}{', with changes' if changed else ''}"]


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as info:
            return next(line.split(":", 1)[1].strip() for line in info if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"


def write_lock(path: Path) -> Path:
    """Write name and version of every installed distribution, as pip reads them."""
    from importlib.metadata import distributions  # takes long to import

    found = {d.metadata["Name"].lower(): f"{d.metadata['Name']}=={d.version}" for d in distributions() if d.metadata["Name"]}
    lines = [line for name, line in sorted(found.items()) if not name.startswith("gauss")]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
