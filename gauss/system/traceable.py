"""Which systems are compiled: the rule, and the reasons against."""

from gauss.system.passes import CLOSING

MOST_ROWS = 250  # what is written down for the closing rows grows with their number
LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner
LARGEST = 100  # bodies with loops: straight-line code stops paying, compile time goes on


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return _n_bodies(system.parts) > LARGE and not system.has_closures


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = [reason for part in system.parts for reason in part_obstacles(part)]
    reasons += [f"{name!r} is a constraint beyond joints and couplings" for name in system.scene.relations]
    if not system.parts:
        reasons.append("nothing in it can move")
    if system.has_closures and _n_bodies(system.parts) > LARGEST:
        reasons.append(f"more than {LARGEST} bodies with loops")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons


def part_obstacles(part) -> list[str]:
    """Reasons why the forward dynamics of a part are not written down."""
    closing = [part.joints[index] for index in part.closing]
    reasons = [f"a {joint.pair.kind} joint closes a loop" for joint in closing if joint.pair.kind not in CLOSING]
    closed = {joint.name for joint in closing}
    tied = [c.name for c in part.couplings if closed & {c.driver, c.driven}]
    reasons += [f"coupling {name!r} ties a joint that closes a loop" for name in tied]
    if part.n_closing_rows > MOST_ROWS:
        reasons.append(f"more than {MOST_ROWS} rows close loops")
    return reasons


def _n_bodies(parts) -> int:
    return sum(part.n_bodies for part in parts)
