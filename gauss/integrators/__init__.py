"""State, rates → State: steps on the configuration manifold, and their control."""

from gauss.integrators.dop853 import SLOWEST, Dense, Tolerance, Trial, attempt, first_step
from gauss.integrators.fixed import FIXED
from gauss.integrators.step import Chart, Point, Rates

__all__ = ["FIXED", "SLOWEST", "Chart", "Dense", "Point", "Rates", "Tolerance", "Trial", "attempt", "first_step"]
