"""Versions of this package and of those it works with.

The import is ``gauss``; the distribution has another name, for ``gauss`` on the package index is a project of somebody else.
"""

VERSION = "0.1.0"
DISTRIBUTION = "gauss-dynamics"


def version_of(package: str, missing: str | None = None) -> str | None:
    """Version of an installed distribution, or of this package as it was imported; ``missing`` where there is none."""
    from importlib.metadata import PackageNotFoundError, version  # takes long to import

    try:
        return VERSION if package == "gauss" else version(package)
    except PackageNotFoundError:
        return missing
