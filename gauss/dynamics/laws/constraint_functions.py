"""Functions of the user in constraints, to be watched within steps as traced laws are: conditions and narrow peaks."""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression, Function
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.traced_laws import Laws, symbols
from gauss.scene import Cam, Constraint, OnCurve, OneSidedConstraint, Relation, Transmission
from gauss.system import System
from gauss.system.relations import Relations, Rows, place_relations

OWN = (Cam, Constraint, OnCurve, OneSidedConstraint, Transmission)  # kinds of relations made of functions of the user


class WatchedFunctions(NamedTuple):
    """Traced functions over the symbols of a motion."""

    motion: Kinematics  # the system in symbols
    functions: list[tuple[str, Function]]  # each with the name of its load or constraint

    @property
    def outputs(self) -> list[Expression]:
        """Outputs of all functions."""
        return [output for _, function in self.functions for output in function.outputs]


def watched_functions(system: System, laws: Laws) -> Laws | WatchedFunctions:
    """Traced laws of loads, and residuals of constraints that functions of the user make."""
    own = [relation for relation in system.scene.relations.values() if _is_own(relation)]
    if not own:
        return laws
    motion = symbols(system)
    functions = [(name, Function("law", [], _expressions(function.outputs))) for name, function in laws.functions]
    return WatchedFunctions(motion, [*functions, *_traced(place_relations(system, own), motion)])


def residual_functions(system: System) -> WatchedFunctions:
    """Residuals of all constraints beyond the joints."""
    motion = symbols(system)
    return WatchedFunctions(motion, _traced(system.relations, motion))


def _traced(relations: Relations, motion: Kinematics) -> list[tuple[str, Function]]:
    """Residuals of relations, each with its name."""
    pairs = zip(relations.placed, relations.rows(motion), strict=True)
    return [(placed.name, Function("constraint", [], _residuals(rows, placed.velocities))) for placed, rows in pairs]


def _is_own(relation: Relation) -> bool:
    """Whether a function of the user makes a relation, or that of which it is a mode or a closed gap."""
    whole = relation
    while hasattr(whole, "whole"):
        whole = whole.whole
    return isinstance(whole, OWN)


def _residuals(rows: Rows, velocities: int) -> list[Expression]:
    """Position residuals, and slopes and right-hand sides of the last rows, which bind velocities."""
    first = len(rows.C) - velocities
    parts = [block[first:] for block in (*rows.A, *rows.B, rows.C)]
    return _expressions([entry for part in (rows.gap[:first], *parts) for entry in np.ravel(part)])


def _expressions(entries) -> list[Expression]:
    return [entry for entry in entries if isinstance(entry, Expression)]
