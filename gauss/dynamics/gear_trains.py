"""Gear trains: joints with proportional rates, coupled by links with losses.

Losses depend on the direction of motion, and hold a train at rest like Coulomb friction.
"""

from typing import NamedTuple

from gauss.scene import LossyGear, Scene


class GearTrain(NamedTuple):
    """Joints whose rates are proportional.

    Attributes
    ----------
    root : str
        Joint whose direction of motion is that of the train.
    rates : dict of str to float
        Rate of every joint over that of the root.
    """

    root: str
    rates: dict[str, float]


def gear_trains(scene: Scene) -> list[GearTrain]:
    """Gear trains of a scene that drive links with losses."""
    found: list[GearTrain] = []
    for link in scene.losses.values():
        if not any(link.driver in train.rates for train in found):
            found.append(GearTrain(link.driver, _rates(scene, link.driver)))
    return found


def _rates(scene: Scene, root: str) -> dict[str, float]:
    links = [(coupling.driven, coupling.driver, coupling.ratio) for coupling in scene.couplings.values()]
    gears = [relation for relation in scene.relations.values() if isinstance(relation, LossyGear)]
    links += [(gear.driven, gear.driver, -gear.acts_on[gear.driver]) for gear in gears]
    rates, waiting = {root: 1.0}, [root]
    while waiting:
        joint = waiting.pop()
        for driven, driver, rate in links:
            for one, other, factor in ((driver, driven, rate), (driven, driver, 1.0 / rate if rate else 0.0)):
                if one == joint and other not in rates and factor:
                    rates[other] = rates[joint] * factor
                    waiting.append(other)
    return rates
