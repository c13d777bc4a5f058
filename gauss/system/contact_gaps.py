"""Gap functions of the unilateral constraints of a scene, tangential velocities and guards of its contacts, in order."""

from gauss.scene import ClosedGap, Contact, Guard, OneSidedConstraint, Scene, Slip


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
