"""Names of the elements of a scene: a taken one is refused, and so is an unknown one, with the nearest that exists."""

from typing import TYPE_CHECKING

from gauss.errors import SceneError, did_you_mean

if TYPE_CHECKING:
    from gauss.scene.body import Body, Frame
    from gauss.scene.collision import Collider
    from gauss.scene.inputs import Input, Output
    from gauss.scene.joint import Coupling, Joint
    from gauss.scene.loads import Start
    from gauss.scene.relation import Relation
    from gauss.scene.set_valued import SetValued
    from gauss.scene.unilateral import Unilateral

GROUND = "ground"


class SceneNames:
    """Elements of a scene by name, and checks of the names by which elements refer to each other."""

    bodies: "dict[str, Body]"
    frames: "dict[str, Frame]"
    joints: "dict[str, Joint]"
    couplings: "dict[str, Coupling]"
    relations: "dict[str, Relation]"
    shapes: "dict[str, Collider]"
    contacts: "dict[str, Unilateral]"
    set_valued: "dict[str, SetValued]"
    loads: dict
    starts: "dict[str, Start]"
    inputs: "dict[str, Input]"
    outputs: "dict[str, Output]"

    @property
    def _constraints(self) -> "dict[str, Relation]":
        return self.relations | self.contacts | self.set_valued

    def require_joint(self, name: str, what: str) -> "Joint":
        """Return the joint of this name, or raise a SceneError that names those that exist."""
        if name not in self.joints:
            raise SceneError(f"{what}: no joint {name!r}. {did_you_mean(name, self.joints)}")
        return self.joints[name]

    def _require_freedoms(self, joint: str, count: int, what: str):
        freedoms = self.require_joint(joint, what).pair.n_v
        if freedoms != count:
            raise SceneError(f"{what}: joint {joint!r} has {freedoms} freedoms; a joint of {count} is needed.")

    def _require_coordinate(self, name: str, what: str):
        """Refuse a name of neither a joint of one freedom nor one rate of a joint."""
        owner, _, rate = name.rpartition(".")
        if name not in self.joints and owner in self.joints and rate in self.joints[owner].pair.rates:
            return
        freedoms = self.require_joint(name, what).pair.n_v
        if freedoms == 0:
            raise SceneError(f"{what}: joint {name!r} cannot move; choose another type, or another joint.")
        if freedoms != 1:
            rates = ", ".join(f"{name}.{rate}" for rate in self.joints[name].pair.rates) or "none"
            raise SceneError(f"{what}: joint {name!r} has {freedoms} freedoms; name one of them: {rates}.")

    def _require_place(self, name: str, what: str):
        if name != GROUND and name not in self.bodies and name not in self.frames:
            raise SceneError(
                f"{what}: no body or frame {name!r}. {did_you_mean(name, [*self.bodies, *self.frames, GROUND])}"
            )

    def _require_shape(self, name: str, what: str):
        if name not in self.shapes:
            raise SceneError(f"{what}: no shape {name!r}. {did_you_mean(name, self.shapes)}")

    def _require_carried(self, name: str, body: str, what: str):
        """Refuse a frame that another body carries."""
        self._require_place(name, what)
        carrier = self.frames[name].body if name in self.frames else name
        if carrier != body:
            raise SceneError(f"{what}: {name!r} is on {carrier!r}, not on {body!r}.")

    def _require_body(self, name: str, what: str):
        if name != GROUND and name not in self.bodies:
            raise SceneError(f"{what}: no body {name!r}. {did_you_mean(name, [*self.bodies, GROUND])}")

    def _require_new(self, name: str, kind: str, taken):
        if name in taken:
            raise SceneError(f"{kind} {name!r}: the name is taken; choose another.")

    def _taken(self) -> set[str]:
        return {*self.joints, *self.couplings, *self._constraints, *self.loads}

    def _fresh(self, name: str) -> str:
        taken = [*self.loads, *self._constraints]
        count = sum(1 for load in taken if load == name or load.startswith(f"{name} "))
        return name if not count else f"{name} {count + 1}"
