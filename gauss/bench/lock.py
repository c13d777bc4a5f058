"""Versions of all packages that a run could see, so that it can be had again: pip install -r qp.lock."""

from importlib.metadata import distributions
from pathlib import Path


def write_lock(path: Path) -> Path:
    """Write name and version of every installed distribution, as pip reads them."""
    found = {d.metadata["Name"].lower(): f"{d.metadata['Name']}=={d.version}" for d in distributions() if d.metadata["Name"]}
    lines = [line for name, line in sorted(found.items()) if not name.startswith("gauss")]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
