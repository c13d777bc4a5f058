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


def displacement_names(system) -> list[str]:
    """Names of displacements along every entry of v; a state of one's own moves along its integral."""
    own = system.scene.states
    return [f"integral of {name}" if name in own else name for name in system.coordinates]


def rate_names(system) -> list[str]:
    """Names of the entries of v as states; states of one's own have their names."""
    own = system.scene.states
    return [name if name in own else f"{name} rate" for name in system.coordinates]


def state_names(system) -> dict[str, str]:
    """Name → unit of every entry of q, then of v, as states; states of one's own have their names, and q their integrals."""
    coordinates, rates, own = coordinate_units(system), rate_units(system), system.scene.states
    named = {f"integral of {name}" if name in own else name: unit for name, unit in coordinates.items()}
    return named | {name if name in own else f"{name} rate": "1" if name in own else unit for name, unit in rates.items()}


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
