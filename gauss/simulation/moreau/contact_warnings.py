"""Warnings of time stepping: forces that rigid bodies leave undetermined, and laws of contact that a step does not meet."""

import warnings
from collections.abc import Iterable

from gauss.dynamics.contact.paradox import Paradox
from gauss.errors import ContactLawWarning, PainleveWarning, user_level

LOOSE_LAWS = 1e-6  # relative residual of the laws of contact and friction, above which a motion is warned of


class ParadoxWarnings:
    """Warnings of Painlevé's paradox, one for each set of contacts of a motion."""

    def __init__(self):
        self.known: frozenset[frozenset[str]] = frozenset()

    def warn(self, found: Iterable[Paradox], t: float, owner=str):
        """Warn of paradoxes at a time [s]; ``owner`` gives the name of the contact of a gap."""
        for paradox in found:
            contacts = frozenset(owner(gap) for gap in paradox.gaps)
            if contacts not in self.known:
                self.known |= {contacts}
                warnings.warn(
                    f"t = {t:.6g} s: {paradox}. The step goes on with an impulse that satisfies the law at its end.",
                    PainleveWarning,
                    stacklevel=user_level(),
                )


def warn_of_laws(error: float, relaxed: int, steps: int):
    """Warn if steps did not meet the laws of contact and friction.

    Parameters
    ----------
    error : float
        Largest residual of the laws, relative.
    relaxed, steps : int
        Steps by the convex relaxation of Coulomb's law, and all steps.
    """
    found = [f"{relaxed} of {steps} steps were taken by the convex relaxation of Coulomb's law"] if relaxed else []
    found += [f"the laws are met to {error:.0e} relative only"] if error > LOOSE_LAWS else []
    if found:
        warnings.warn(
            f"contact and friction: {'; '.join(found)}. Sliding contacts open a little there; give a smaller step.",
            ContactLawWarning,
            stacklevel=user_level(),
        )
