"""Servo-constraints: relations between positions, rates or accelerations of a system, and time; rows by differentiation.

d²/dt² c(q, t) = G q̈ − γ        d/dt c(q, v, t) = G q̈ − γ        c(q, v, q̈, t) = G q̈ − γ
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression, branches, jacobian, substitute
from gauss.codegen.expression import reachable
from gauss.errors import SceneError, did_you_mean
from gauss.scene import Relation as SceneRelation
from gauss.scene.values import text
from gauss.servo.observed import MotionSymbols

DERIVATIVES = {"position": 2, "velocity": 1, "acceleration": 0}  # level of a residual → differentiations up to accelerations


@dataclass(frozen=True)
class ServoRelation:
    """Servo-constraint residual(t, motion) = 0.

    Its rows are found by differentiation: twice at position level, once at velocity level, not at all at acceleration
    level. So the residual is written with numpy functions of time and of the motion
    (:class:`gauss.servo.Observed`): ``motion.coordinate("A")``, ``motion.position("load")[0] - np.sin(t)``, ….

    Parameters
    ----------
    name : str
        Name; the entries of a residual with several are called "name[0]", "name[1]", ….
    residual : callable
        Function of (t, motion) that returns a number or a sequence of numbers.
    level : str
        "position": of positions and time; "velocity": of rates, too; "acceleration": linear in accelerations.
    ideal : bool
        Whether a contact keeps the relation, whose reaction does no work on displacements that the relation allows.
        No servo is needed then.
    unit : str
        Unit of the residual, for tables and figures.
    """

    name: str
    residual: Callable
    level: str = "position"
    ideal: bool = False
    unit: str = "rad, m"

    def __post_init__(self):
        what = f"relation {text(self.name, 'name of a relation')!r}"
        if not callable(self.residual):
            raise SceneError(f"{what}: residual must be a function of (t, motion), got {self.residual!r}.")
        if not isinstance(self.level, str) or self.level not in DERIVATIVES:
            raise SceneError(f"{what}: no level {self.level!r}. {did_you_mean(str(self.level), DERIVATIVES)}")


def as_relations(thing, motion, ideal: bool = False) -> list[ServoRelation]:
    """Relation as it is; any constraint of :mod:`gauss.scene` as relations, of its positions and of its velocities.

    The motion in symbols tells which residuals there are. ``ideal``: whether a contact keeps the constraint.
    """
    if isinstance(thing, ServoRelation):
        return [thing]
    if not isinstance(thing, SceneRelation):
        raise SceneError(f"expected a Relation, or a constraint of gauss.scene, got {thing!r}.")
    found: list[ServoRelation] = []
    for residual, level in ((thing.positions, "position"), (thing.velocities, "velocity")):
        if len(residual(motion)):
            name = f"{thing.name}.rates" if found else thing.name
            found.append(ServoRelation(name, lambda t, motion, residual=residual: residual(motion), level, ideal))
    return found


class ScalarRelation(NamedTuple):
    """Scalar entry of a relation, in symbols."""

    name: str
    residual: Expression
    level: str
    ideal: bool = False


class ServoRows(NamedTuple):
    """Rows of several scalar relations, in symbols or numbers."""

    position: np.ndarray  # (r,) residual at position level; zero for relations of velocities and accelerations
    velocity: np.ndarray  # (r,) residual at velocity level; zero for relations of accelerations
    G: np.ndarray  # (r, m) rows on the accelerations
    gamma: np.ndarray  # (r,) right-hand side of G q̈ = γ


def scalars(relations, symbols: MotionSymbols) -> list[ScalarRelation]:
    """Entries of relations, by calling each residual once with symbols.

    SceneError if a residual is no function of the motion that can be differentiated; the message says why.
    """
    return [scalar for relation in relations for scalar in _scalars(relation, symbols)]


def _scalars(relation: ServoRelation, symbols: MotionSymbols) -> list[ScalarRelation]:
    what = f"relation {relation.name!r}"
    try:
        value = np.ravel(np.asarray(branches(lambda: relation.residual(symbols.t, symbols.motion)), dtype=object))
    except (TypeError, AttributeError, IndexError, ZeroDivisionError) as error:
        raise SceneError(
            f"{what}: its residual cannot be traced: {error}. "
            "Write it as a function of (t, motion) with numpy functions (np.sin, not math.sin)."
        ) from error
    if not value.size:
        raise SceneError(f"{what}: its residual has no entries.")
    names = [relation.name] if value.size == 1 else [f"{relation.name}[{k}]" for k in range(value.size)]
    for name, entry in zip(names, value, strict=True):
        _check(name, entry, relation.level, symbols)
    return [ScalarRelation(name, entry, relation.level, relation.ideal) for name, entry in zip(names, value, strict=True)]


def _check(name: str, entry, level: str, symbols: MotionSymbols) -> None:
    """Check that a residual depends on the motion at its level; SceneError if it does not."""
    what = f"relation {name!r}"
    if not isinstance(entry, Expression):
        raise SceneError(f"{what}: its residual is {entry!r}, whatever the motion; it must depend on what moves.")
    asked = {node.index for node in reachable([entry])}
    accelerations, velocities, inputs = map(_indices, (symbols.accelerations, symbols.velocities, symbols.inputs))
    moving = (accelerations | inputs) - {symbols.t.index}
    if not asked & moving:
        raise SceneError(f"{what}: its residual depends on nothing that moves, so no force can hold it.")
    if level != "acceleration" and asked & accelerations:
        raise SceneError(f"{what}: its residual depends on accelerations; say level='acceleration'.")
    if level == "position" and asked & velocities and not _constant(entry, symbols.velocities):
        raise SceneError(f"{what}: its residual depends on velocities; say level='velocity'.")


def _indices(symbols: list[Expression]) -> set[int]:
    return {symbol.index for symbol in symbols}


def _constant(entry: Expression, symbols: list[Expression]) -> bool:
    """Whether the derivatives of an expression by symbols are zero."""
    return all(slope.is_constant and slope.value == 0 for slope in jacobian([entry], symbols).ravel())


def rows(found: list[ScalarRelation], symbols: MotionSymbols) -> ServoRows:
    """Rows of scalar relations, in the symbols; SceneError if a relation of accelerations is not linear in them."""
    zero = symbols.t.graph.constant(0.0)
    position: list[Expression] = []
    velocity: list[Expression] = []
    last: list[Expression] = []
    for scalar in found:
        chain = [scalar.residual]
        for _ in range(DERIVATIVES[scalar.level]):
            chain.append(symbols.derivative([chain[-1]])[0])
        chain = [zero] * (3 - len(chain)) + chain
        for place, entry in zip((position, velocity, last), chain, strict=True):
            place.append(entry)
    G = jacobian(last, symbols.accelerations).reshape(len(last), len(symbols.accelerations))
    unknown = {node.index for node in symbols.accelerations}
    for scalar, row in zip(found, G, strict=True):
        if unknown.intersection(node.index for node in reachable(row)):
            raise SceneError(f"relation {scalar.name!r}: its residual is not linear in the accelerations.")
    bias = substitute(last, symbols.accelerations, np.zeros(len(symbols.accelerations)))
    return ServoRows(np.array(position, dtype=object), np.array(velocity, dtype=object), G, -bias)
