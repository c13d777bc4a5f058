"""Contraction of gears: trees of gears make shafts one coordinate; a gear beside the tree is redundant or contradicts it."""

from collections import deque
from contextlib import suppress

import numpy as np

from gauss.errors import SceneError
from gauss.rotors.elements import Torque
from gauss.rotors.laws import Dry
from gauss.rotors.links import GearPair
from gauss.rotors.network import Network
from gauss.rotors.reduced import CYCLE, REST_SPEED, GearBranch, ReducedNetwork

RUN_UP_ANGLE = 0.1  # rad: a network that starts at rest is given the speed it reaches over this angle, as scale
LEAST_TORQUE = 1e-100  # [N m]: the foot of a smooth pulse, exp(-700) of its height, is no scale of a network


def reduce(network: Network) -> ReducedNetwork:
    """Contract gears.

    Raises
    ------
    SceneError
        If there are no shafts, or gears in a cycle contradict each other or lose energy, or speeds at the start do.
    """
    if not network.shafts:
        raise SceneError(f"network {network.name!r} has no shafts; add one by network.shaft(name, inertia).")
    names, links = tuple(network.shafts), tuple(network.links.values())
    index = {name: j for j, name in enumerate(names)}
    driven = np.array([index[link.driven] for link in links], dtype=int)
    driver = np.array([index[link.driver] for link in links], dtype=int)
    group, K = np.full(len(names), -1), np.ones(len(names))
    roots: list[int] = []
    outward: list[GearBranch] = []
    redundant: list[int] = []
    gears = _neighbours(links, driven, driver, len(names))
    for start in range(len(names)):
        if group[start] < 0:
            root = _root(_component(start, gears), network, names, links, gears)
            found = _grow(root, len(roots), links, gears, group, K)
            redundant += _redundant(found, root, links, driven, driver, group, K, names)
            roots.append(root)
            outward += found
    terms = tuple(torque for torque in network.torques.values() if not isinstance(torque.law, Dry))
    speed = _initial_speeds(network, names, group, K, len(roots))
    return ReducedNetwork(
        network, names, links, driven, driver,
        np.array([shaft.inertia for shaft in network.shafts.values()]),
        group, K, tuple(roots), tuple(reversed(outward)), tuple(redundant), terms, _dry_torques(network, index),
        np.array([shaft.angle for shaft in network.shafts.values()]), speed,
        REST_SPEED * (_known_speed(speed, group, K, terms) or _run_up_speed(network, K)),
    )  # fmt: skip


def _dry_torques(network: Network, index: dict[str, int]) -> dict[int, list[Torque]]:
    """Dry friction of shafts."""
    dry: dict[int, list[Torque]] = {}
    for torque in network.torques.values():
        if isinstance(torque.law, Dry):
            dry.setdefault(index[torque.shaft], []).append(torque)
    return dry


def _known_speed(speed, group, K, terms) -> float:
    """Largest initial speed of a shaft or no-load speed of a motor [rad/s]."""
    known = [abs(speed[g] * k) for g, k in zip(group, K, strict=True)]
    return max(known + [abs(torque.law.no_load) for torque in terms if torque.law.no_load is not None])


def _run_up_speed(network: Network, K: np.ndarray) -> float:
    """Speed of all inertias under the largest torque, else the stiffest spring, after a run-up; 1 rad/s without any."""
    stiffest = max((getattr(link, "stiffness", 0.0) for link in network.links.values()), default=0.0)
    torques = [_torque_at_rest(torque) for torque in network.torques.values()]
    largest = max((torque for torque in torques if LEAST_TORQUE < torque < np.inf), default=0.0) or stiffest
    inertia = sum(shaft.inertia * k**2 for shaft, k in zip(network.shafts.values(), K, strict=True))
    return float(np.sqrt(RUN_UP_ANGLE * largest / inertia)) if largest and inertia else 1.0


def _torque_at_rest(torque: Torque) -> float:
    """Absolute value of a torque when its shaft rests [N m]; 0 if its law fails there."""
    with suppress(Exception):  # a law of the user may ask for more than a shaft at rest
        if isinstance(torque.law, Dry):
            return abs(torque.law.value)
        return abs(float(torque.law(torque.begin or 0.0, 0.0, 0.0)))  # type: ignore[arg-type]  # numbers give a number
    return 0.0


def _neighbours(links, driven, driver, count: int) -> list[list]:
    """For each shaft its gears and the shafts at their other ends."""
    found: list[list[tuple[int, int, bool]]] = [[] for _ in range(count)]
    for b, link in enumerate(links):
        if isinstance(link, GearPair):
            found[driver[b]].append((b, int(driven[b]), True))
            found[driven[b]].append((b, int(driver[b]), False))
    return found


def _component(start: int, gears) -> list[int]:
    seen, waiting = {start}, [start]
    while waiting:
        for _, other, _ in gears[waiting.pop()]:
            if other not in seen:
                seen.add(other)
                waiting.append(other)
    return sorted(seen)


def _root(shafts: list[int], network: Network, names, links, gears) -> int:
    """Root of a group: driven by no gear, with a motor if there are several, and driving no self-locking gear backward."""
    motors = {torque.shaft for torque in network.torques.values() if torque.role == "motor"}
    driving = [j for j in shafts if all(outward for _, _, outward in gears[j])]
    locking: list[str] = []
    for root in [*sorted(driving or shafts, key=lambda j: names[j] not in motors), *shafts]:
        locking = _locking(root, links, gears)
        if not locking:
            return root
    at = ", ".join(names[j] for j in shafts)
    raise SceneError(
        f"shafts {at}: the self-locking gear {', '.join(map(repr, locking))} stands between two driving shafts; what it "
        "transmits is not determined: give it a back_efficiency above 0, or join the shafts by a spring or clutch."
    )


def _locking(root: int, links, gears) -> list[str]:
    """Self-locking gears that a root would drive backward."""
    backward = [links[b] for b, _, outward in _walk(root, gears) if not outward]
    return [link.name for link in backward if link.back_efficiency == 0]


def _walk(root: int, gears) -> list[tuple]:
    """Gears of the tree that grows from the root breadth first: (link, child, whether the child is driven)."""
    seen, waiting, tree = {root}, deque([root]), []
    while waiting:
        for b, other, outward in gears[waiting.popleft()]:
            if other not in seen:
                seen.add(other)
                waiting.append(other)
                tree.append((b, other, outward))
    return tree


def _grow(root: int, number: int, links, gears, group, K) -> list[GearBranch]:
    """Branches of the group from the root outward; fills its entries of group and K."""
    group[root], branches = number, []
    for b, child, outward in _walk(root, gears):
        parent = next(other for link, other, _ in gears[child] if link == b)
        rate = links[b].rate if outward else 1.0 / links[b].rate
        group[child], K[child] = number, K[parent] * rate
        branches.append(GearBranch(b, child, parent, rate, outward))
    return branches


def _redundant(branches: list[GearBranch], root: int, links, driven, driver, group, K, names) -> list[int]:
    """Gears beside the tree, which close cycles and are redundant.

    SceneError if the ratios or the losses of a cycle leave its motion or its torques undetermined.
    """
    above = {branch.child: branch for branch in branches}
    inside = {branch.link for branch in branches}
    gears = [b for b, link in enumerate(links) if isinstance(link, GearPair) and group[driver[b]] == group[root]]
    closing = [b for b in gears if b not in inside]
    for b in closing:
        cycle = _cycle(b, int(driven[b]), int(driver[b]), above)
        shafts = np.array([(driver[c], driven[c]) for c in cycle]).ravel()
        where = ", ".join(dict.fromkeys(names[j] for j in shafts))
        _check_cycle([links[c] for c in cycle], where, K[driven[b]], links[b].rate * K[driver[b]])
    return closing


def _cycle(gear: int, one: int, other: int, above: dict[int, GearBranch]) -> list[int]:
    """Gears of the cycle that a gear between two shafts closes."""
    paths = [{branch.link for branch in _path(shaft, above)} for shaft in (one, other)]
    return [gear, *paths[0] ^ paths[1]]


def _check_cycle(gears: list[GearPair], shafts: str, rate: float, by_gear: float) -> None:
    """Check a cycle of gears, given the rate of a shaft along the tree and by the gear that closes the cycle."""
    of_gears = f"gears {', '.join(repr(gear.name) for gear in gears)} form a cycle"
    if abs(rate - by_gear) > CYCLE * abs(rate):
        raise SceneError(
            f"{of_gears} over the shafts {shafts} whose ratios multiply to {by_gear / rate:.9g} instead of 1: they could "
            "only stand still. Correct a ratio, or let one slip."
        )
    lossy = [gear.name for gear in gears if gear.lossy or gear.slip]
    if lossy:
        raise SceneError(
            f"{of_gears}, and {', '.join(map(repr, lossy))} loses energy: the split of the torques, and with it the motion, "
            "is not determined. Set efficiency = 1 and slip = 0 in the cycle, or put a spring or friction drive into it."
        )


def _path(shaft: int, above: dict) -> list[GearBranch]:
    path: list[GearBranch] = []
    while shaft in above:
        path.append(above[shaft])
        shaft = above[shaft].parent
    return path


def _initial_speeds(network: Network, names, group, K, count: int) -> np.ndarray:
    """Initial speeds (n_g,) of the roots, from those of the shafts [rad/s].

    SceneError if speeds of geared shafts contradict each other.
    """
    speed = np.zeros(count)
    said: list[str | None] = [None] * count
    for j, name in enumerate(names):
        given = network.shafts[name].speed
        if given is None:
            continue
        root, first = given / K[j], said[group[j]]
        if first is None:
            speed[group[j]], said[group[j]] = root, name
        elif abs(root - speed[group[j]]) > CYCLE * max(abs(root), abs(speed[group[j]])):
            fitting = speed[group[j]] * K[j]
            raise SceneError(
                f"shaft {name!r}: speed {given:g} rad/s does not fit the speed of {first!r}, to which it is geared; "
                f"expected {fitting:.9g} rad/s, or leave it out."
            )
    return speed
