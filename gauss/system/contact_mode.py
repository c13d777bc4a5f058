"""Gap functions and tangential velocities of a scene, in order; the scene of one contact mode, between two events.

Active unilateral and sticking elements become bilateral constraints, slipping ones loads; inactive ones are dropped.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from gauss.scene import (
    ClosedGap,
    Contact,
    FeaturePair,
    Guard,
    IdealCounterpart,
    JointAtRest,
    OneSidedConstraint,
    Relation,
    Scene,
    Slip,
    Slipping,
)


def sides(scene: Scene) -> list[ClosedGap]:
    """Every gap function of the unilateral constraints of a scene."""
    contacts = scene.contacts.values()
    return [ClosedGap(name, contact, k) for contact in contacts for k, name in enumerate(contact.sides(scene))]


def has_own_gaps(scene: Scene) -> bool:
    """Whether the user gives a gap function, which may depend on the time."""
    return any(isinstance(contact, OneSidedConstraint) for contact in scene.contacts.values())


def slips(scene: Scene) -> list[Slip]:
    """Tangential velocity at every contact distance with friction."""
    rough = [contact for contact in scene.contacts.values() if isinstance(contact, Contact) and contact.friction]
    return [Slip(name, contact, k) for contact in rough for k, name in enumerate(contact.sides(scene))]


def guards(scene: Scene) -> list[Guard]:
    """Separations of whole shapes that might overlap with all gap functions positive."""
    contacts = [contact for contact in scene.contacts.values() if isinstance(contact, Contact)]
    return [guard for contact in contacts for guard in contact.guards(scene)]


def of_shapes(scene: Scene) -> bool:
    """Whether all unilateral constraints are contacts of shapes: their gap functions depend on poses alone."""
    return all(isinstance(contact, Contact) for contact in scene.contacts.values())


@dataclass(frozen=True)
class ContactMode:
    """Discrete mode of the set-valued elements, non-ideal links and backlash of a scene, by name.

    Parameters
    ----------
    set_valued : dict of str to int
        Sign of the force of a set-valued element that slips; 0 while it sticks.
    power_flow : dict of str to int
        Direction of power flow through a non-ideal link, 1 forward, −1 back; 0 without losses.
    trains : dict of str to int
        Direction in which the first joint of a gear train turns, 1 or −1; 0 if its losses stick; :data:`FREE` at rest else.
    backlash_sides : dict of str to int
        Backlash side of an elastic link in contact, −1 or 1, or 0.
    """

    set_valued: dict = field(default_factory=dict)
    power_flow: dict = field(default_factory=dict)
    trains: dict = field(default_factory=dict)
    backlash_sides: dict = field(default_factory=dict)

    def __hash__(self):
        return hash(
            tuple(tuple(part.items()) for part in (self.set_valued, self.power_flow, self.trains, self.backlash_sides))
        )

    def but(self, **parts) -> "ContactMode":
        """Copy with some entries changed: set_valued, power_flow, trains or backlash_sides by name."""
        return replace(self, **{key: getattr(self, key) | change for key, change in parts.items()})

    def without(self, names: Collection[str]) -> "ContactMode":
        """Copy without some set-valued elements."""
        left = {name: sign for name, sign in self.set_valued.items() if name not in names}
        return replace(self, set_valued=left)


FREE = 2  # a gear train at rest that its losses do not hold
IDLE_MODE = ContactMode()  # no element sticks or slips


def phase_scene(
    scene: Scene,
    closed: Iterable[str] = (),
    mode: ContactMode = IDLE_MODE,
    places: Mapping[str, FeaturePair] = MappingProxyType({}),
    cut: bool = False,
) -> Scene:
    """Scene in which active unilateral and set-valued elements are constraints or loads, and all others are dropped.

    Parameters
    ----------
    scene : Scene
        With unilateral and set-valued elements, non-ideal links, backlash.
    closed : iterable of str
        Names of closed contacts.
    mode : ContactMode
        Mode of the others; non-ideal links keep their rows, those of their ideal counterpart.
    places : mapping
        Pair of features of each closed contact whose features might change, by name.
    cut : bool
        Drop the rows of non-ideal links with power flow: the caller adds their forces.
    """
    bilateral = _closed_gaps(scene, set(closed), places)
    bilateral |= {name: scene.set_valued[name] for name, sign in mode.set_valued.items() if not sign}
    bilateral |= {
        f"rest of {joint}": JointAtRest(f"rest of {joint}", joint) for joint, way in mode.trains.items() if not way
    }
    relations = {
        name: IdealCounterpart(name, relation) if relation.loses else relation
        for name, relation in (scene.relations | bilateral).items()
        if not (cut and mode.power_flow.get(name))
    }
    loads = {
        name: replace(load, side=mode.backlash_sides[name]) if name in mode.backlash_sides else load
        for name, load in scene.loads.items()
    }
    every: dict = {**loads, **_slipping(scene, mode)}
    return replace(scene, relations=relations, contacts={}, set_valued={}, loads=every)


def _closed_gaps(scene: Scene, names: set[str], places: Mapping[str, FeaturePair]) -> dict[str, Relation]:
    """Bilateral constraints of closed contacts, by name."""
    shut = [side for side in sides(scene) if side.name in names] if names else []
    return {side.name: replace(side, place=places.get(side.name)) for side in shut}


def _slipping(scene: Scene, mode: ContactMode) -> dict[str, Slipping]:
    """Loads of the set-valued elements that slip, by name."""
    return {
        name: Slipping(name, scene.set_valued[name], sign, mode.power_flow.get(name, 0))
        for name, sign in mode.set_valued.items()
        if sign
    }
