"""Functions of one system with constraints that share its elimination: S = K M⁻¹ Kᵀ and its factors depend on (t, q) alone.

``place`` (t, q) → kinematics, articulated inertias, K, M⁻¹ Kᵀ, S and its factors, once for all functions of a state; the
others take its results first. They are traced from one source, in two stages (:func:`gauss.codegen.staged`).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gauss.codegen import as_number, entered, staged, write
from gauss.dynamics.mechanism import Mechanism, loop_residual
from gauss.system import State

if TYPE_CHECKING:
    from gauss.dynamics.traced_system import Program

MOST_INLINED_OPERATIONS = 500  # of a function: its code is hardly longer than the code of a call
MOST_PLACE_OPERATIONS = 2_500  # of ``place``, up to which what every step runs is inlined: results stay in registers


class SharedElimination:
    """Functions of the states of one system, over expressions.

    ``added``: n_v if generalised forces are added to the loads, else 0.
    """

    def __init__(self, program: "Program", added: int = 0):
        self.program, self.system = program, program.system
        n, m, n_q = self.system.n_v, program.shares.size, self.system.n_q
        self.slack = [[one.joints[index].pair.n_v for index in one.loop_joints] for one in self.system.subsystems]
        gaps = m + sum(map(sum, self.slack))
        later: dict[str, tuple[Callable, tuple[int, ...]]] = {
            "motion": (self._motion, (n, added)),
            "nearest": (self._nearest, (n, m, 1)),
            "newton_step": (self._newton_step, (gaps,)),
            "defect": (self._defect, (n, added, n, m)),
        }
        place, functions = staged(self._eliminated, later, 1, n_q, name="place")
        self._functions = functions | {"place": place, "residual": write(self._residual, 1, n_q, name="loop_residual")}
        self._operations = {name: sum(one.operations().values()) for name, one in self._functions.items()}

    def _found(self, name: str, *given, often: bool = False) -> np.ndarray:
        """Outputs of one of the functions, inlined if it is short, or if it runs often and ``place`` is not long."""
        short = self._operations[name] <= MOST_INLINED_OPERATIONS
        short = short or (often and self._operations["place"] <= MOST_PLACE_OPERATIONS)
        return (self._functions[name].inlined if short else self._functions[name])(*given)

    @property
    def monitors(self) -> bool:
        """Whether the singularity of S depends on the state."""
        return as_number(self._functions["motion"].outputs[-1]) is None

    def place(self, t, q, often: bool = False) -> np.ndarray:
        """Quantities of (t, q) alone that the other functions share."""
        return self._found("place", t, q, often=often)

    def loop_residual(self, t, q) -> np.ndarray:
        """Position residual (m,), then the errors of the coordinates of loop joints."""
        return self._found("residual", t, q)

    def motion(self, place, v, tau=(), often: bool = False) -> list[np.ndarray]:
        """q̈ (n_v,), power of the loads (3,), multipliers (m,), least pivot of S and singularity; forces may be added."""
        found = self._found("motion", place, v, tau, often=often)
        return np.split(found, np.cumsum([self.system.n_v, 3, self.program.shares.size]))

    def nearest(self, place, v, target, moving: float, often: bool = False) -> np.ndarray:
        """Rates x (n_v,) nearest to v in the mass metric with K x = target, plus C if they are those of a motion."""
        return self._found("nearest", place, v, target, [moving], often=often)

    def newton_step(self, place, residual) -> np.ndarray:
        """Displacement (n_v,), the least in the mass metric, that removes a position residual to first order."""
        return self._found("newton_step", place, residual)

    def defect(self, place, v, tau, acceleration, multipliers) -> list[np.ndarray]:
        """Change (n_v,) of accelerations, residual of the constraints (m,), and that damped.

        The nearest change that meets the damped residual is the error of the accelerations.
        """
        n, m = self.system.n_v, self.program.shares.size
        return np.split(self._found("defect", place, v, tau, acceleration, multipliers), np.cumsum([n, m]))

    def _eliminated(self, t, q) -> Mechanism:
        return self.program.elimination(self.system, q, np.zeros(self.system.n_v), t[0]).eliminated()

    def _motion(self, known: Mechanism, v, tau):
        mechanism = known.moving(v)
        own, forces, power = self._loads(known, v, tau)
        acceleration, multipliers = mechanism.motion(own, forces, self.program.feedback(mechanism))
        power = power + np.array([mechanism.power(multipliers), 0.0, 0.0])
        return acceleration, power, multipliers, self.program.monitored(mechanism)

    def _nearest(self, known: Mechanism, v, target, moving):
        return known.nearest(v, target + moving[0] * known.velocity_rhs)

    def _newton_step(self, known: Mechanism, residual):
        m, slack, ends = self.program.shares.size, [], 0
        rest = residual[m:]
        for sizes in self.slack:
            slack.append(np.split(rest[ends : ends + sum(sizes)], np.cumsum(sizes)[:-1]) if sizes else [])
            ends += sum(sizes)
        return known.position_correction(residual[:m], slack)

    def _defect(self, known: Mechanism, v, tau, acceleration, multipliers):
        mechanism = known.moving(v)
        own, forces, _ = self._loads(known, v, tau)
        left, rows = mechanism.residual(acceleration, multipliers, own, forces, self.program.feedback(mechanism))
        damped = mechanism.damped(rows)
        return mechanism.unprojected(left, damped), rows, damped

    def _loads(self, known: Mechanism, v, tau):
        """Generalised forces, forces on bodies and power of the loads, in the later stage: laws may depend on all."""
        t, *q = entered([known.t, *known.q], v)
        own, forces, power = self.program.applied(State(t, np.array(q), v))
        return own + tau if np.size(tau) else own, forces, power

    def _residual(self, t, q):
        phi, slack = loop_residual(self.system, q, t[0])
        return phi, *(part for own in slack for part in own)
