"""Laws of a gap over one step: whether it has an impact, and the least rate that it may have afterwards.

A gap d that would close within a step closes at its end, ḋ⁺ ≥ −d/((1 − s) h). In steps of one length d is what would be left
at ḋ⁺ = 0, by the second derivative as well, so that bodies rocking on an edge do not penetrate. Penetration is removed with
ḋ⁺ ≥ −d/τ. In steps of one length τ is the step. Where steps become shorter, that speed would grow without bound, and bodies
that penetrate a little would jump apart: then τ is a time of the scene, in which the gap closes exponentially, whatever the
steps. What is left of a gap that stays closed vanishes in the same time: if it closed at the end of each step, curved gaps
would make the rates alternate in proportion to the step.
"""

from gauss import math
from gauss.codegen import Function, Scalar, write
from gauss.system import System

REST_STEPS = 2.0  # steps: a gap that closes no faster than by its acceleration in so many is at rest, without impact
REMOVAL = 0.1  # of the scale of times: time in which penetration is removed where steps have many lengths


def is_impact(width, rate, speed, h, share):
    """Whether gaps close within the rest of a step faster than at rest; numbers, arrays or expressions."""
    return _both(width + (1.0 - share) * h * rate <= 0.0, rate < -speed)


def _both(one, other):
    return math.where(one, math.where(other, 1.0, 0.0), 0.0)


def least_rate(width, rate, restitution: Scalar, h, rest, share, removal, closed=0.0):
    """Least rate of a gap after a step; numbers, arrays or expressions.

    Parameters
    ----------
    width, rate
        The gap, and its rate before the step.
    restitution : float or Expression
        Coefficient of restitution.
    h : float
        Length of the step [s].
    rest : float
        Rate below which a gap neither opens nor closes.
    share : float
        Share of the step before.
    removal : float
        Time in which penetration is removed [s], a step at least: without oscillation.
    closed : float
        Above 0 for a gap that is closed and stays so: then also what is left of it closes in that time.
    """
    stays = isinstance(closed, float) and not closed
    opened = width > 0.0 if stays else _both(width > 0.0, closed <= 0.0) > 0.0
    shut = math.where(opened, -width / ((1.0 - share) * h), -width / removal)
    if isinstance(restitution, float) and not restitution:
        return shut
    hit = _both(width + h * rate <= 0.0, rate < -rest)
    return math.where(hit > share, -restitution * rate, shut)


def gap_after(width, rate, curvature, time):
    """Gap after a time, from its rate and its second derivative; numbers, arrays or expressions."""
    return width + time * (rate + 0.5 * time * curvature)


def gap_to_close(width, curvature, time, most):
    """Gap after a time at whose end its rate is zero: what is left to close; numbers, arrays or expressions.

    Curvatures that bend the gap by more than ``most``, in its unit, tell nothing of the step: bodies turn too far in it.
    """
    left = gap_after(width, -time * curvature, curvature, time)
    return math.where(math.abs(left - width) > most, width, left)


def removal_time(system: System) -> float:
    """Time in which penetration is removed where steps have many lengths [s]."""
    return REMOVAL * system.scale.time


def laws_of_gaps() -> tuple[Function, Function, Function, Function]:
    """Traced: whether a gap has an impact, its least rates after a step, without and with restitution, what is left."""
    return (
        write(lambda x: [is_impact(*x)], 5, name="impact"),
        write(lambda x: [least_rate(x[0], x[1], 0.0, *x[2:])], 7, name="plastic"),
        write(lambda x: [least_rate(*x)], 8, name="elastic"),
        write(lambda x: [gap_to_close(*x)], 4, name="to_close"),
    )


def gap_prediction() -> Function:
    """Traced function of :func:`gap_after`."""
    return write(lambda x: [gap_after(*x)], 4, name="gap_after")
