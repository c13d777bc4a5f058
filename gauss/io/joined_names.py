"""Several names in one text: with a comma between, or as JSON where a name would be taken apart by that."""

import json
from collections.abc import Sequence

BETWEEN = ", "


def joined(names: Sequence[str]) -> str:
    """One text of several names, which :func:`separated` takes apart again."""
    plain = not any(BETWEEN in name or name.startswith("[") for name in names)
    return BETWEEN.join(names) if plain else json.dumps(list(names), ensure_ascii=False)


def separated(text: str) -> tuple[str, ...]:
    """Names of a text."""
    return tuple(json.loads(text) if text.startswith("[") else text.split(BETWEEN) if text else ())
