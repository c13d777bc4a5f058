from gauss.analysis.optimal.hybrid_motion import HybridMotion, optimal_hybrid_motion
from gauss.analysis.optimal.ilqr import FeedbackMotion, ilqr
from gauss.analysis.optimal.optimal_motion import optimal_motion
from gauss.analysis.optimal.phases import MotionPhase
from gauss.analysis.optimal.result import OptimalMotion

__all__ = [
    "FeedbackMotion",
    "HybridMotion",
    "MotionPhase",
    "OptimalMotion",
    "ilqr",
    "optimal_hybrid_motion",
    "optimal_motion",
]
