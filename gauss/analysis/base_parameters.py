"""Base parameters: the combinations of standard parameters that forces depend on, by the rank of the regressor.

Over many states W = [W₁ W₂] with independent columns W₁ and W₂ = W₁ β, so that W π = W₁ (π₁ + β π₂): no measurement of
forces tells more than π₁ + β π₂ (Gautier, Numerical calculation of the base inertial parameters of robots, J. Robotic
Systems 8(4), 1991). QR with pivoting chooses W₁, of columns in the units of the scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from textwrap import shorten

import numpy as np
from scipy.linalg import qr, solve_triangular

from gauss.analysis.loop_closure import POSITION_STEPS
from gauss.analysis.regressor import RegressorModel
from gauss.arguments import named_arguments
from gauss.dynamics.consistent_states import violations
from gauss.dynamics.projection import project_positions
from gauss.errors import ArgumentError, GaussError, StateError
from gauss.scene import Scene
from gauss.system import State, System, random_state, retract

RANK_TOLERANCE = 1e-8  # share of the largest pivot below which a column depends on the others
SMALLEST_FACTOR = 1e-8  # of a combination in the units of the scene: smaller ones are round-off
ROWS_PER_COLUMN = 2  # of random samples, at least
LEAST_SAMPLES = 30
ATTEMPTS = 10  # random states for each sample: those that do not assemble are left out
LONGEST_STEP = 0.5  # of a random walk, in the units of the coordinates
SHOWN_DIGITS, SHOWN_LENGTH = 4, 110


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters of a system.

    Parameters
    ----------
    names : tuple of str
        Names of the p standard parameters, as of :class:`gauss.Regressor`.
    base : tuple of int
        Places of those that each of the r combinations begins with, with factor 1.
    combinations : ndarray, shape (r, p)
        K: base parameters K π of standard parameters π.
    units : ndarray, shape (p,)
        Units of the standard parameters in the scale of the scene.
    """

    names: tuple[str, ...]
    base: tuple[int, ...]
    combinations: np.ndarray
    units: np.ndarray

    def __len__(self) -> int:
        return len(self.base)

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Standard parameters without any effect on the forces."""
        return tuple(np.array(self.names)[~self.combinations.any(axis=0)].tolist())

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Standard parameters that forces determine by themselves."""
        alone = np.count_nonzero(self.combinations, axis=1) == 1
        return tuple(self.names[k] for k, is_alone in zip(self.base, alone, strict=True) if is_alone)

    @property
    def combined(self) -> tuple[str, ...]:
        """Standard parameters that forces determine in combinations only."""
        others = {*self.unidentifiable, *self.identifiable}
        return tuple(name for name in self.names if name not in others)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Each combination in words, as "Izz:arm + 0.25 mass:hand"."""
        return tuple(self._label(row, first) for row, first in zip(self.combinations, self.base, strict=True))

    @property
    def shown(self) -> tuple[str, ...]:
        """The same, shortened."""
        return tuple(shorten(label, SHOWN_LENGTH, placeholder=" …") for label in self.labels)

    def _label(self, row: np.ndarray, first: int) -> str:
        words = self.names[first]
        for k in np.flatnonzero(row):
            if k != first:
                factor = f"{abs(row[k]):.{SHOWN_DIGITS}g} "
                factor = "" if factor == "1 " else factor
                words += f" {'-' if row[k] < 0 else '+'} {factor}{self.names[k]}"
        return words

    def __str__(self) -> str:
        lines = [f"{len(self)} base parameters of {len(self.names)} standard ones", *(f"  {label}" for label in self.shown)]
        return "\n".join([*lines, f"without effect: {', '.join(self.unidentifiable) or 'none'}"])


@named_arguments
def base_parameters(
    system: System | Scene,
    q=None,
    v=None,
    acceleration=None,
    *,
    independent: Sequence[str] | None = None,
    friction: Sequence[str] = (),
    seed: int = 0,
) -> BaseParameters:
    """Base parameters by the rank of the regressor over random states, or over given ones.

    Parameters
    ----------
    system : System or Scene
        The system, with or without loops.
    q, v, acceleration : array_like, shape (n, n_q), (n, n_v), (n, n_v), optional
        States, as of :func:`gauss.regressor`; random ones when not given.
    independent, friction
        As of :func:`gauss.regressor`.
    seed : int
        Seed of random states.

    Returns
    -------
    BaseParameters
        Combinations, and the names of parameters that are identifiable alone, in combinations, or not at all.

    Raises
    ------
    ArgumentError
        If some of q, v, acceleration are given and others are not.
    StateError
        If an argument does not fit, no parameter has an effect, or loops do not assemble in random states.

    Examples
    --------
    >>> import gauss
    >>> found = gauss.base_parameters(gauss.load("pendulum"))
    >>> found.identifiable
    ('mx:rod', 'my:rod', 'Izz:rod')
    """
    model = RegressorModel(system, independent, friction)
    given = (q, v, acceleration)
    if any(part is None for part in given) and any(part is not None for part in given):
        raise ArgumentError("base_parameters: give q, v and acceleration, or none of them.")
    return base_of(model, random_matrix(model, seed) if q is None else model.matrix(q, v, acceleration))


def base_of(model: RegressorModel, matrix: np.ndarray) -> BaseParameters:
    """Base parameters of a model by the rank of its regressor (n, k, p)."""
    rows = (matrix / model.row_units[:, None]).reshape(-1, len(model.names)) * model.units
    R, order = qr(rows, mode="r", pivoting=True)
    pivots = np.abs(np.diag(R))
    rank = int((pivots > RANK_TOLERANCE * pivots[0]).sum())
    if not rank:
        raise StateError("base_parameters: no parameter has an effect on the forces in these states.")
    factors = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    factors[np.abs(factors) < SMALLEST_FACTOR] = 0.0
    K = np.zeros((rank, len(model.names)))
    K[:, order[:rank]], K[:, order[rank:]] = np.eye(rank), factors
    sorted_rows = np.argsort(order[:rank])
    K, base = K[sorted_rows], order[:rank][sorted_rows]
    K = model.units[base, None] * K / model.units
    K[np.arange(rank), base] = 1.0
    return BaseParameters(model.names, tuple(base.tolist()), K, model.units)


def random_matrix(model: RegressorModel, seed: int | np.random.Generator) -> np.ndarray:
    """Regressors (n, k, p) in random states; with loops, along a random walk that is projected onto the constraints."""
    system, rng, found = model.system, np.random.default_rng(seed), []
    count = max(LEAST_SAMPLES, -(-ROWS_PER_COLUMN * len(model.names) // len(model.rows)))
    sample, state = _walked_sample if system.has_closures else _free_sample, system.initial_state()
    for _ in range(ATTEMPTS * count):
        try:
            state, matrix = sample(model, state, rng)
        except GaussError:  # near-singular for the independent coordinates, or a step too far
            continue
        found.append(matrix)
        if len(found) == count:
            return np.array(found)
    raise StateError("base_parameters: no random states meet the constraints; give q, v and acceleration.")


def _free_sample(model: RegressorModel, _, rng: np.random.Generator) -> tuple[State, np.ndarray]:
    """Random state of a tree, and its regressor (n_v, p)."""
    system = model.system
    state, speed = random_state(system, rng), 1.0 / system.scale.time
    rates = system.scale.coordinates * rng.standard_normal((2, system.n_v))
    return state, model.matrix(state.q, speed * rates[0], speed**2 * rates[1])


def _walked_sample(model: RegressorModel, state: State, rng: np.random.Generator) -> tuple[State, np.ndarray]:
    """State a random step away, and its regressor (k, p) along orthogonal rates.

    With N = Q R, rates v = Q z of unit size and rows R⁻ᵀ Nᵀ Y: near singular positions of the independent coordinates, rows
    stay as large as elsewhere.
    """
    system, units = model.system, model.system.scale.coordinates
    state = _walked(system, state, rng)
    own, speed = units[model.places], 1.0 / system.scale.time
    N = system.null_space(state.q, independent=model.independent)
    R = np.asarray(np.linalg.qr(N * own / units[:, None], mode="r"))
    rates = np.zeros((2, system.n_v))
    rates[:, model.places] = (own[:, None] * np.linalg.solve(R, rng.standard_normal((len(own), 2)))).T
    matrix = model.matrix(state.q, speed * rates[0], speed**2 * rates[1]) / model.row_units[:, None]
    return state, model.row_units[:, None] * np.linalg.solve(R.T, matrix)


def _walked(system: System, state: State, rng: np.random.Generator) -> State:
    """State a random step away."""
    step = LONGEST_STEP * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v)
    guess = State(state.t, retract(system, state.q, step), np.zeros(system.n_v))
    found = project_positions(system, guess, POSITION_STEPS)
    return state if violations(system, found) else found
