"""Reduced equations of a network, in symbols and numbers."""

from collections.abc import Callable

import numpy as np

from gauss.rotors.contract import reduce
from gauss.rotors.links import GearPair
from gauss.rotors.network import Network
from gauss.rotors.reduced import ReducedNetwork

LISTED = 12  # shafts of a group in its equation


def explain(network: Network) -> str:
    """Groups with their reduced equations (III.58)–(III.63) while power flows forward, and the links between groups.

    Parameters
    ----------
    network : Network
        The network.

    Returns
    -------
    str
        Lines to be printed.
    """
    reduced = reduce(network)
    gears = sum(isinstance(link, GearPair) for link in reduced.links)
    lines = [
        f"network {network.name!r}: {len(reduced.names)} shafts, {gears} gears, {len(reduced.links) - gears} other links, "
        f"{len(network.torques)} torques",
        f"  {reduced.n_groups} coordinate{'s' if reduced.n_groups > 1 else ''} instead of {len(reduced.names)}: "
        "shafts bound by gears turn together"
        if gears
        else f"  {reduced.n_groups} coordinate{'s' if reduced.n_groups > 1 else ''}: no gears bind shafts",
    ]
    for g in range(reduced.n_groups):
        lines += ["", *_group(reduced, g)]
    apart = [_link(reduced, b) for b, link in enumerate(reduced.links) if not isinstance(link, GearPair)]
    if apart:
        lines += ["", "links that leave the speeds of their shafts independent:", *apart]
    for b in reduced.redundant:
        lines += [
            "",
            f"gear {reduced.links[b].name!r} closes a power loop: its constraint is redundant. The motion is unique; the "
            "torques in the loop are not, those of least norm are given.",
        ]
    return "\n".join(lines)


def _group(reduced: ReducedNetwork, g: int) -> list[str]:
    """Equation of a group, in symbols and numbers."""
    root, names = reduced.roots[g], reduced.names
    shafts = [j for j in np.argsort(np.abs(1 / reduced.K), kind="stable") if reduced.group[j] == g]
    shafts = [root, *(int(j) for j in shafts if j != root)]
    F, J = reduced.factors(np.array([link.factor(True) for link in reduced.links]))
    name = names[root]
    if len(shafts) == 1:
        return [f"shaft {name!r}: J ω̇ = Q, J = {reduced.inertia[root]:.6g} kg m²"]
    chains = {j: _chain(reduced, j) for j in shafts}
    shown, more = shafts[:LISTED], " + …" if len(shafts) > LISTED else ""

    def total(term: Callable[[int], str]) -> str:
        return " + ".join(map(term, shown)) + more

    return [
        f"group of {name!r}, {len(shafts)} shafts: ω̇({name}) = Q_pr / J_pr",
        f"  J_pr = {total(lambda j: f'J({names[j]}){chains[j][0]}{chains[j][1]}')}",
        f"       = {total(lambda j: f'{reduced.inertia[j] * reduced.K[j] * F[j]:.6g}')} = {J[g]:.9g} kg m²",
        f"  Q_pr = {total(lambda j: f'Q({names[j]}){chains[j][1]}')}",
        f"       = {total(lambda j: f'{F[j]:.6g} Q({names[j]})')}",
        "  " + ", ".join(f"ω({names[j]}) = {reduced.K[j]:.6g} ω({name})" for j in shown[1:]) + more,
        *_losses(reduced, g),
    ]


def _losses(reduced: ReducedNetwork, g: int) -> list[str]:
    """Gears of a group whose torque factor depends on the direction of power flow."""
    lossy = [link.name for _, link in _gears(reduced, g) if link.lossy]
    return [f"  for backward power flow 1/η becomes η̄ (located as an event): {', '.join(lossy)}"] if lossy else []


def _gears(reduced: ReducedNetwork, g: int):
    return [
        (b, link)
        for b, link in enumerate(reduced.links)
        if isinstance(link, GearPair) and reduced.group[reduced.driven[b]] == g
    ]


def _chain(reduced: ReducedNetwork, shaft: int) -> tuple[str, str]:
    """Speed factor and torque factor of a shaft as products along its gears."""
    above = {branch.child: branch for branch in reduced.inward}
    speed = torque = ""
    while shaft in above:
        branch = above[shaft]
        link = reduced.links[branch.link]
        name = link.name
        if branch.forward:
            speed = f"·{f'(1 − ε({name}))' if link.slip else '1'}/i({name})" + speed
            torque = f"/(i({name})·η({name}))" + torque if link.efficiency != 1 else f"/i({name})" + torque
        else:
            speed = f"·i({name}){f'/(1 − ε({name}))' if link.slip else ''}" + speed
            torque = f"·i({name})" + (f"·η({name})" if link.efficiency != 1 else "") + torque
        shaft = branch.parent
    return speed.replace("·1/", "/"), torque


def _link(reduced: ReducedNetwork, b: int) -> str:
    link = reduced.links[b]
    return f"  {link.name}: {link.kind}, {link.driver} → {link.driven}, i = {link.ratio:g}"
