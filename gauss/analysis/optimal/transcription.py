"""Direct collocation of one phase: the variables and rows of a nonlinear programme.

In each interval [t_k, t_k + h_k] the rates are collocated at s Gauss–Legendre points (order 2 s), inputs are linear in time
between their values at its ends, so that they keep their limits:

    z_i = x_k + h Σ a_ij f(z_j, u_j),   x_{k+1} = x_k + h Σ b_j f(z_j, u_j) + Fₓ(x_{k+1})ᵀ μ_k,   F(x_{k+1}) = 0.

With loops, μ_k are multipliers of the constraints that project the end of the interval onto them: the motion does not drift
off (Bordalba, Schoels, Ros, Porta and Diehl, Direct collocation methods for trajectory optimization in constrained robotic
systems, IEEE Trans. Robotics 39, 2023). A phase after another one starts with the state that the impact between them leaves,
which is on its constraints. Betts, Practical Methods for Optimal Control, 3rd ed., 2020, ch. 4.
"""

from functools import cached_property

import numpy as np

from gauss.analysis.optimal.equations import Casadi
from gauss.analysis.optimal.problem import MotionProblem, MotionValues
from gauss.integrators.collocation import gauss_legendre

LARGEST_PROJECTION = 0.1  # multiplier of a projection, in shares of the units: larger ones reach another branch of a loop
LARGEST_MISS = 1e6  # of a relaxed condition, in shares of the unit
SLACKS = ("over", "under", "ahead", "behind")  # what conditions on the ends are missed by, and the state after another phase


class Transcription:
    """A phase of a motion on one mesh.

    Parameters
    ----------
    mesh : ndarray, shape (n + 1,)
        Mesh from 0 to 1.
    rows : list of int
        Independent rows of the constraints.
    relaxed : bool
        Whether conditions on the ends may be missed, which is then the cost.
    before : Transcription, optional
        The phase before it.
    """

    def __init__(
        self,
        problem: MotionProblem,
        mesh: np.ndarray,
        rows: list[int],
        relaxed: bool = False,
        before: "Transcription | None" = None,
    ):
        import casadi

        self.before = before
        self.first: Transcription = self if before is None else before.first

        self.problem, self.mesh, self.rows, self.relaxed = problem, mesh, rows, relaxed
        self.tableau, self.casadi = gauss_legendre(problem.stages), casadi
        n, n_x, n_u, s = len(mesh) - 1, problem.equations.n_x, problem.equations.n_u, problem.stages
        self.sizes = {"x": (n_x, n + 1), "z": (s * n_x, n), "u": (2 * n_u, n), "mu": (len(rows), n), "duration": (1, 1)}
        self.sizes |= {name: (len(problem.conditions), 1) for name in ("over", "under") if relaxed}
        self.sizes |= {name: (n_x, 1) for name in ("ahead", "behind") if relaxed and before is not None}
        self.symbols = {name: casadi.MX.sym(name, *shape) for name, shape in self.sizes.items()}
        self.variables = casadi.vertcat(*map(casadi.vec, self.symbols.values()))

    @property
    def unit_of_time(self) -> float:
        """Unit of the duration, a variable as the states, which are in shares of the units of the scene [s]."""
        return self.problem.equations.system.scale.time

    @property
    def duration(self) -> Casadi:
        """Duration [s]."""
        return self.unit_of_time * self.symbols["duration"]

    @cached_property
    def times(self) -> tuple[Casadi, Casadi]:
        """Times of the collocation points (s, n), and of the mesh points (1, n + 1)."""
        duration, start = self.duration, self.problem.start_time if self.before is None else self.before.end_time
        inner = self.mesh[:-1] + np.diff(self.mesh) * self.tableau.c[:, None]
        return start + duration * self.casadi.DM(inner), start + duration * self.casadi.DM(self.mesh).T

    @property
    def end_time(self) -> Casadi:
        """Time at its end."""
        return self.times[1][0, -1]

    @cached_property
    def _at_end(self) -> tuple[Casadi, Casadi, Casadi]:
        """Time and state at its end, without inputs: impacts do not depend on them."""
        return self.end_time, self.symbols["x"][:, -1], self.casadi.DM.zeros(self.problem.equations.n_u)

    @property
    def after(self) -> Casadi:
        """State after the impact at its end."""
        return self.symbols["x"][:, -1] if self.problem.reset is None else self.problem.reset(*self._at_end)

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
        return self.duration * self.casadi.DM(np.diff(self.mesh)).T

    @cached_property
    def objective(self) -> Casadi:
        """Cost."""
        casadi = self.casadi
        if self.relaxed:
            return sum(casadi.sum1(self.symbols[name]) for name in SLACKS if name in self.sizes)
        if self.problem.cost is None:
            return self.duration
        t, z, u = self.inner
        rates = casadi.reshape(self.problem.cost.map(t.size2())(t, z, u), self.problem.stages, len(self.mesh) - 1)
        return casadi.sum2(casadi.mtimes(casadi.DM(self.tableau.b).T, rates) * self._widths)

    @cached_property
    def constraints(self) -> Casadi:
        """Rows that are zero, those that are not negative, and those of the conditions on the ends."""
        return self.casadi.vertcat(self._zero_rows, self._signed_rows, self._end_rows)

    @cached_property
    def _zero_rows(self) -> Casadi:
        """Rows of the collocation, of the constraints at the mesh points, and of the start after another phase."""
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
            late = 0 if self.before is None else 1  # an impact leaves a state on the constraints
            parts.append(residuals.map(n + 1 - late)(self.times[1][:, late:], x[:, late:]))
        if self.before is not None:
            off = self.symbols["ahead"] - self.symbols["behind"] if self.relaxed else 0.0
            parts.append(x[:, 0] - self.before.after + off)
        return casadi.vertcat(*map(casadi.vec, parts))

    @cached_property
    def _signed_rows(self) -> Casadi:
        """Open gaps at the collocation points, forces there and at the ends of the intervals, and those of the ends."""
        casadi, given, count = self.casadi, self.problem, self.inner[0].size2()
        x, u, n_u, (_, t) = self.symbols["x"], self.symbols["u"], given.equations.n_u, self.times
        parts = [] if given.gaps is None else [given.gaps.map(count)(*self.inner)]
        parts += [] if given.opens is None else [given.opens(t[0, 0], x[:, 0], u[:n_u, 0])]
        if given.forces is not None:
            at_ends = given.forces.map(len(self.mesh) - 1)
            parts.append(given.forces.map(count)(*self.inner))
            parts += [at_ends(t[:, :-1], x[:, :-1], u[:n_u, :]), at_ends(t[:, 1:], x[:, 1:], u[n_u:, :])]
        parts += [] if given.bears is None else [given.bears(*self._at_end)]
        return casadi.vertcat(*map(casadi.vec, parts)) if parts else casadi.MX(0, 1)

    def _constraint_functions(self) -> tuple[Casadi, Casadi]:
        """(t, x) → F, and (t, x, μ) → Fₓᵀ μ."""
        casadi, equations = self.casadi, self.problem.equations
        t, x, mu = casadi.SX.sym("t"), casadi.SX.sym("x", equations.n_x), casadi.SX.sym("mu", len(self.rows))
        F = equations.residuals(t, x, casadi.SX.zeros(equations.n_u))[self.rows]
        return casadi.Function("F", [t, x], [F]), casadi.Function("project", [t, x, mu], [casadi.jtimes(F, x, mu, True)])

    @cached_property
    def _end_rows(self) -> Casadi:
        """Values of the conditions on the ends, in shares of the units."""
        first, last, given = self.first.symbols["x"][:, 0], self.symbols["x"][:, -1], self.problem
        rows = [first[one.place] for one in given.start] + [last[one.place] for one in given.end]
        rows += [self.after[one.place] - first[one.place] for one in given.increments]
        rows += [] if given.meets is None else [given.meets(*self._at_end)]
        found = self.casadi.vertcat(*rows) if rows else self.casadi.MX(0, 1)
        return found + self.symbols["over"] - self.symbols["under"] if self.relaxed else found

    @property
    def row_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the rows: zero, zero and infinity, and those of the conditions."""
        units = self.problem.units
        conditions = [one for _, one in self.problem.conditions]
        low = np.array([one.low / units[one.place] for one in conditions])
        high = np.array([one.high / units[one.place] for one in conditions])
        zero, signed = (np.zeros(rows.size1()) for rows in (self._zero_rows, self._signed_rows))
        return np.concatenate([zero, signed, low]), np.concatenate([zero, signed + np.inf, high])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
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
                "duration": np.array([duration / self.unit_of_time]),
            }
            of |= {"mu": np.full(len(self.rows), free), "over": slack * self._may_be_missed()}
            of |= {"under": of["over"]} | dict.fromkeys(("ahead", "behind"), np.full(equations.n_x, slack * LARGEST_MISS))
            both.append(np.concatenate([np.tile(of[name], shape[1]) for name, shape in self.sizes.items()]))
        return both[0], both[1]

    def _may_be_missed(self) -> np.ndarray:
        """Largest miss of each condition, in shares of the units: none of the start where others can be missed."""
        only_start = len(self.problem.conditions) == len(self.problem.start)
        return np.array([LARGEST_MISS * (only_start or kind != "start") for kind, _ in self.problem.conditions])

    def packed(self, guess: MotionValues) -> np.ndarray:
        """Variables of a motion."""
        n = len(self.mesh) - 1
        given = {
            "x": guess.x,
            "z": guess.z.reshape(-1, n),
            "u": guess.u.reshape(-1, n),
            "duration": np.array([[guess.duration / self.unit_of_time]]),
        }
        return np.concatenate([given.get(name, np.zeros(shape)).ravel(order="F") for name, shape in self.sizes.items()])

    def unpacked(self, variables: np.ndarray) -> tuple[MotionValues, np.ndarray]:
        """Motion of the variables, and what the conditions on the ends are missed by."""
        n, ends = len(self.mesh) - 1, np.cumsum([rows * columns for rows, columns in self.sizes.values()])[:-1]
        parts = zip(np.split(variables, ends), self.sizes.items(), strict=True)
        found = {name: part.reshape(shape, order="F") for part, (name, shape) in parts}
        z, u = found["z"].reshape(self.problem.stages, -1, n), found["u"].reshape(2, -1, n)
        values = MotionValues(self.mesh, found["x"], z, u, self.unit_of_time * float(found["duration"].item()))
        misses = (found["over"] - found["under"]).ravel() if self.relaxed else np.zeros(len(self.problem.conditions))
        return values, misses
