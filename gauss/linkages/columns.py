"""Cycle → table of columns, named with their units."""

import numpy as np

from gauss.linkages.balancing import shaking
from gauss.linkages.cycle_result import Cycle


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
