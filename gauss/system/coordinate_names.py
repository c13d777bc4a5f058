"""Names and units of the entries of q and v, for tables and figures."""

import numpy as np

QUATERNION_COMPONENTS = ("qw", "qx", "qy", "qz")


def coordinate_units(system) -> dict[str, str]:
    """Name → unit of every entry of q: "rad", "m", or "1" for the parts of a quaternion."""
    found: dict[str, str] = {}
    for joint in system.joints:
        k, names = joint.pair.quaternion, dict(zip(joint.pair.rates, _units(joint.pair), strict=True))
        if k is not None:
            names = dict(list(names.items())[:k]) | dict.fromkeys(QUATERNION_COMPONENTS, "1")
        found |= {f"{joint.name}.{suffix}" if suffix else joint.name: unit for suffix, unit in names.items()}
    return found


def rate_units(system) -> dict[str, str]:
    """Name → unit of every entry of v: "rad/s" or "m/s"."""
    units = [f"{unit}/s" for joint in system.joints for unit in _units(joint.pair)]
    return dict(zip(system.coordinates, units, strict=True))


def force_units(system) -> dict[str, str]:
    """Name → unit of the generalised force along every entry of v: "N m" or "N"."""
    return {name: "N m" if unit == "rad/s" else "N" for name, unit in rate_units(system).items()}


def _units(pair) -> list[str]:
    """Unit of the coordinate of each rate of a pair: rad of a rotation, also of a screw, which slides as well."""
    turning, _ = pair.subspace(np.array(pair.reference))
    return ["rad" if column.any() else "m" for column in turning.T]


def axis_labels(system) -> dict:
    """Names and units of coordinates and rates, as coordinates of a Dataset."""
    coordinates, rates = coordinate_units(system), rate_units(system)
    return {
        "coordinate": list(coordinates),
        "coordinate_unit": ("coordinate", list(coordinates.values())),
        "rate": list(rates),
        "rate_unit": ("rate", list(rates.values())),
    }
