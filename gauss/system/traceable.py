"""Which systems are compiled: the rule, and the reasons against."""

from gauss.system.work import MOST_WORK

LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner
WIDE = 128  # rates of a scene with loops from which on it is not written out as a whole: that takes many seconds
MOST_MEETINGS = 100  # of loops, for each body: where more of them share a branch, calls loop by loop do not pay


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return _n_bodies(system.parts) > LARGE and not system.has_closures


def has_large_loops(system) -> bool:
    """Whether the compiled dynamics of a system are called link by link and loop by loop, instead of being written out."""
    parts = system.parts
    if not any(part.closing for part in parts) or any(part.couplings or part.relations or part.trains for part in parts):
        return False
    if not all(bound.on_coordinates for bound in system.loads):
        return False
    if system.n_v <= WIDE and _closing_work(parts) <= MOST_WORK:
        return False
    return sum(part.meetings for part in parts) <= MOST_MEETINGS * _n_bodies(parts)


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = [f"{name!r} is one-sided" for name in system.scene.contacts]
    reasons += [f"{name!r} holds up to a limit" for name in system.scene.grips]
    reasons += [f"{name!r} loses power" for name in system.scene.losses if name not in system.scene.grips]
    if not system.parts:
        reasons.append("nothing in it can move")
    if not has_large_loops(system) and (work := _closing_work(system.parts)) > MOST_WORK:
        reasons.append(f"its loops share so many links that about {work:.0e} operations would be written down")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons


def _closing_work(parts) -> int:
    return sum(part.closing_work for part in parts)


def _n_bodies(parts) -> int:
    return sum(part.n_bodies for part in parts)
