"""Which systems are compiled: the rule, and the reasons against."""

MOST_ROWS = 250  # what is written down for the closing rows grows with their number
LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner
LARGEST = 100  # bodies with loops: straight-line code stops paying, compile time goes on


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return _n_bodies(system.parts) > LARGE and not system.has_closures


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    rows = sum(part.n_closing_rows for part in system.parts)
    reasons = [f"more than {MOST_ROWS} rows close loops"] if rows > MOST_ROWS else []
    reasons += [f"{name!r} is one-sided" for name in system.scene.contacts]
    reasons += [f"{name!r} holds up to a limit" for name in system.scene.grips]
    if not system.parts:
        reasons.append("nothing in it can move")
    if system.has_closures and _n_bodies(system.parts) > LARGEST:
        reasons.append(f"more than {LARGEST} bodies with loops")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons


def _n_bodies(parts) -> int:
    return sum(part.n_bodies for part in parts)
