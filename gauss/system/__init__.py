"""Scene → System, once: indices, spanning tree, constant frames, constraint rows, subsystems in joint coordinates.

* ``build`` makes the :class:`System`; ``relations`` differentiates its constraints and gap functions;
* ``reduction`` and ``passes`` reduce it to the subsystems that are integrated; ``explain`` reports both;
* ``manifold`` moves coordinates by rates; ``scale`` gives the units of tolerances; ``contact_mode`` the scene of one mode.
"""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
