"""Time stepping with Coulomb friction: impacts, sliding and sticking within steps of one length, by convex problems.

One step h from velocities (v, q̇) takes the mean accelerations x = (a, q̈) that minimise the compulsion under the rows of the
joints and, for each gap d with sliding s, the cone of maximal dissipation as a pyramid of facets t_k:

    ḋ⁺ + μ t_kᵀ s⁺ ≥ −d/h − μ σ,    ḋ⁺ = ḋ + h (J x − D),    s⁺ = s + h (J_s x − D_s),

whose multipliers λ_k ≥ 0 are forces: Σ λ_k along the normal, and friction μ Σ λ_k t_k across it. A gap that closes within
the step opens with e times its speed (Moreau 1988; Stewart, Trinkle 1996). With σ = 0 this is the convex step of Anitescu
(2006), which always has an answer; but Coulomb's law is the minimum of no function, and while a contact slides this answer
keeps a gap of h μ |s|. The law is met where σ = |s⁺| (De Saxcé, Feng 1998), which a few convex steps find, each with the
sliding of the last; where they do not settle, the convex step is taken, and counted.

The method is of order h. Sticking friction falls short of μ N by up to 1 − cos(π / FACETS) between two facets.
"""

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.assembly import Applied, Gaps, Motion, Slips, assemble_motion, gaps, kinematics, slips, unseen_overlap
from gauss.compulsion import Compulsion, Solution
from gauss.dynamics.impact import certified, resting
from gauss.dynamics.paradox import sliding_paradoxes
from gauss.dynamics.solver import Solver
from gauss.errors import PainleveWarning, SimulationError
from gauss.integrators import Cost, FixedStep, Point, Rates
from gauss.simulation.run import Run
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System, retract

FACETS = 16  # of the pyramid of friction; one of them looks along the sliding
STILL = 1e-9  # m/s: slower sliding has no direction
ITERATIONS = 40  # convex steps that look for the sliding
DEPTH = 5  # tries that the next one is extrapolated from
ROUNDING = 1e-9  # of a step, by which times may miss their grid
SETTLED = 1e-9  # m/s, times 1 + the sliding: change that ends them


class Step(NamedTuple):
    """What happens over one step.

    Attributes
    ----------
    solution : Solution
        Mean accelerations.
    normal : ndarray, shape (m,)
        Mean forces that press the gaps open, impulses of impacts included [N].
    friction : ndarray, shape (m, 3)
        Mean forces of friction on the first body of each contact, in world axes [N].
    settled : bool
        Whether Coulomb's law is met; else it is the convex step.
    """

    solution: Solution
    normal: np.ndarray
    friction: np.ndarray
    settled: bool


class SteppedRun(Run):
    """Simulation by time stepping while it runs; a Run of which each evaluation is a whole step.

    Parameters
    ----------
    system : System
        What moves.
    backend : str
        How the convex problems are solved.
    step, end : float
        Length of a step, and when to stop [s].
    """

    def __init__(self, system: System, backend: str, step: float, end: float):
        super().__init__(system, TIME_STEPPING, Solver(), None, step, end)
        self.backend, self.relaxed, self.known = backend, 0, frozenset()

    def evaluate(self, state: State) -> Rates:
        """Mean accelerations and powers over a step from a state."""
        return self._over(state, self.step)

    def _over(self, state: State, h: float) -> Rates:
        motion = kinematics(self.system, state)
        applied = Applied(motion)
        problem = assemble_motion(motion, applied)
        step = coulomb_step(motion, problem, h, self.backend)
        solution = step.solution
        self.relaxed += not step.settled
        self.solver.evaluations += 1
        self.solver.worst_error = max(self.solver.worst_error, solution.certificate.error)
        if self.system.slips.placed:
            self._warn(sliding_paradoxes(motion, problem, np.flatnonzero(step.normal > 0.0)), state.t)
        force = -solution.compulsion.G.T @ solution.inequality_multipliers
        velocities = np.concatenate([motion.quasi_velocities(), state.v])
        lost = -force @ (velocities + 0.5 * h * np.concatenate([solution.a, solution.qdd]))
        driven = applied.driven - solution.multipliers @ problem.C
        return Rates(solution.qdd, np.array([driven, applied.loaded, applied.dissipated + lost]))

    def _warn(self, found, t: float):
        """Tell of Painlevé's paradox, once for each set of gaps."""
        for paradox in found:
            if paradox.gaps not in self.known:
                self.known |= {paradox.gaps}
                warnings.warn(
                    f"t = {t:.6g} s: {paradox}. The step goes on with an impulse that satisfies the law at its end.",
                    PainleveWarning,
                    stacklevel=2,
                )

    def over(self, point: Point, h: float) -> Rates:
        """Rates of a point over a step from there."""
        usual = np.isclose(h, self.step, rtol=ROUNDING, atol=0.0)
        return point.rates if usual else self._over(point.state, h)

    def _settled(self, point: Point, t: float) -> Point:
        """Point reached by a step, on the constraints of the joints again, with the rates of the step that follows."""
        state = self.settle(replace(point.state, t=t))
        return Point(state, point.work, self.evaluate(state) if t < self.end else point.rates)

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        whole = super()._trajectory(kept, samples, began)
        relaxed = f", {self.relaxed} of them by the convex relaxation of Coulomb's law" if self.relaxed else ""
        stats = replace(whole.stats, method=f"time stepping of {self.step:g} s, every step certified{relaxed}")
        return replace(whole, stats=stats, step=self.step)


def time_step(run: SteppedRun, point: Point, h: float) -> tuple[Point, Cost]:
    """One step: rates first, then coordinates with the new rates."""
    rates = run.over(point, h)
    v = point.state.v + h * rates.acceleration
    moved = State(point.state.t + h, retract(run.system, point.state.q, h * v), v)
    return Point(moved, point.work + h * np.asarray(rates.power), rates), Cost(1)


TIME_STEPPING = FixedStep(
    "time_stepping", "time stepping with contacts and friction", 1, "Moreau 1988; Anitescu 2006", 1, time_step
)


def coulomb_step(motion: Motion, problem: Compulsion, h: float, backend: str) -> Step:
    """Mean accelerations of a step h and the forces of its contacts.

    Raises
    ------
    SimulationError
        If an answer is not certified.
    """
    gap, slip = gaps(motion), slips(motion)
    refuse_overlap(motion, gap)
    slowest = least_rates(motion.system, motion.state, gap, h)
    what = f"step at t = {motion.state.t:.6g} s"

    def convex(sliding, lift, slip=slip):
        G, rhs = step_rows(gap, slip, slowest, sliding, lift, h)
        solution = certified(replace(problem, G=G, h=rhs), backend, what)
        return solution, slip.rate + h * (slip.J @ np.concatenate([solution.a, solution.qdd]) - slip.D)

    sliding, tries, settled = slip.rate, [], False
    still = np.hypot(*sliding.T) <= STILL
    if still.any():  # what rests begins to slide about where it would without friction
        smooth = slip._replace(friction=np.zeros_like(slip.friction))
        _, free = convex(sliding, np.zeros(len(sliding)), smooth)
        onset = 2.0 * STILL / np.maximum(np.hypot(*free.T), STILL)
        sliding = np.where(still[:, None], onset[:, None] * free, sliding)
    for _ in range(ITERATIONS):
        solution, found = convex(sliding, np.hypot(*sliding.T))
        change = found - sliding
        settled = bool((np.abs(change) <= SETTLED * (1.0 + np.abs(found))).all())
        if settled:
            break
        tries = [*tries[-DEPTH:], (found, change)]
        sliding = _next_try(tries)
    if not settled:
        sliding = slip.rate
        solution, _ = convex(sliding, np.zeros(len(sliding)))
    return Step(solution, *_forces(motion, gap, slip, sliding, solution), settled)


def refuse_overlap(motion: Motion, gap: Gaps):
    """Raise a SimulationError where boxes are in each other and no gap tells the way out."""
    unseen = unseen_overlap(motion, gap)
    if unseen is not None:
        name, depth = unseen
        raise SimulationError(
            f"t = {motion.state.t:.6g} s: shapes are {depth:.3g} m in each other, and no gap of {name!r} leads out; "
            "move them apart with scene.start, or shorten the step."
        )


def _next_try(tries) -> np.ndarray:
    """Next sliding to try, extrapolated from what was found and how much it changed (Anderson 1965)."""
    (found, change), before = tries[-1], tries[:-1]
    if not before:
        return found
    turns = np.array([(change - old).ravel() for _, old in before]).T
    moves = np.array([(found - old).ravel() for old, _ in before]).T
    shares = np.linalg.lstsq(turns, change.ravel(), rcond=None)[0]
    return found - (moves @ shares).reshape(found.shape)


def _forces(motion: Motion, gap: Gaps, slip: Slips, sliding: np.ndarray, solution: Solution):
    """Normal forces (m,), and forces of friction (m, 3), of the multipliers of a step."""
    multipliers, m = solution.inequality_multipliers, len(gap.width)
    normal, friction = np.zeros(m), np.zeros((m, 3))
    smooth = np.setdiff1d(np.arange(m), slip.gap)
    normal[smooth] = multipliers[: smooth.size]
    for k, pushed in enumerate(multipliers[smooth.size :].reshape(-1, FACETS)):
        i = slip.gap[k]
        normal[i] = pushed.sum()
        friction[i] = slip.friction[k] * pushed @ facets(sliding[k]) @ slip.axes[k]
    return normal, friction


def least_rates(system: System, state: State, gap: Gaps, h: float) -> np.ndarray:
    """Least rates (m,) with which the gaps may change over a step: back by its restitution if one is hit, else shut."""
    e = np.array([contact.restitution for contact in system.scene.contacts.values() for _ in contact.sides(system.scene)])
    hit = (gap.width + h * gap.rate <= 0.0) & (gap.rate < -resting(state)) & (e > 0.0)
    return np.where(hit, -e * gap.rate, -gap.width / h)


def step_rows(gap: Gaps, slip: Slips, slowest: np.ndarray, sliding: np.ndarray, lift: np.ndarray, h: float):
    """Rows G x ≤ rhs of all gaps over a step: one of a smooth gap, a pyramid of one with friction."""
    rows, rhs = -gap.J, (gap.rate - slowest) / h - gap.D
    smooth = np.setdiff1d(np.arange(len(rhs)), slip.gap)
    all_rows, all_rhs = [rows[smooth]], [rhs[smooth]]
    for k, i in enumerate(slip.gap):
        t = slip.friction[k] * facets(sliding[k])
        all_rows.append(rows[i] - t @ slip.J[k])
        all_rhs.append(rhs[i] + t @ (slip.rate[k] / h - slip.D[k]) + slip.friction[k] * lift[k] / h)
    return np.concatenate(all_rows), np.concatenate(all_rhs)


def facets(sliding: np.ndarray) -> np.ndarray:
    """Directions (FACETS, 2) in the tangent plane, the first along the sliding."""
    begin = np.arctan2(sliding[1], sliding[0]) if np.hypot(*sliding) > STILL else 0.0
    angles = begin + 2.0 * np.pi * np.arange(FACETS) / FACETS
    return np.column_stack([np.cos(angles), np.sin(angles)])
