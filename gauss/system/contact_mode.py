"""The scene of one contact mode, between two events of a hybrid motion.

Active unilateral and sticking elements become bilateral constraints, slipping ones loads; inactive ones are dropped.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from gauss.scene import IdealCounterpart, JointAtRest, Place, Relation, Scene, Slipping
from gauss.system.build import sides


@dataclass(frozen=True)
class ContactMode:
    """Discrete mode of the set-valued elements, non-ideal links and backlash of a scene, by name.

    Parameters
    ----------
    grips : dict of str to int
        Sign of the force of a set-valued element that slips; 0 while it sticks.
    ways : dict of str to int
        Direction of power flow through a non-ideal link, 1 forward, −1 back; 0 without losses.
    trains : dict of str to int
        Direction in which the first joint of a gear train turns, 1 or −1; 0 if its losses stick; :data:`FREE` at rest else.
    flanks : dict of str to int
        Backlash side of an elastic link in contact, −1 or 1, or 0.
    """

    grips: dict = field(default_factory=dict)
    ways: dict = field(default_factory=dict)
    trains: dict = field(default_factory=dict)
    flanks: dict = field(default_factory=dict)

    def __hash__(self):
        return hash(tuple(tuple(part.items()) for part in (self.grips, self.ways, self.trains, self.flanks)))

    def but(self, **parts) -> "ContactMode":
        """Copy with some entries changed: grips, ways, trains or flanks by name."""
        return replace(self, **{key: getattr(self, key) | change for key, change in parts.items()})


FREE = 2  # a gear train at rest that its losses do not hold
IDLE_MODE = ContactMode()  # no element sticks or slips


def phase_scene(
    scene: Scene,
    closed: Iterable[str] = (),
    told: ContactMode = IDLE_MODE,
    places: Mapping[str, Place] = MappingProxyType({}),
    cut: bool = False,
) -> Scene:
    """Scene in which active unilateral and set-valued elements are constraints or loads, and all others are dropped.

    Parameters
    ----------
    scene : Scene
        With unilateral and set-valued elements, non-ideal links, backlash.
    closed : iterable of str
        Names of closed contacts.
    told : ContactMode
        Mode of the others; non-ideal links keep their rows, those of their ideal counterpart.
    places : mapping
        Pair of features of each closed contact whose features might change, by name.
    cut : bool
        Drop the rows of non-ideal links with power flow: the caller adds their forces.
    """
    bilateral = _closed_gaps(scene, set(closed), places)
    bilateral |= {name: scene.grips[name] for name, sign in told.grips.items() if not sign}
    bilateral |= {
        f"rest of {joint}": JointAtRest(f"rest of {joint}", joint) for joint, way in told.trains.items() if not way
    }
    relations = {
        name: IdealCounterpart(name, relation) if relation.loses else relation
        for name, relation in (scene.relations | bilateral).items()
        if not (cut and told.ways.get(name))
    }
    loads = {
        name: replace(load, side=told.flanks[name]) if name in told.flanks else load for name, load in scene.loads.items()
    }
    every: dict = {**loads, **_slipping(scene, told)}
    return replace(scene, relations=relations, contacts={}, grips={}, loads=every)


def _closed_gaps(scene: Scene, names: set[str], places: Mapping[str, Place]) -> dict[str, Relation]:
    """Bilateral constraints of closed contacts, by name."""
    shut = [side for side in sides(scene) if side.name in names] if names else []
    return {side.name: replace(side, place=places.get(side.name)) for side in shut}


def _slipping(scene: Scene, told: ContactMode) -> dict[str, Slipping]:
    """Loads of the set-valued elements that slip, by name."""
    return {
        name: Slipping(name, scene.grips[name], sign, told.ways.get(name, 0)) for name, sign in told.grips.items() if sign
    }
