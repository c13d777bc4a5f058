"""Which systems are compiled: the rule, and the reasons against."""

from gauss.system.work import MOST_WORK

LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return _n_bodies(system.parts) > LARGE and not system.has_closures


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = [f"{name!r} is one-sided" for name in system.scene.contacts]
    reasons += [f"{name!r} holds up to a limit" for name in system.scene.grips]
    reasons += [f"{name!r} loses power" for name in system.scene.losses if name not in system.scene.grips]
    if not system.parts:
        reasons.append("nothing in it can move")
    work = sum(part.closing_work for part in system.parts)
    if work > MOST_WORK:
        reasons.append(f"its loops share so many links that about {work:.0e} operations would be written down")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons


def _n_bodies(parts) -> int:
    return sum(part.n_bodies for part in parts)
