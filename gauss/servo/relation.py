"""Servo-constraints: relations between positions, rates or accelerations of a system, and time."""

from collections.abc import Callable
from dataclasses import dataclass

from gauss.errors import SceneError, did_you_mean
from gauss.scene import Relation as SceneRelation
from gauss.scene.values import text

LEVELS = ("position", "velocity", "acceleration")


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
        if not isinstance(self.level, str) or self.level not in LEVELS:
            raise SceneError(f"{what}: no level {self.level!r}. {did_you_mean(str(self.level), LEVELS)}")


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
