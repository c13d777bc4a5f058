from gauss.analysis.optimal.ilqr import FeedbackMotion, ilqr
from gauss.analysis.optimal.optimal_motion import optimal_motion
from gauss.analysis.optimal.result import OptimalMotion

__all__ = [
    "FeedbackMotion",
    "OptimalMotion",
    "ilqr",
    "optimal_motion",
]
