"""Contract gears: which shafts are one coordinate, how fast each turns, which gears are redundant or contradict."""

from collections import deque
from contextlib import suppress

import numpy as np

from gauss.errors import SceneError
from gauss.rotors.laws import Dry
from gauss.rotors.links import Gear
from gauss.rotors.network import Network
from gauss.rotors.reduced import CYCLE, REST, Branch, Reduced

SOON = 0.1  # rad: a way after which networks that start at rest are looked at to see how fast they turn


def reduce(network: Network) -> Reduced:
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
    roots, outward, redundant = [], [], []
    gears = _neighbours(links, driven, driver, len(names))
    for start in range(len(names)):
        if group[start] < 0:
            root = _root(_component(start, gears), network, names, links, gears)
            found = _grow(root, len(roots), links, gears, group, K)
            redundant += _check_cycles(found, root, links, driven, driver, group, K, names)
            roots.append(root)
            outward += found
    terms = tuple(torque for torque in network.torques.values() if not isinstance(torque.law, Dry))
    dry: dict = {}
    for torque in network.torques.values():
        if isinstance(torque.law, Dry):
            dry.setdefault(index[torque.shaft], []).append(torque)
    speed = _start(network, names, group, K, len(roots))
    known = [abs(speed[g] * k) for g, k in zip(group, K, strict=True)]
    known += [abs(torque.law.no_load) for torque in terms if torque.law.no_load is not None]
    return Reduced(
        network, names, links, driven, driver,
        np.array([shaft.inertia for shaft in network.shafts.values()]),
        group, K, tuple(roots), tuple(reversed(outward)), tuple(redundant), terms, dry,
        np.array([shaft.angle for shaft in network.shafts.values()]), speed, REST * (max(known) or _reached(network, K)),
    )  # fmt: skip


def _reached(network: Network, K: np.ndarray) -> float:
    """Speed that the largest torque, else the stiffest spring, gives all inertias soon; 1 rad/s without any."""
    torques, stiffest = [], max((getattr(link, "stiffness", 0.0) for link in network.links.values()), default=0.0)
    for torque in network.torques.values():
        with suppress(Exception):  # a law of the user's may ask for more than a shaft at rest
            dry = isinstance(torque.law, Dry)
            torques.append(abs(torque.law.value if dry else torque.law(torque.begin or 0.0, 0.0, 0.0)))
    largest = max((torque for torque in torques if np.isfinite(torque)), default=0.0) or stiffest
    inertia = sum(shaft.inertia * k**2 for shaft, k in zip(network.shafts.values(), K, strict=True))
    return float(np.sqrt(SOON * largest / inertia)) if largest and inertia else 1.0


def _neighbours(links, driven, driver, count: int) -> list[list]:
    """For each shaft its gears and the shafts at their other ends."""
    found = [[] for _ in range(count)]
    for b, link in enumerate(links):
        if isinstance(link, Gear):
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


def _root(shafts, network: Network, names, links, gears) -> int:
    """Shaft that drives the group: driven by no gear, with a motor if there are several, never moved through a lock."""
    motors = {torque.shaft for torque in network.torques.values() if torque.role == "motor"}
    driving = [j for j in shafts if all(outward for _, _, outward in gears[j])]
    order = sorted(driving or shafts, key=lambda j: names[j] not in motors)
    for root in [*order, *shafts]:
        backward = [b for b, _, outward in _walk(root, gears) if not outward]
        if all(links[b].back_efficiency > 0 for b in backward):
            return root
    locking = ", ".join(repr(links[b].name) for b in backward if links[b].back_efficiency == 0)
    raise SceneError(
        f"shafts {', '.join(names[j] for j in shafts)}: the self-locking gear {locking} stands between two driving shafts; "
        "what it transmits is not determined: give it a back_efficiency above 0, or join the shafts by a spring or clutch."
    )


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


def _grow(root: int, number: int, links, gears, group, K) -> list[Branch]:
    """Branches of the group from the root outward; fills its entries of group and K."""
    group[root], branches = number, []
    for b, child, outward in _walk(root, gears):
        parent = next(other for link, other, _ in gears[child] if link == b)
        rate = links[b].rate if outward else 1.0 / links[b].rate
        group[child], K[child] = number, K[parent] * rate
        branches.append(Branch(b, child, parent, rate, outward))
    return branches


def _check_cycles(branches, root, links, driven, driver, group, K, names) -> list[int]:
    """Gears beside the tree, each redundant, or refused."""
    above = {branch.child: branch for branch in branches}
    inside = {branch.link for branch in branches}
    redundant = []
    for b, link in enumerate(links):
        if not isinstance(link, Gear) or group[driver[b]] != group[root] or b in inside:
            continue
        paths = [_path(int(shaft), above) for shaft in (driven[b], driver[b])]
        cycle = [b, *{branch.link for branch in paths[0]} ^ {branch.link for branch in paths[1]}]
        shafts = ", ".join(dict.fromkeys(names[j] for c in cycle for j in (driver[c], driven[c])))
        if abs(K[driven[b]] - link.rate * K[driver[b]]) > CYCLE * abs(K[driven[b]]):
            product = link.rate * K[driver[b]] / K[driven[b]]
            raise SceneError(
                f"gears {', '.join(repr(links[c].name) for c in cycle)} form a cycle over the shafts {shafts} whose ratios "
                f"multiply to {product:.9g} instead of 1: they could only stand still. Correct a ratio, or let one slip."
            )
        lossy = [links[c].name for c in cycle if links[c].lossy or links[c].slip]
        if lossy:
            raise SceneError(
                f"gears {', '.join(repr(links[c].name) for c in cycle)} form a cycle, and {', '.join(map(repr, lossy))} "
                "loses energy: the split of the torques, and with it the motion, is not determined. Set efficiency = 1 and "
                "slip = 0 in the cycle, or put a spring or friction drive into it."
            )
        redundant.append(b)
    return redundant


def _path(shaft: int, above: dict) -> list[Branch]:
    path = []
    while shaft in above:
        path.append(above[shaft])
        shaft = above[shaft].parent
    return path


def _start(network: Network, names, group, K, count: int) -> np.ndarray:
    """Speeds of the roots that the shafts' speeds ask for."""
    speed, said = np.zeros(count), [None] * count
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
