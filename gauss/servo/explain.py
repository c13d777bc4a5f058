"""Report on a servo: relations, efforts, realisability and method of solution."""

import numpy as np

from gauss.servo.plan import direct
from gauss.servo.realisable import realisable
from gauss.servo.saddle import is_ideal
from gauss.servo.servo import Servo, state_of
from gauss.servo.solve import saddle
from gauss.servo.verdict import UnrealisableError
from gauss.system import State


def explain(servo: Servo, state: State | None = None) -> str:
    """Relations, efforts, verdict and method of solution in a state.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State, optional
        State; the start of the scene when not given.

    Returns
    -------
    str
        Lines to be printed.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> crane = gauss.load("servo/crane")
    >>> print(servo.explain(crane).splitlines()[0])
    servo on scene 'overhead crane'
    """
    state = state_of(servo, state, "servo.explain")
    verdict = realisable(servo, state)
    kinds = {relation.name: relation for relation in servo.relations}
    lines = [f"servo on scene {servo.system.scene.name!r}"]
    for relation in kinds.values():
        by = "kept by a contact (ideal)" if relation.ideal else "held by servos"
        lines.append(f"  relation {relation.name!r}: {relation.level} level, [{relation.unit}], {by}")
    for actuator in servo.actuators:
        lines.append(f"  {actuator.kind} {actuator.name!r}: {_words(actuator)}")
    lines += [f"  can it be held? {verdict}", f"  solved by: {_method(servo, state, verdict)}", ""]
    return "\n".join(lines) + servo.system.explain()


def _words(actuator) -> str:
    given = {key: value for key, value in vars(actuator).items() if key != "name" and np.any(np.array(value, dtype=object))}
    return ", ".join(f"{key} {value}" for key, value in given.items())


def _method(servo: Servo, state: State, verdict) -> str:
    if not verdict:
        return "not at all; see above"
    if not servo.held:
        return "contacts alone: a minimum of the compulsion"
    if verdict.outcome == "higher degree":
        return (
            f"index reduction: relations differentiated {verdict.degree} times on the traced equations of motion, hidden "
            "relations kept beside them; then the saddle system with their rows"
        )
    try:
        here = saddle(servo, state, direct(servo)).instant
    except UnrealisableError as error:
        return str(error)
    if is_ideal(here):
        return "the Gauss QP and its backends: the forces are along the rows of the relations, a minimum of the compulsion"
    angle = np.degrees(np.arccos(np.clip(np.linalg.svd(here.cosines, compute_uv=False).min(), 0.0, 1.0)))
    return (
        "the saddle system directly: an oblique projection, no minimum of the compulsion; rows of the relations and "
        f"directions of the efforts are up to {angle:.3g}° apart in the mass metric"
    )
