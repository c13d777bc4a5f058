"""Gap functions of the unilateral constraints of a scene, tangential velocities and guards of its contacts, in order."""

from gauss.scene import ClosedGap, Contact, Guard, Scene, Slip


def sides(scene: Scene) -> list[ClosedGap]:
    """Every gap function of the unilateral constraints of a scene."""
    contacts = scene.contacts.values()
    return [ClosedGap(name, contact, k) for contact in contacts for k, name in enumerate(contact.sides(scene))]


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
