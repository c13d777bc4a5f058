"""Laws of contact of many bodies, and the rounds of Newton steps in which their problem is solved.

Newton steps with hardly any regularisation nearly always converge. In heaps contacts cycle between sticking, slipping and
open: all contacts are regularised, or those alone that cycle. Where contacts that stick bear more components of force than
the bodies have freedoms, forces are not unique, and the search ends at residuals that more steps hardly lessen.
"""

from functools import cache

from gauss.codegen.kernels import BlockContactLaws, Round
from gauss.dynamics.contact.contact_step import contact_solver

ROUNDS = (
    Round(0, 1e-7, 12),
    Round(0, 1e-2, 30),
    Round(0, 1e-4, 10),
    Round(0, 1e-7, 10),
    Round(30, 1e-3, 30),
    Round(0, 1e-7, 10),
    Round(100, 1e-2, 30),
    Round(0, 1e-5, 10),
    # Redundant contacts between which forces move far at small residuals: much regularisation stands still, little cycles.
    Round(0, 1e-5, 30),
    Round(0, 3e-6, 40),
    Round(0, 1e-3, 20),
    Round(0, 1e-5, 30),
)
# What is left cycles beside contacts that converge: the regularisation stays where contacts change their modes. Of 3000
# steps of three bins of 30 balls, 33 miss the tolerance of the laws instead of 130, by 8e-7 at most instead of 1e-4.
LAST_ROUNDS = (
    Round(0, 3e-2, 28, decay=0.8),
    Round(0, 1e-7, 10),
    Round(100, 3e-2, 40, decay=0.8),
    Round(0, 1e-7, 10),
    Round(300, 1e-1, 40, decay=0.7),
    Round(0, 1e-7, 12),
)
LEAST_CONTACTS = 100  # of problems whose redundant contacts have rounds of their own: of fewer, all rounds cost little
# Residuals in units of their tolerance. Those below CLOSE are worth Newton steps with hardly any regularisation; those from
# CLOSE to FINE are left in heaps that come to rest, where contacts stick but for some that slip by micrometres per second:
# in a bin of 100 balls, 200 Newton steps more lessened them by half at most.
CLOSE, FINE = 1e3, 1e5
REDUNDANT_ROUNDS = (
    Round(0, 1e-7, 12),
    Round(0, 3e-2, 28, decay=0.8),
    Round(0, 1e-2, 20, decay=0.6),
    Round(0, 1e-5, 10, below=CLOSE),
    Round(0, 1e-7, 10, below=CLOSE),
    Round(0, 1e-5, 30, below=0.1 * CLOSE),
    Round(0, 3e-6, 40, below=0.1 * CLOSE),
    *(each._replace(above=FINE) for each in ROUNDS[1:]),
)


@cache
def block_contact_laws() -> BlockContactLaws:
    """Laws of contact and friction of the block-sparse problem."""
    laws = contact_solver()
    functions = laws.normal, laws.friction, laws.project_normal, laws.project_friction
    return BlockContactLaws(*functions, ROUNDS + LAST_ROUNDS, REDUNDANT_ROUNDS, LEAST_CONTACTS)
