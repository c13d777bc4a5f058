"""Step-size rule of damped Newton methods: the first of the shares 1, 1/2, 1/4, … of a step whose result is accepted."""

from collections.abc import Callable
from typing import TypeVar

Trial = TypeVar("Trial")


def first_accepted(trial_at: Callable[[float], Trial], accepted: Callable[[Trial], bool], smallest: float) -> Trial | None:
    """First accepted trial; None if there is none down to the smallest share.

    Parameters
    ----------
    trial_at : callable
        Share of the step → trial.
    accepted : callable
        Whether a trial lowers the residual.
    smallest : float
        Smallest share of the step.
    """
    share = 1.0
    while share >= smallest:
        trial = trial_at(share)
        if accepted(trial):
            return trial
        share /= 2
    return None
