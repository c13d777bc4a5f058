"""Which systems are compiled: the rule, and the reasons against."""

CLOSING = frozenset({"revolute", "prismatic", "cylindrical", "planar", "fixed"})  # constant subspace along joint axes
MOST_ROWS = 250  # what is written down for the closing rows grows with their number
LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner
LARGEST = 100  # bodies with loops: straight-line code stops paying, compile time goes on


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return system.structure.n_bodies > LARGE and not system.has_closures


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = []
    closing = [system.joints[index] for index in system.structure.closures if index < len(system.joints)]
    reasons += [f"a {joint.pair.kind} joint closes a loop" for joint in closing if joint.pair.kind not in CLOSING]
    closed = {joint.name for joint in closing}
    tied = [c.name for c in system.scene.couplings.values() if closed & {c.driver, c.driven}]
    reasons += [f"coupling {name!r} ties a joint that closes a loop" for name in tied]
    rows = sum(6 - joint.pair.n_v for joint in closing) + len(system.scene.couplings)
    if rows > MOST_ROWS:
        reasons.append(f"more than {MOST_ROWS} rows close loops")
    reasons += [f"{name!r} is a constraint beyond joints and couplings" for name in system.scene.relations]
    if system.has_closures and system.structure.n_bodies > LARGEST:
        reasons.append(f"more than {LARGEST} bodies with loops")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons
