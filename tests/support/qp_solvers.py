"""QP solvers that are right or wrong, and rows of the comparison."""

import numpy as np
import qpsolvers

from gauss.backends.programme import Outcome

GOOD = {
    "backend": "one",
    "level": "high",
    "form": "F2s",
    "problem": "a",
    "group": "equality",
    "outcome": "answered",
    "claimed": True,
    "seconds": 1e-3,
    "error": 1e-10,
    "primal": 1e-12,
    "dual": 1e-12,
    "gap": 1e-12,
    "excess": 1e-3,
    "reason": "",
}
BEYOND = {"primal": 1e-6, "excess": 1e3}  # residuals above the tolerance
ROUNDED = {"primal": 1e-6, "excess": 0.5}  # above the tolerance, but not above rounding
NO_FIGURES = {"error": np.nan, "primal": np.nan, "dual": np.nan, "gap": np.nan, "excess": np.nan}


class Perfect:
    """A solver of one's own that is right."""

    def __call__(self, programme):
        H, C = programme.H.toarray(), programme.C.toarray()
        x = qpsolvers.solve_qp(H, programme.c, A=C, b=programme.d, solver="daqp")
        y = np.linalg.lstsq(C.T, -H @ x - programme.c, rcond=None)[0]
        return Outcome(x, y, np.zeros(0), True, "solved")


class LiarInX(Perfect):
    """It is off by a percent."""

    def __call__(self, programme):
        found = super().__call__(programme)
        return Outcome(1.01 * found.x, found.y, found.z, True, "solved")


class LiarInY(Perfect):
    """Its multipliers are none."""

    def __call__(self, programme):
        return Outcome(super().__call__(programme).x, None, None, True, "solved")


class WrongShape:
    """It returns too much."""

    def __call__(self, programme):
        return Outcome(np.zeros(programme.c.size + 1), None, None, True, "solved")


class NotANumber:
    """It returns nan."""

    def __call__(self, programme):
        return Outcome(np.full(programme.c.size, np.nan), None, None, True, "solved")


class LiarWithoutMultipliers(Perfect):
    """Its multipliers are not finite."""

    def __call__(self, programme):
        found = super().__call__(programme)
        return Outcome(found.x, np.nan * found.y, found.z, True, "solved")


class Changes:
    """It makes zero right by changing what is asked."""

    def __call__(self, programme):
        for part in (programme.H.data, programme.C.data, programme.K.data, programme.c, programme.d, programme.k):
            part[:] = 0.0
        return SaysSolved()(programme)


class ClaimsInWords(Perfect):
    """What it claims is neither True nor False."""

    def __call__(self, programme):
        found = super().__call__(programme)
        object.__setattr__(found, "found", "no")  # past the types that are checked here
        return found


class Raises:
    """It fails."""

    def __call__(self, programme):
        raise RuntimeError("broken")


class SaysSolved:
    """It calls anything solved, at zero."""

    def __call__(self, programme):
        x, y, z = (np.zeros(part.size) for part in (programme.c, programme.d, programme.k))
        return Outcome(x, y, z, True, "solved")
