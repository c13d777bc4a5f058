"""Radau IIA on the stabilised equations of index 2: constraints on positions and on velocities hold at every stage.

θ̇ = v − Kᵀ μ,  M v̇ = f − Kᵀ λ,  g(q) = 0,  K v = C; the multipliers μ vanish in the exact motion
(Gear, Gupta, Leimkuhler, J. Comput. Appl. Math. 12–13, 1985; Hairer and Wanner, Solving ODEs II, VII.1 and VII.4).
"""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Scalar
from gauss.integrators.generalised_alpha import REGULARISATION, along_free
from gauss.integrators.iterate import newton
from gauss.integrators.radau import A, C, RadauIIA, compared
from gauss.integrators.step import Cost, Mechanics, Point
from gauss.system import State, chart_rate


@dataclass(frozen=True)
class RadauGGL(RadauIIA):
    """Radau IIA with multipliers of the constraints on positions and velocities at every stage."""

    name: str = "radau5 ggl"
    title: str = "Radau IIA, 3 stages, stabilised index 2"
    reference: str = "Gear, Gupta, Leimkuhler 1985; Hairer, Wanner, Solving ODEs II, 2nd ed., VII.4"
    evaluations: int = 160
    mechanical: bool = True

    def _step(  # type: ignore[override]  # the drivers give mechanical methods the mechanics
        self, mechanics: Mechanics, point: Point, h: Scalar
    ) -> tuple[Point, np.ndarray, Cost]:
        """End of the step, slopes (3, 2 n_v) of (θ, v), and the cost."""
        system, state, spread = mechanics.system, point.state, mechanics.spread
        scale, n, s = mechanics.mechanism(state).scale, spread.shape[1], len(C)
        m, share = scale.size, np.sum(spread**2, axis=0)

        def stages(x):
            """Increments of θ and v (s, n_v), chart coordinates θ, rates v, multipliers μ and λ of all stages."""
            moved = x.reshape(s, -1)
            turned, gained = moved[:, :n] @ spread.T, moved[:, n : 2 * n] @ spread.T
            return turned, gained, A @ turned, state.v + A @ gained, moved[:, 2 * n : 2 * n + m], moved[:, 2 * n + m :]

        def residual(x):
            rows = []
            for c, turned, gained, theta, v, y, z in zip(C, *stages(x), strict=True):
                t = state.t + c * h
                forces, violation = mechanics.residual(t, state.q, theta, v, gained / h, scale * y / h)
                velocity, pull = (
                    mechanics.velocity_violation(t, state.q, theta, v),
                    mechanics.reaction(t, state.q, theta, scale * z)[0],
                )
                drift = turned - h * chart_rate(system, theta, v) - pull
                rows += [spread.T @ drift / share, h * (spread.T @ forces), scale * velocity, scale * violation / h]
            return np.concatenate(rows)

        first = [spread.T @ state.v / share, spread.T @ point.rates.acceleration / share, np.zeros(2 * m)]
        softness = np.tile(np.concatenate([np.zeros(2 * n), np.full(2 * m, -REGULARISATION)]), s)
        size, units = compared(system, state)
        free = [along_free(spread, part) for part in np.split(units, 2)]
        units = np.tile(np.concatenate([*free, np.ones(2 * m)]), s)
        found = newton(residual, np.tile(h * np.concatenate(first), s), size, units, softness)
        _, _, theta, v, _, _ = stages(found.x)
        states = [mechanics.tracked(state.t + c * h, state.q, *at) for c, *at in zip(C, theta, v, strict=True)]
        rates = [mechanics.evaluate(at) for at in states]
        slopes = [
            np.concatenate([chart_rate(system, place, at.v), one.acceleration])
            for place, at, one in zip(theta, states, rates, strict=True)
        ]
        end = State(state.t + h, states[-1].q, states[-1].v)
        work = point.work + h * (A[-1] @ np.array([one.power for one in rates]))
        cost = Cost(s * (found.calls + 1), found.factorisations, found.unsolved)
        return Point(end, work, rates[-1]), np.array(slopes), cost
