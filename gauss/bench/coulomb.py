"""Solvers of contact problems with Coulomb's law: u = W r + q, K* ∋ u + μ |u_t| n ⊥ r ∈ K.

* newton: the semismooth Newton method of gauss's time stepping, from projected Gauss–Seidel iterations, in machine code;
* gauss_seidel: projections contact by contact (Jourdan, Alart, Jean 1998), with De Saxcé's correction of the velocity;
* admm: alternating directions of multipliers with the same correction (Le Lidec et al. 2024), penalty by the spectrum of W;
* staggered: cone programmes whose correction μ |u_t| is that of the one before (Cadoux 2009), each by Clarabel.

The last three are short references in Python: their answers compare, their times are those of Python. MuJoCo's solvers have
the convex step without De Saxcé's correction, see :mod:`gauss.bench.mujoco_`.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from gauss.backends.accuracy import tolerances
from gauss.backends.programme import Outcome
from gauss.bench import conic
from gauss.bench.clocks import cpu_time
from gauss.bench.ready import Ready
from gauss.bench.structured import ProgrammeStructure, StructuredProgramme
from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem
from gauss.errors import SimulationError

INNER = 1e-2  # tolerance of the cone programmes of the staggered iteration, relative to its own
LOOK_EVERY = 10  # iterations after which residuals are looked at
PROXIMAL = 1e-6  # weight η of the proximal term of ADMM, of the largest eigenvalue of W
BALANCE, FACTOR = 10.0, 2.0  # of primal and dual residual that changes the penalty of ADMM, and by how much
Solve = Callable[[], Outcome]


def installed() -> list[str]:
    """Names of the solvers that are here."""
    return [name for name in SOLVERS if name != "staggered" or find_spec("clarabel")]


def ready(solver: str, programme: StructuredProgramme, settings: dict) -> Ready:
    """A solver with its problem; the call starts at zero forces."""
    return Ready(SOLVERS[solver](programme, **settings), lambda found: found)


def projected(r: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Nearest forces (c, 3) within the cones |r_t| ≤ μ r_n."""
    size = np.hypot(r[:, 1], r[:, 2])
    inside, apex = size <= friction * r[:, 0], friction * size <= -r[:, 0]
    height = np.where(apex, 0.0, (r[:, 0] + friction * size) / (1.0 + friction**2))
    share = friction * height / np.where(size > 0.0, size, 1.0)
    return np.where(inside[:, None], r, np.column_stack([height, share * r[:, 1], share * r[:, 2]]))


def corrected(u: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Velocities (c, 3) with De Saxcé's μ |u_t| added along the normals."""
    return np.column_stack([u[:, 0] + friction * np.hypot(u[:, 1], u[:, 2]), u[:, 1:]])


def _newton(p: StructuredProgramme) -> Solve:
    count = len(p.structure.friction)
    order = np.concatenate([3 * np.arange(count), np.column_stack([3 * np.arange(count) + k for k in (1, 2)]).ravel()])
    across = count + np.arange(2 * count).reshape(count, 2)
    nothing = np.zeros(0)
    friction = np.array(p.structure.friction)
    laws = ContactLaws(np.arange(count), across, np.arange(count), friction, nothing.astype(int), nothing)
    problem = ContactProblem(p.H.toarray()[np.ix_(order, order)], p.c[order], laws)

    def solve() -> Outcome:
        try:
            found, left = problem.solve(np.zeros(p.c.size))
        except SimulationError as error:
            return Outcome(None, None, None, False, f"newton: {error}")
        r = np.empty(p.c.size)
        r[order] = found
        return Outcome(r, None, None, left is not None, "newton: solved" if left is not None else "newton: convex law only")

    return solve


def _gauss_seidel(p: StructuredProgramme, *, tolerance: float, iterations: int, seconds: float) -> Solve:
    W, friction = p.H.toarray(), np.array(p.structure.friction)
    places = [slice(3 * i, 3 * i + 3) for i in range(friction.size)]
    steps = [1.0 / np.linalg.eigvalsh(W[place, place])[-1] for place in places]

    def sweep(state):
        (r,) = state
        for i, place in enumerate(places):
            u = (W[place] @ r + p.c[place])[None]
            r[place] = projected(r[place] - steps[i] * corrected(u, friction[i : i + 1]), friction[i : i + 1])[0]
        return r, (r,)

    return lambda: _iterated("gauss_seidel", p, sweep, (np.zeros(p.c.size),), tolerance, iterations, seconds)


def _admm(p: StructuredProgramme, *, tolerance: float, iterations: int, seconds: float) -> Solve:
    W, friction = p.H.toarray(), np.array(p.structure.friction)

    def solve() -> Outcome:
        spectrum, eye = np.linalg.eigvalsh(W), np.eye(p.c.size)
        eta = PROXIMAL * spectrum[-1]
        start = np.zeros(p.c.size)
        penalty = float(np.sqrt(spectrum[-1] * max(spectrum[0], eta)))
        state = start, start, start, penalty, cho_factor(W + (eta + penalty) * eye), 0

        def step(state):
            x, z, v, penalty, factor, count = state
            correction = corrected(v.reshape(-1, 3), friction).ravel() - v
            x = cho_solve(factor, eta * x + penalty * z + v - p.c - correction)
            before, z = z, projected((x - v / penalty).reshape(-1, 3), friction).ravel()
            v = v - penalty * (x - z)
            primal, dual = np.abs(x - z).max(), penalty * np.abs(z - before).max()
            if count % LOOK_EVERY == 0 and max(primal, dual) > BALANCE * min(primal, dual):
                penalty *= FACTOR if primal > dual else 1.0 / FACTOR
                factor = cho_factor(W + (eta + penalty) * eye)
            return z, (x, z, v, penalty, factor, count + 1)

        return _iterated("admm", p, step, state, tolerance, iterations, seconds)

    return solve


def _iterated(name: str, p: StructuredProgramme, step, state, tolerance: float, iterations: int, seconds: float) -> Outcome:
    """Iterations ``step(state) -> (forces, state)`` until the residuals are within the tolerance, or a limit is met."""
    end = cpu_time() + seconds
    r = np.zeros(p.c.size)
    for count in range(1, iterations + 1):
        r, state = step(state)
        if count % LOOK_EVERY == 0:
            if _residual(p, r) <= tolerance:
                return Outcome(r.copy(), None, None, True, f"{name}: solved", count)
            if cpu_time() > end:
                return Outcome(r.copy(), None, None, False, f"{name}: time limit", count)
    return Outcome(r.copy(), None, None, False, f"{name}: iteration limit", iterations)


def _staggered(p: StructuredProgramme, *, tolerance: float, iterations: int, seconds: float) -> Solve:
    inner = tolerances("clarabel", INNER * tolerance, 0.0)
    convex = replace(p, structure=ProgrammeStructure(cones=p.structure.cones))
    friction = np.array(p.structure.friction)

    def solve() -> Outcome:
        end, sliding = cpu_time() + seconds, np.zeros(p.c.size)
        for count in range(1, iterations + 1):
            cones = conic.ready("clarabel", replace(convex, c=p.c + sliding), inner)
            r = cones.read(cones.call()).x
            if r is None:
                return Outcome(None, None, None, False, "staggered: no forces", count)
            if _residual(p, r) <= tolerance:
                return Outcome(r, None, None, True, "staggered: solved", count)
            if cpu_time() > end:
                return Outcome(r, None, None, False, "staggered: time limit", count)
            u = (p.H @ r + p.c).reshape(-1, 3)
            sliding = corrected(u, friction).ravel() - u.ravel()
        return Outcome(r, None, None, False, "staggered: iteration limit", iterations)

    return solve


def _residual(p: StructuredProgramme, r: np.ndarray) -> float:
    nothing = np.zeros(0)
    return max(p.residuals(r, *p.multipliers(r, nothing, nothing)))


SOLVERS: dict[str, Callable[..., Solve]] = {
    "newton": _newton,
    "gauss_seidel": _gauss_seidel,
    "admm": _admm,
    "staggered": _staggered,
}
