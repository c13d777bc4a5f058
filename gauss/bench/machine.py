"""The header that every result carries: when, on what machine, with which versions."""

import os
import platform
from datetime import date

from gauss.versions import version_of


def header(*packages: str) -> list[str]:
    """Lines of the header."""
    versions = [f"{name} {version_of(name, 'not installed')}" for name in packages]
    lines = [
        f"date: {date.today().isoformat()}",
        f"machine: {_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}",
        f"python {platform.python_version()}; " + ", ".join(versions),
    ]
    return lines


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as info:
            return next(line.split(":", 1)[1].strip() for line in info if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"
