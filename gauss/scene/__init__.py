"""The mechanism as the user describes it: bodies, joints, constraints, contacts, loads, starts; frozen and validated.

* :class:`Scene` collects the elements by names (``names``); builder methods are in ``scene`` and the files ``…builder``;
* bilateral constraints are a :class:`Relation` (``relation``, ``geometry``, ``gears``, ``rolling``, ``motions``, …);
* unilateral constraints are a gap function g_N ≥ 0 (``unilateral``, ``contact``);
* set-valued elements are a :class:`SetValued` force law: Coulomb friction, limited drives (``set_valued``, ``clutches``);
* loads are known forces (``loads``, ``elastic``); kinematic pairs are in ``pairs``.
"""

from gauss.lazy import attach

__all__, __getattr__, __dir__ = attach(__name__, __file__)
