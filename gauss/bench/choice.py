"""Names that a user chose among those that there are."""

from collections.abc import Iterable

from gauss.errors import BackendError, did_you_mean


def chosen(names: Iterable[str] | None, existing: Iterable[str], what: str) -> tuple[str, ...]:
    """Return the names, or all if none is given.

    Raises
    ------
    BackendError
        If one does not exist.
    """
    existing = tuple(existing)
    for name in names or ():
        if name not in existing:
            raise BackendError(f"no {what} {name!r}. {did_you_mean(name, existing)}")
    return tuple(names) if names else existing
