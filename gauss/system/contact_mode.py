"""What a scene is between two events: some of what comes and goes holds, some is a load, the rest is left out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from gauss.scene import IdealCounterpart, JointAtRest, Place, Scene, Slipping
from gauss.system.build import sides


@dataclass(frozen=True)
class ContactMode:
    """What grips, links that lose power and flanks do, by name.

    Parameters
    ----------
    grips : dict of str to int
        Sign of the force of a grip that slips; 0 where it holds.
    ways : dict of str to int
        Way of the power through a link that loses some, 1 forward, −1 back; 0 where nothing is lost.
    trains : dict of str to int
        Way in which the first joint of a train of gears turns, 1 or −1; 0 if losses hold it; :data:`FREE` at rest without.
    flanks : dict of str to int
        Flank of an elastic link that touches, −1 or 1, or 0.
    """

    grips: dict = field(default_factory=dict)
    ways: dict = field(default_factory=dict)
    trains: dict = field(default_factory=dict)
    flanks: dict = field(default_factory=dict)

    def __hash__(self):
        return hash(tuple(tuple(part.items()) for part in (self.grips, self.ways, self.trains, self.flanks)))

    def but(self, **parts) -> "ContactMode":
        """The same with some of it changed: grips, ways, trains or flanks by name."""
        return replace(self, **{key: getattr(self, key) | change for key, change in parts.items()})


FREE = 2


NOTHING = ContactMode()


def phase_scene(
    scene: Scene,
    closed: Iterable[str] = (),
    told: ContactMode = NOTHING,
    places: Mapping[str, Place] = MappingProxyType({}),
    cut: bool = False,
) -> Scene:
    """Scene in which some one-sided constraints and grips are constraints or loads, and all others are left out.

    Parameters
    ----------
    scene : Scene
        With one-sided constraints, grips, links that lose power, play.
    closed : iterable of str
        Gaps that are closed: constraints.
    told : ContactMode
        What the others do; links that lose power keep their rows and lose none.
    places : mapping
        By name of a closed gap, the features that touch there, if others might be nearer on the way.
    cut : bool
        Leave out the rows of links through which power is lost: their forces are to be added.
    """
    names = set(closed)
    shut = [side for side in sides(scene) if side.name in names] if names else []
    held = {side.name: replace(side, place=places.get(side.name)) for side in shut}
    held |= {name: scene.grips[name] for name, sign in told.grips.items() if not sign}
    held |= {f"rest of {joint}": JointAtRest(f"rest of {joint}", joint) for joint, way in told.trains.items() if not way}
    relations = {
        name: IdealCounterpart(name, relation) if relation.loses else relation
        for name, relation in (scene.relations | held).items()
        if not (cut and told.ways.get(name))
    }
    slipping = {
        name: Slipping(name, scene.grips[name], sign, told.ways.get(name, 0)) for name, sign in told.grips.items() if sign
    }
    loads = {
        name: replace(load, side=told.flanks[name]) if name in told.flanks else load for name, load in scene.loads.items()
    }
    return replace(scene, relations=relations, contacts={}, grips={}, loads=loads | slipping)
