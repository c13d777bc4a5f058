"""Links and joints → crank and Assur groups: in each step a group is split off that the links placed before determine."""

from itertools import combinations

from gauss.errors import LinkageError, did_you_mean
from gauss.linkages.chain import Chain, Dyad, Leg, Triad
from gauss.linkages.elements import Driver, LinkJoint, Load, PlanarLink
from gauss.scene import GROUND

LETTER = {"revolute": "R", "prismatic": "P"}
MOST_SEARCHED = 12  # links: all their subsets are tried


def decompose(
    name: str,
    gravity: complex,
    links: dict[str, PlanarLink],
    joints: dict[str, LinkJoint],
    driver: Driver,
    loads: tuple[Load, ...] = (),
    modes: dict[str, int] | None = None,
    poses: dict[str, tuple] | None = None,
) -> Chain:
    """Crank and groups of a linkage.

    A group is two links with an inner joint and one outer joint each on placed links, else a ternary link on three legs.

    Parameters
    ----------
    name : str
        Name of the linkage.
    gravity : complex
        Acceleration of gravity [m/s²].
    links, joints : dict
        By name; the ground is not among the links.
    driver : Driver
        The crank.
    loads : tuple of Load
        Loads.
    modes : dict
        Inner joint → assembly +1 or −1; +1 where not given.
    poses : dict
        Ternary link → (x, y, angle) near the start of the cycle.

    Raises
    ------
    LinkageError
        If it is not a linkage of one freedom of a crank and such groups; the message gives the reason.
    """
    pivot, crank = _crank(joints, driver, links)
    _check_mobility(name, links, joints)
    modes, poses = dict(modes or {}), dict(poses or {})
    placed, left = {GROUND, crank.name}, dict(joints)
    groups: list[Dyad | Triad] = []
    del left[pivot.name]
    while len(placed) <= len(links):
        _check_not_rigid(left, placed)
        group = _next_dyad(links, left, placed, modes) or _next_triad(links, left, placed, poses)
        if group is None:
            raise LinkageError(_undecomposed(name, links, left, placed))
        groups.append(group)
        placed |= {link.name for link in group.links}
        for used in (*group.inners, *(leg.joint for leg in group.legs)):
            del left[used.name]
    _check_not_rigid(left, placed)
    chain = Chain(name, gravity, driver, pivot, crank, tuple(groups), tuple(loads))
    _check_used(modes, "mode", "joint", chain.mode_joints)
    _check_used(poses, "pose", "ternary link", [triad.ternary.name for triad in chain.triads])
    return chain


def _crank(joints, driver: Driver, links) -> tuple[LinkJoint, PlanarLink]:
    if driver.joint not in joints:
        raise LinkageError(f"the driven joint {driver.joint!r} does not exist. {did_you_mean(driver.joint, joints)}")
    pivot = joints[driver.joint]
    if pivot.kind != "revolute" or pivot.parent != GROUND:
        raise LinkageError(
            f"the driven joint {pivot.name!r} is {pivot.kind} from {pivot.parent!r} to {pivot.child!r}; "
            f"a crank turns on a pin whose parent is {GROUND!r}."
        )
    return pivot, links[pivot.child]


def _check_mobility(name: str, links, joints):
    freedoms = 3 * len(links) - 2 * len(joints)
    if freedoms != 1:
        remedy = "a joint is missing" if freedoms > 1 else "there is a joint too many, or a link is missing"
        raise LinkageError(
            f"{name}: {len(links)} moving links and {len(joints)} joints have 3·{len(links)} − 2·{len(joints)} = {freedoms} "
            f"freedoms; a linkage that one crank drives has 1: {remedy}."
        )


def _check_not_rigid(left, placed):
    for joint in left.values():
        if joint.parent in placed and joint.child in placed:
            raise LinkageError(
                f"joint {joint.name!r} binds {joint.parent!r} and {joint.child!r}, whose motion is already determined by "
                "the joints before it: that part of the linkage is overconstrained, and another part is too loose."
            )


def _legs(links, left, placed) -> dict[str, Leg]:
    """Links with one joint on placed links."""
    legs: dict[str, list[Leg]] = {}
    for joint in left.values():
        for end in (joint.parent, joint.child):
            if end not in placed and joint.other(end) in placed:
                legs.setdefault(end, []).append(Leg(links[end], joint))
    for name, found in legs.items():
        if len(found) > 1:
            at = " and ".join(repr(leg.joint.name) for leg in found)
            raise LinkageError(f"link {name!r} is held by the joints {at} at once: it can only follow one of them.")
    return {name: found[0] for name, found in legs.items()}


def _next_dyad(links, left, placed, modes) -> Dyad | None:
    legs = _legs(links, left, placed)
    for inner in left.values():
        if inner.parent in legs and inner.child in legs:
            i, j = legs[inner.child], legs[inner.parent]
            if i.joint.kind != j.joint.kind and i.joint.kind == "prismatic":
                i, j = j, i
            kind = "".join(LETTER[joint.kind] for joint in (i.joint, inner, j.joint))
            if kind == "PPP":
                raise LinkageError(
                    f"links {i.name!r} and {j.name!r} are held by three slides {i.joint.name!r}, {inner.name!r}, "
                    f"{j.joint.name!r}: none of them can turn, and their positions are not determined. Make one a pin."
                )
            return Dyad(kind, i, j, inner, _mode(modes, inner.name))
    return None


def _mode(modes, joint: str) -> int:
    mode = modes.get(joint, 1)
    if mode not in (1, -1) or isinstance(mode, bool):
        raise LinkageError(f"mode of joint {joint!r}: expected +1 or −1, got {mode!r}.")
    return int(mode)


def _next_triad(links, left, placed, poses) -> Triad | None:
    legs = _legs(links, left, placed)
    for name, link in links.items():
        if name in placed or name in legs:
            continue
        pins = [joint for joint in left.values() if name in (joint.parent, joint.child) and joint.other(name) in legs]
        if len({joint.other(name) for joint in pins}) >= 3:
            _check_ternary(name, pins, poses)
            return Triad(link, tuple(legs[joint.other(name)] for joint in pins), tuple(pins), poses[name])
    return None


def _check_ternary(name: str, pins: list[LinkJoint], poses) -> None:
    """Check the inner joints of a ternary link, and that its pose is given."""
    if any(joint.kind != "revolute" for joint in pins) or len(pins) > 3:
        raise LinkageError(f"link {name!r}: a ternary link of a class III group is joined to three legs by pins.")
    if name not in poses:
        raise LinkageError(
            f"link {name!r} belongs to a class III group, which is placed by Newton's method: give its pose "
            f"(x, y, angle) near the start of the cycle, e.g. linkage.pose({name!r}, (0.6, 0.2, 0.05))."
        )


def _undecomposed(name: str, links, left, placed) -> str:
    """Message with the reason why no group can be split off."""
    waiting = [link for link in links if link not in placed]
    reason = _loose(left, waiting) or _double(left) or _higher_class(left, placed, waiting)
    reason = reason or f"among {', '.join(map(repr, waiting))} no set of links is determined by the joints that it has"
    return (
        f"{name} does not decompose after {', '.join(sorted(placed - {GROUND}))}: {reason}. Another crank may help; "
        "gauss.Scene simulates linkages of any kind without decomposing them."
    )


def _loose(left, waiting: list[str]) -> str:
    """Reason if a link has fewer than two joints."""
    for link in waiting:
        count = sum(link in (joint.parent, joint.child) for joint in left.values())
        if count < 2:
            return f"link {link!r} has only {count} joint and is not determined"
    return ""


def _double(left) -> str:
    """Reason if two links are joined twice."""
    pairs = [(joint.parent, joint.child) for joint in left.values()]
    for pair in pairs:
        if sum(set(pair) == set(other) for other in pairs) > 1:
            return f"the links {pair[0]!r} and {pair[1]!r} are joined twice, which makes them one rigid body"
    return ""


def _higher_class(left, placed, waiting: list[str]) -> str:
    """Reason if links form a group of a higher class."""
    group = _smallest_group(left, placed, waiting)
    return (
        f"the links {', '.join(map(repr, group))} form a group of a higher class than dyads and 6R triads" if group else ""
    )


def _smallest_group(left, placed, waiting) -> tuple[str, ...]:
    """Smallest set of n links determined by its joints, 3 n = 2 · joints; none among too many links to search."""
    for count in range(2, len(waiting) + 1 if len(waiting) <= MOST_SEARCHED else 2, 2):
        for links in combinations(waiting, count):
            inside = placed | set(links)
            joints = [j for j in left.values() if j.parent in inside and j.child in inside]
            if 2 * len(joints) == 3 * count:
                return links
    return ()


def _check_used(given, what: str, of: str, existing):
    for name in given:
        if name not in existing:
            raise LinkageError(f"{what} of {name!r}: no such {of} has a {what}. {did_you_mean(name, existing)}")
