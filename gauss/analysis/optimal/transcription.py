"""Direct collocation as a nonlinear programme, and its solution by IPOPT.

In each interval [t_k, t_k + h_k] the rates are collocated at s Gauss–Legendre points (order 2 s), inputs are linear in time
between their values at its ends, so that they keep their limits:

    z_i = x_k + h Σ a_ij f(z_j, u_j),   x_{k+1} = x_k + h Σ b_j f(z_j, u_j) + Fₓ(x_{k+1})ᵀ μ_k,   F(x_{k+1}) = 0.

With loops, μ_k are multipliers of the constraints that project the end of the interval onto them: the motion does not drift
off (Bordalba, Schoels, Ros, Porta and Diehl, Direct collocation methods for trajectory optimization in constrained robotic
systems, IEEE Trans. Robotics 39, 2023). Betts, Practical Methods for Optimal Control, 3rd ed., 2020, ch. 4; Wächter and
Biegler, Math. Program. 106, 2006 (IPOPT).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gauss.analysis.optimal.conditions import EndCondition
from gauss.analysis.optimal.equations import Casadi, OptimalEquations
from gauss.integrators.collocation import gauss_legendre

SUCCEEDED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
LARGEST_PROJECTION = 0.1  # multiplier of a projection, in shares of the units: larger ones reach another branch of a loop
LARGEST_MISS = 1e6  # of a relaxed condition, in shares of the unit
TOLERANCE = 1e-9  # of IPOPT, on its scaled problem


@dataclass(frozen=True)
class MotionProblem:
    """What is to be optimal.

    Parameters
    ----------
    equations : OptimalEquations
        Equations of motion.
    cost : casadi.Function or None
        (t, x, u) → cost per time; None: the duration is the cost.
    start_time : float
        When the motion begins [s].
    duration : tuple of float
        Least and largest duration [s].
    start, end, increments : tuple of EndCondition
        Conditions on the start, on the end, and on what the end is more than the start.
    bounds : tuple of ndarray
        Least and largest (q, v), least and largest inputs.
    stages : int
        Collocation points s of an interval.
    iterations : int
        Most iterations.
    reset : casadi.Function or None
        (t, x, u) → state after an impact at the end, to which the increments refer; None: there is none.
    meets : casadi.Function or None
        (t, x, u) → what is zero at the end, one number for each condition of ``meeting``.
    meeting : tuple of EndCondition
        Their names.
    """

    equations: OptimalEquations
    cost: Casadi
    start_time: float
    duration: tuple[float, float]
    start: tuple[EndCondition, ...]
    end: tuple[EndCondition, ...]
    increments: tuple[EndCondition, ...]
    bounds: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    stages: int
    iterations: int
    reset: Casadi = None
    meets: Casadi = None
    meeting: tuple[EndCondition, ...] = ()

    @property
    def units(self) -> np.ndarray:
        """Units of the places of all conditions: those of (q, v), and 1 for what is met at the end."""
        return np.concatenate([self.equations.units, np.ones(len(self.meeting))])

    @property
    def conditions(self) -> list[tuple[str, EndCondition]]:
        """All conditions on the ends, in the order of their rows."""
        kinds = {
            "start": self.start,
            "end": self.end,
            "increase over the period": self.increments,
            "at the end": self.meeting,
        }
        return [(kind, one) for kind, given in kinds.items() for one in given]


@dataclass(frozen=True)
class MotionValues:
    """Values of a motion on a mesh, in shares of the units.

    Parameters
    ----------
    mesh : ndarray, shape (n + 1,)
        Mesh from 0 to 1.
    x : ndarray, shape (n_x, n + 1)
        States at the mesh points.
    z : ndarray, shape (s, n_x, n)
        States at the collocation points.
    u : ndarray, shape (2, n_u, n)
        Inputs at begin and end of the intervals.
    duration : float
        Duration [s].
    """

    mesh: np.ndarray
    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    duration: float

    def on(self, mesh: np.ndarray, stages: int) -> "MotionValues":
        """The same motion on another mesh, interpolated."""
        c = gauss_legendre(stages).c
        own = gauss_legendre(len(self.z)).c
        inner = self.mesh[:-1] + np.diff(self.mesh) * own[:, None]
        places, order = np.unique(np.concatenate([self.mesh, inner.ravel()]), return_index=True)
        samples = np.concatenate([self.x, np.moveaxis(self.z, 0, 1).reshape(len(self.x), -1)], axis=1)[:, order]
        at = lambda points: np.array([np.interp(points, places, row) for row in samples])  # noqa: E731
        begins, ends = mesh[:-1], mesh[1:]
        middle = np.clip(np.searchsorted(self.mesh, (begins + ends) / 2.0) - 1, 0, len(self.mesh) - 2)
        low, width = self.mesh[middle], np.diff(self.mesh)[middle]
        share = np.clip([(begins - low) / width, (ends - low) / width], 0.0, 1.0)[:, None]
        u = (1.0 - share) * self.u[0][:, middle] + share * self.u[1][:, middle]
        z = np.array([at(begins + (ends - begins) * node) for node in c])
        return replace(self, mesh=mesh, x=at(mesh), z=z, u=u)


@dataclass(frozen=True)
class Solved:
    """Answer of IPOPT.

    Parameters
    ----------
    values : MotionValues
        The motion.
    cost : float
        Its cost.
    status : str
        Status in the words of IPOPT.
    iterations : int
        Iterations.
    kkt, residual : float
        Largest entry of the gradient of the Lagrangian, relative to the largest multiplier or 1, and largest residual of a
        constraint, both in shares of the units.
    misses : ndarray
        What the conditions on the ends are missed by, in shares of the units; zero unless they were relaxed.
    """

    values: MotionValues
    cost: float
    status: str
    iterations: int
    kkt: float
    residual: float
    misses: np.ndarray

    @property
    def is_optimal(self) -> bool:
        """Whether IPOPT converged."""
        return self.status in SUCCEEDED


class Transcription:
    """A motion problem on one mesh.

    Parameters
    ----------
    problem : MotionProblem
        The problem.
    mesh : ndarray, shape (n + 1,)
        Mesh from 0 to 1.
    rows : list of int
        Independent rows of the constraints.
    relaxed : bool
        Whether conditions on the ends may be missed, which is then the cost.
    """

    def __init__(self, problem: MotionProblem, mesh: np.ndarray, rows: list[int], relaxed: bool = False):
        import casadi

        self.problem, self.mesh, self.rows, self.relaxed = problem, mesh, rows, relaxed
        self.tableau, self.casadi = gauss_legendre(problem.stages), casadi
        n, n_x, n_u, s = len(mesh) - 1, problem.equations.n_x, problem.equations.n_u, problem.stages
        self.sizes = {"x": (n_x, n + 1), "z": (s * n_x, n), "u": (2 * n_u, n), "mu": (len(rows), n), "duration": (1, 1)}
        self.sizes |= {"over": (len(problem.conditions), 1), "under": (len(problem.conditions), 1)} if relaxed else {}
        self.symbols = {name: casadi.MX.sym(name, *shape) for name, shape in self.sizes.items()}
        self.variables = casadi.vertcat(*map(casadi.vec, self.symbols.values()))

    def solve(self, guess: MotionValues) -> Solved:
        """Optimum near a guess on the same mesh."""
        casadi, names = self.casadi, {"x": self.variables, "f": self.objective, "g": self.constraints}
        options = {"print_level": 0, "sb": "yes", "max_iter": self.problem.iterations, "tol": TOLERANCE}
        solver = casadi.nlpsol("motion", "ipopt", names, {"print_time": False, "ipopt": options})
        lowest, highest = self._bounds()
        low, high = self._row_bounds()
        answer = solver(x0=self._packed(guess), lbx=lowest, ubx=highest, lbg=low, ubg=high)
        x, stats = np.array(answer["x"]).ravel(), solver.stats()
        found = self._unpacked(x)
        rows = np.array(answer["g"]).ravel()
        residual = np.maximum(np.maximum(low - rows, rows - high), 0.0).max(initial=0.0)
        values = MotionValues(
            self.mesh,
            found["x"],
            found["z"].reshape(self.problem.stages, -1, len(self.mesh) - 1),
            found["u"].reshape(2, -1, len(self.mesh) - 1),
            float(found["duration"].item()),
        )
        misses = (found["over"] - found["under"]).ravel() if self.relaxed else np.zeros(len(self.problem.conditions))
        kkt = self._stationarity(answer)
        return Solved(values, float(answer["f"]), stats["return_status"], stats["iter_count"], kkt, float(residual), misses)

    def _stationarity(self, answer) -> float:
        """Largest entry of ∇f + ∇g λ + ν, relative to the largest multiplier, or to 1."""
        casadi, multipliers = self.casadi, self.casadi.MX.sym("lambda", self.constraints.size1())
        slope = casadi.gradient(self.objective + casadi.dot(multipliers, self.constraints), self.variables)
        found = casadi.Function("slope", [self.variables, multipliers], [slope])(answer["x"], answer["lam_g"])
        whole = np.array(found + answer["lam_x"]).ravel()
        sizes = [np.abs(np.array(answer[name])).max(initial=0.0) for name in ("lam_g", "lam_x")]
        return float(np.abs(whole).max() / max(1.0, *sizes))

    @cached_property
    def times(self) -> tuple[Casadi, Casadi]:
        """Times of the collocation points (s, n), and of the mesh points (1, n + 1)."""
        duration, start = self.symbols["duration"], self.problem.start_time
        inner = self.mesh[:-1] + np.diff(self.mesh) * self.tableau.c[:, None]
        return start + duration * self.casadi.DM(inner), start + duration * self.casadi.DM(self.mesh).T

    @cached_property
    def inner(self) -> tuple[Casadi, Casadi, Casadi]:
        """Times, states and inputs at all collocation points, a column each."""
        casadi, equations = self.casadi, self.problem.equations
        c, count = self.tableau.c, self.problem.stages * (len(self.mesh) - 1)
        share = casadi.DM(np.kron(np.column_stack([1.0 - c, c]), np.eye(equations.n_u)))
        return (
            casadi.reshape(self.times[0], 1, count),
            casadi.reshape(self.symbols["z"], equations.n_x, count),
            casadi.reshape(casadi.mtimes(share, self.symbols["u"]), equations.n_u, count),
        )

    @property
    def _widths(self) -> Casadi:
        """Lengths of the intervals [s], (1, n)."""
        return self.symbols["duration"] * self.casadi.DM(np.diff(self.mesh)).T

    @cached_property
    def objective(self) -> Casadi:
        """Cost."""
        casadi = self.casadi
        if self.relaxed:
            return casadi.sum1(self.symbols["over"] + self.symbols["under"])
        if self.problem.cost is None:
            return self.symbols["duration"]
        t, z, u = self.inner
        rates = casadi.reshape(self.problem.cost.map(t.size2())(t, z, u), self.problem.stages, len(self.mesh) - 1)
        return casadi.sum2(casadi.mtimes(casadi.DM(self.tableau.b).T, rates) * self._widths)

    @cached_property
    def constraints(self) -> Casadi:
        """Rows of the collocation, of the constraints at the mesh points, and of the conditions on the ends."""
        casadi, s = self.casadi, self.problem.stages
        n, n_x = len(self.mesh) - 1, self.problem.equations.n_x
        x, z, h = self.symbols["x"], self.symbols["z"], self._widths
        rates = casadi.reshape(self.problem.equations.rates.map(s * n)(*self.inner), s * n_x, n)
        unit = np.eye(n_x)
        stages = (
            z
            - casadi.repmat(x[:, :-1], s, 1)
            - casadi.mtimes(casadi.DM(np.kron(self.tableau.a, unit)), rates) * casadi.repmat(h, s * n_x, 1)
        )
        ends = (
            x[:, 1:] - x[:, :-1] - casadi.mtimes(casadi.DM(np.kron(self.tableau.b, unit)), rates) * casadi.repmat(h, n_x, 1)
        )
        parts = [stages, ends]
        if self.rows:
            residuals, correction = self._constraint_functions()
            parts[1] = ends - correction.map(n)(self.times[1][:, 1:], x[:, 1:], self.symbols["mu"])
            parts.append(residuals.map(n + 1)(self.times[1], x))
        return casadi.vertcat(*map(casadi.vec, parts), self._end_rows())

    def _constraint_functions(self) -> tuple[Casadi, Casadi]:
        """(t, x) → F, and (t, x, μ) → Fₓᵀ μ."""
        casadi, equations = self.casadi, self.problem.equations
        t, x, mu = casadi.SX.sym("t"), casadi.SX.sym("x", equations.n_x), casadi.SX.sym("mu", len(self.rows))
        F = equations.residuals(t, x, casadi.SX.zeros(equations.n_u))[self.rows]
        return casadi.Function("F", [t, x], [F]), casadi.Function("project", [t, x, mu], [casadi.jtimes(F, x, mu, True)])

    def _end_rows(self) -> Casadi:
        """Values of the conditions on the ends, in shares of the units."""
        first, last, given = self.symbols["x"][:, 0], self.symbols["x"][:, -1], self.problem
        rows = [first[one.place] for one in given.start] + [last[one.place] for one in given.end]
        still = self.casadi.DM.zeros(given.equations.n_u)
        after = last if given.reset is None else given.reset(self.times[1][0, -1], last, still)
        rows += [after[one.place] - first[one.place] for one in given.increments]
        rows += [] if given.meets is None else [given.meets(self.times[1][0, -1], last, still)]
        found = self.casadi.vertcat(*rows) if rows else self.casadi.MX(0, 1)
        return found + self.symbols["over"] - self.symbols["under"] if self.relaxed else found

    def _row_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the rows: zero, and those of the conditions."""
        units = self.problem.units
        conditions = [one for _, one in self.problem.conditions]
        zeros = np.zeros(self.constraints.size1() - len(conditions))
        low = np.array([one.low / units[one.place] for one in conditions])
        high = np.array([one.high / units[one.place] for one in conditions])
        return np.concatenate([zeros, low]), np.concatenate([zeros, high])

    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the variables."""
        equations, both = self.problem.equations, []
        for x, u, duration, free, slack in zip(
            self.problem.bounds[:2],
            self.problem.bounds[2:],
            self.problem.duration,
            (-LARGEST_PROJECTION, LARGEST_PROJECTION),
            (0.0, 1.0),
            strict=True,
        ):
            state, effort = x / equations.units, u / equations.input_units
            of = {
                "x": state,
                "z": np.tile(state, self.problem.stages),
                "u": np.tile(effort, 2),
                "duration": np.array([duration]),
            }
            of |= {"mu": np.full(len(self.rows), free), "over": slack * self._may_be_missed()}
            of["under"] = of["over"]
            both.append(np.concatenate([np.tile(of[name], shape[1]) for name, shape in self.sizes.items()]))
        return both[0], both[1]

    def _may_be_missed(self) -> np.ndarray:
        """Largest miss of each condition, in shares of the units: none of the start where others can be missed."""
        only_start = len(self.problem.conditions) == len(self.problem.start)
        return np.array([LARGEST_MISS * (only_start or kind != "start") for kind, _ in self.problem.conditions])

    def _packed(self, guess: MotionValues) -> np.ndarray:
        """Variables of a motion."""
        n = len(self.mesh) - 1
        given = {
            "x": guess.x,
            "z": guess.z.reshape(-1, n),
            "u": guess.u.reshape(-1, n),
            "duration": np.array([[guess.duration]]),
        }
        return np.concatenate([given.get(name, np.zeros(shape)).ravel(order="F") for name, shape in self.sizes.items()])

    def _unpacked(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Variables by name."""
        ends = np.cumsum([rows * columns for rows, columns in self.sizes.values()])[:-1]
        parts = np.split(values, ends)
        return {name: part.reshape(shape, order="F") for part, (name, shape) in zip(parts, self.sizes.items(), strict=True)}
