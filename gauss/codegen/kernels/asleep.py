"""Whether a step pushes a body asleep: such a step is not finished, for its island is woken first."""

from collections.abc import Callable

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Value
from gauss.codegen.kernels.near_pairs import BODY, parts_of
from gauss.codegen.kernels.step_memory import StepMemory


def pushes_asleep(at: StepMemory, m: Value, force: Callable[[Value], Value], sleeps: Callable[[Value], Value]) -> Value:
    """1 if one of m near contacts pushes a body asleep.

    Parameters
    ----------
    at : StepMemory
        Arrays of the step.
    m : Value
        Number of near contacts.
    force, sleeps : callable
        Normal force of a contact; whether a body sleeps, by its column.
    """
    r, woken, found, body = at.r, at.r.variable(0, INTEGER), at.table("found"), at.table("body")
    with r.when(at.n["sleepers"] > 0), r.each(m) as c, r.when(force(c) > 0.0):
        for part in parts_of(found[c * 2], at.n["parts"]):
            with r.when(sleeps(body[part * BODY])):
                woken[0] = 1
    return woken[0]
