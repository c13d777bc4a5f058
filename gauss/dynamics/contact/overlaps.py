"""Overlaps of shapes that a step refuses: those at its start, and those that no gap function shows."""

import numpy as np

from gauss.dynamics.contact_terms import ContactTerms
from gauss.errors import SimulationError, StateError
from gauss.scene import Box, Contact, Scene
from gauss.system import System, guards

START_OVERLAP = 1e-6  # of the scale of a gap: largest penetration at the start
# A step with an impact closes gaps by their rates, and leaves half of h² times what curvature adds to their accelerations:
# up to (h ω)² of the scale for points that turn at ω. Twice that is accepted, for the rates were larger before the step.
LEFT_BY_STEPS, MOST_LEFT = 2.0, 0.02
RESOLVED = ", or begin at gauss.resolve_overlaps(system)"  # what else removes penetration
UNSEEN_OVERLAP = 0.05  # of the shortest edge of a box: overlap without penetration of a gap function: a missed contact


def left_by_steps(system: System, v: np.ndarray, h: float) -> float:
    """Largest penetration at a start with rates v, relative to the scale of a gap.

    A motion may begin at any sample of one with steps of the same length: what such steps leave is accepted.

    Parameters
    ----------
    system : System
        The system.
    v : ndarray, shape (n_v,)
        Rates at the start.
    h : float
        Length of a step [s].
    """
    turned = min(h * system.scale.fastest(v), 1.0)  # more would leave more than is accepted anyhow, or overflow
    return START_OVERLAP + min(LEFT_BY_STEPS * turned**2, MOST_LEFT)


def penetration_error(t: float, inside: float, name: str, remedy: str = RESOLVED) -> StateError:
    """Error of a penetration [m, rad] at the start t [s], by the name of the contact, stop or rope."""
    return StateError(f"t = {t:.6g} s: {inside:.3g} [m, rad] inside of {name!r}; move it out with scene.start{remedy}.")


class UnseenOverlaps:
    """Overlaps of boxes that no gap function shows, in one scene.

    Parameters
    ----------
    owners : list of str
        Contact, stop or rope of each gap.
    """

    def __init__(self, system: System, owners: list[str]):
        scene, self.owners, self.deep = system.scene, owners, START_OVERLAP * system.scale.time
        self.deepest = {guard.name: UNSEEN_OVERLAP * shortest_edge(scene, guard.whole) for guard in guards(scene)}

    def refuse(self, touch: ContactTerms, t: float):
        """Raise a SimulationError if shapes overlap by more than these, and no gap of theirs is negative.

        Parameters
        ----------
        touch : ContactTerms
            Contact terms in units of the scene.
        t : float
            Time [s].
        """
        for (name, deepest), apart in zip(self.deepest.items(), touch.apart, strict=True):
            if apart > -deepest:
                continue
            least = touch.width[np.array([k for k, owner in enumerate(self.owners) if owner == name])].min()
            if least > -self.deep:
                raise SimulationError(
                    f"t = {t:.6g} s: shapes are {-apart:.3g} m in each other, and no gap of {name!r} leads out; "
                    "move them apart with scene.start, or shorten the step."
                )


def shortest_edge(scene: Scene, contact: Contact) -> float:
    """Shortest edge [m] of the boxes of a contact."""
    shapes = (scene.shapes[name] for name in (contact.shape, contact.other))
    return min(min(shape.size) for shape in shapes if isinstance(shape, Box))
