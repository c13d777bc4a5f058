"""What a network is reduced to, in symbols and numbers."""

import numpy as np

from gauss.rotors.contract import reduce
from gauss.rotors.links import Gear
from gauss.rotors.network import Network
from gauss.rotors.reduced import Reduced

LISTED = 12  # shafts of a group that are written out


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
    gears = sum(isinstance(link, Gear) for link in reduced.links)
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
    apart = [_link(reduced, b) for b, link in enumerate(reduced.links) if not isinstance(link, Gear)]
    if apart:
        lines += ["", "links that keep their shafts free of each other:", *apart]
    for b in reduced.redundant:
        lines += [
            "",
            f"gear {reduced.links[b].name!r} closes a power loop: its row is redundant. The motion is unique; the torques "
            "in the loop are not, those of least norm are given.",
        ]
    return "\n".join(lines)


def _group(reduced: Reduced, g: int) -> list[str]:
    root, names = reduced.roots[g], reduced.names
    shafts = [j for j in np.argsort(np.abs(1 / reduced.K), kind="stable") if reduced.group[j] == g]
    shafts = [root, *(int(j) for j in shafts if j != root)]
    f = np.array([link.factor(True) for link in reduced.links])
    F, J = reduced.factors(f)
    name = names[root]
    if len(shafts) == 1:
        return [f"shaft {name!r}: J ω̇ = Q, J = {reduced.inertia[root]:.6g} kg m²"]
    chains = {j: _chain(reduced, j) for j in shafts}
    shown, more = shafts[:LISTED], " + …" if len(shafts) > LISTED else ""
    symbols_J = " + ".join(f"J({names[j]}){chains[j][0]}{chains[j][1]}" for j in shown) + more
    numbers_J = " + ".join(f"{reduced.inertia[j] * reduced.K[j] * F[j]:.6g}" for j in shown) + more
    symbols_Q = " + ".join(f"Q({names[j]}){chains[j][1]}" for j in shown) + more
    numbers_Q = " + ".join(f"{F[j]:.6g} Q({names[j]})" for j in shown) + more
    lines = [
        f"group of {name!r}, {len(shafts)} shafts: ω̇({name}) = Q_pr / J_pr",
        f"  J_pr = {symbols_J}",
        f"       = {numbers_J} = {J[g]:.9g} kg m²",
        f"  Q_pr = {symbols_Q}",
        f"       = {numbers_Q}",
        "  " + ", ".join(f"ω({names[j]}) = {reduced.K[j]:.6g} ω({name})" for j in shown[1:]) + more,
    ]
    lossy = [link.name for b, link in _gears(reduced, g) if link.lossy]
    if lossy:
        lines.append(f"  where power flows back, 1/η becomes η̄ (found at every event): {', '.join(lossy)}")
    return lines


def _gears(reduced: Reduced, g: int):
    return [
        (b, link) for b, link in enumerate(reduced.links) if isinstance(link, Gear) and reduced.group[reduced.driven[b]] == g
    ]


def _chain(reduced: Reduced, shaft: int) -> tuple[str, str]:
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


def _link(reduced: Reduced, b: int) -> str:
    link = reduced.links[b]
    return f"  {link.name}: {type(link).__name__}, {link.driver} → {link.driven}, i = {link.ratio:g}"
