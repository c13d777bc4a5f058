"""Location of events: zero crossings of gap functions within a step, short visits and widths of rounding."""

import numpy as np
import pytest

from gauss.simulation.phases.event_location import first_hit

ROUNDING = 1e-12


def test_a_short_visit_within_one_step_is_seen():
    """A gap t² − 2 t + 0.99 is below zero between 0.9 and 1.1 only."""

    def at(t):
        return np.array([[t * t - 2 * t + 0.99], [2 * t - 2]])

    t, which = first_hit(at, 0.0, 5.0, np.array([0]))
    assert (t, which) == (pytest.approx(0.9, abs=ROUNDING), 0)


@pytest.mark.parametrize("begin", [-4e-17, 0.0, 4e-17, 1e-12])
def test_a_gap_that_opens_from_a_width_of_rounding_closes_at_the_end_of_its_bounce(begin):
    def at(t):  # closes again after 2 ms, long before the second look at 125 ms
        rounding = 1e-16 if 0.0 < t < 1e-13 else 0.0
        return np.array([[begin - rounding + 1e-3 * t - 0.5 * t * t], [1e-3 - t]])

    t, which = first_hit(at, 0.0, 1.0, np.array([0]))
    assert which == 0 and t == pytest.approx(2e-3, abs=max(2e3 * begin, 1e-12))
