"""Limits of the step and of its progress in Python and compiled loops, and the messages where they are reached."""

from math import ulp

SMALLEST_STEP = 1e-13  # relative to the duration: below it rounding of time dominates
FIRST_STEPS = 10.0  # smallest steps in a first one: error control may reduce it
LEAST_RESTART_STEP = 1e-6  # relative to the duration: least first step after a switching time; error control reduces it
PROGRESS_TRIALS = 500  # trial steps over which progress is measured
CHATTERING_PROGRESS = 1e-7  # relative to the duration, per PROGRESS_TRIALS, below which a law chatters
SLIDING_CROSSINGS = 0.25  # crossings of switching surfaces per trial step, above which a motion slides along one of them
BUDGET = 4096  # steps of one call of a compiled loop: between calls, the bar moves and Ctrl-C is handled
EVALUATIONS_PER_CHECK = 48  # a check costs as much as two and a half evaluations


def smallest_step(duration: float, end: float) -> float:
    """Smallest step of a motion [s]: large enough to change the time."""
    return max(SMALLEST_STEP * duration, ulp(max(abs(end - duration), abs(end))))


def lasting(h: float, smallest: float) -> float:
    """First step of a length, or a longer one [s]: at rest it follows from the scene alone, whatever the duration."""
    return max(h, FIRST_STEPS * smallest)


def too_small(t: float, rtol: float, laws: tuple[str, ...]) -> str:
    """Message when the step size underflows; the conditions of some laws on the state may be the cause."""
    cause = f", or the law of {', '.join(map(repr, laws))} jumps again and again" if laws else ""
    return (
        f"t = {t:.6g} s: the step size fell below the resolution of time, yet its error exceeds rtol {rtol:g}: "
        f"the motion is singular or very stiff here{cause}. Loosen the tolerance, or look at the motion so far."
    )


def unsolved(t: float) -> str:
    """Message when the iteration of an implicit step does not converge."""
    return f"t = {t:.6g} s: the equations of an implicit step were not solved; shorten the step."


def steps_per_check(evaluations: int) -> int:
    """Steps between two checks of accelerations, of a method with so many evaluations in a step."""
    return max(1, round(EVALUATIONS_PER_CHECK / evaluations))
