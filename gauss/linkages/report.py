"""Report on a linkage: groups, range and transmission, extremes of a cycle; and its cycle as a table of columns."""

import numpy as np

from gauss.linkages.balancing import shaking
from gauss.linkages.crank_ranges import FULL, degrees
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.energy import power_balance
from gauss.linkages.linkage import Linkage
from gauss.linkages.quality import POOR_TRANSMISSION
from gauss.scene import GROUND

WORK_ROUNDING = 1e-12  # relative to the largest torque [rad]: smaller work is zero


def report(linkage: Linkage, found: Cycle) -> str:
    """Lines about the groups, how the linkage turns and transmits, and the extremes of a cycle.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    found : Cycle
        Its cycle.

    Returns
    -------
    str
        Lines to be printed.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import report
    >>> print(report(bar, cycle).splitlines()[0])
    four-bar: kinematics from top to bottom, forces from bottom to top
    """
    lines = [str(found.chain), ""]
    lines += [f"  {name:14} {text}" for name, text in (*_geometry(linkage), *_forces(linkage, found))]
    return "\n".join(lines)


def _geometry(linkage: Linkage):
    ranges = linkage.closing_ranges()
    full = ranges == [FULL]
    text = "through a full turn of the crank" if full else " and ".join(f"{degrees(a)} to {degrees(b)}" for a, b in ranges)
    yield "closes", text
    grashof = linkage.grashof()
    if grashof is not None:
        shortest = "frame" if grashof.shortest == GROUND else grashof.shortest
        yield "Grashof", f"{grashof.kind}, margin {grashof.margin:.4g} m, shortest link: {shortest}"
    for name, (least, at) in linkage.least_transmission().items():
        poor = f", below {np.degrees(POOR_TRANSMISSION):.0f}°: transmits poorly" if least < POOR_TRANSMISSION else ""
        yield "transmission", f"{name}: least angle {np.degrees(least):.4g}° at crank angle {degrees(at)}{poor}"


def _forces(linkage: Linkage, found: Cycle):
    for name, kappa in found.condition().items():
        yield "condition", f"{name}: at most {kappa.max():.3g}"
    angle, torque = found.crank_angle, found.torque
    low, high = np.argmin(torque), np.argmax(torque)
    yield "torque", (f"{torque[low]:.6g} N m at {degrees(angle[low])} to {torque[high]:.6g} N m at {degrees(angle[high])}")
    if linkage.closing_ranges() == [FULL] and linkage.drives[0].speed:
        work = linkage.work()[-1]
        work = 0.0 if abs(work) < WORK_ROUNDING * np.abs(torque).max() else work
        yield "work", f"{work:.6g} J in a turn, the same as {abs(work) / (2 * np.pi):.6g} N m all the way"
    for joint in found.chain.joints:
        force = np.hypot(*found.reaction(joint.name).force.T)
        worst = np.argmax(force)
        yield f"reaction {joint.name}", f"at most {force[worst]:.6g} N at {degrees(angle[worst])}"
    force = np.hypot(*shaking(found).force.T)
    yield "shaking force", f"at most {force.max():.6g} N on the frame"
    balance = power_balance(found)
    scale = max(np.abs(part).max() for part in balance[:3])
    yield "power balance", f"closes within {np.abs(balance.residual).max():.1e} W of {scale:.4g} W"


def table(found: Cycle) -> dict[str, np.ndarray]:
    """Columns (k,) by name: crank, torque, reactions in the order of the groups, links, slides, shaking force and moment.

    Parameters
    ----------
    found : Cycle
        The cycle.

    Returns
    -------
    dict
        Columns (k,) by name and unit.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import table
    >>> columns = table(cycle)
    >>> list(columns)[:3]
    ['crank angle [rad]', 'driving torque M1 [N m]', 'reaction A x [N]']
    """
    nought = np.zeros(len(found))
    columns = {"crank angle [rad]": found.crank_angle, "driving torque M1 [N m]": found.torque}
    for joint in found.chain.joints:
        value = found.reactions[joint.name]
        parts = ("x [N]", "y [N]") if joint.kind == "revolute" else ("n [N]", "m [N m]")
        columns |= {
            f"reaction {joint.name} {part}": x + nought for part, x in zip(parts, (value.real, value.imag), strict=True)
        }
    for link in found.chain.links:
        moving = found.link(link.name)
        columns[f"{link.name} angle [rad]"] = found.angle(link.name)
        columns[f"{link.name} speed [rad/s]"] = moving.omega + nought
        columns[f"{link.name} acceleration [rad/s^2]"] = moving.alpha + nought
    for joint in found.chain.joints:
        if joint.kind == "prismatic":
            slide = found.slide(joint.name)
            for what, unit, x in zip(slide._fields, ("m", "m/s", "m/s^2"), slide, strict=True):
                columns[f"slide {joint.name} {what} [{unit}]"] = x + nought
    for name, mu in found.transmission().items():
        columns[f"transmission angle of {name} [rad]"] = mu
    force, moment = shaking(found)
    return columns | {"shaking force x [N]": force[:, 0], "shaking force y [N]": force[:, 1], "shaking moment [N m]": moment}


def coupler_curves(found: Cycle, points) -> dict[str, np.ndarray]:
    """Columns (k,) of the curves of points of links.

    Parameters
    ----------
    found : Cycle
        The cycle.
    points : iterable of (str, array_like (2,))
        Links and points of them, in their frames [m].

    Returns
    -------
    dict
        Columns (k,) by name and unit.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import coupler_curves
    >>> curves = coupler_curves(cycle, [("coupler", (0.5, 0.2))])
    >>> {name: column.round(4).tolist() for name, column in curves.items()}
    {'coupler (0.5, 0.2) x [m]': [0.6203, 0.6801, 0.61], 'coupler (0.5, 0.2) y [m]': [0.4914, 0.6181, 0.7038]}
    """
    columns: dict[str, np.ndarray] = {}
    for link, point in points:
        z = found.link(link).point(complex(*point)) + np.zeros(len(found))
        name = f"{link} ({point[0]:g}, {point[1]:g})"
        columns |= {f"{name} x [m]": z.real, f"{name} y [m]": z.imag}
    return columns
