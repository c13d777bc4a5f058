"""Rows that contradict each other, by a little or by much, each with a Farkas certificate that adds them up to 0 < 0."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.problems import make_problem
from gauss.bench.suite.classes.mechanisms import of_compulsion
from gauss.bench.suite.doubled import wide, zeros
from gauss.bench.suite.instance import INFEASIBLE, SuiteInstance, SuiteReference, programme, with_reference
from gauss.bench.suite.refine import solve_wide
from gauss.linkages.doubled import Doubled

MARGINS = (0, 10, 20, 26)  # powers of 1/2 by which rows contradict each other, relative
GRID = 2.0**8


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for power in MARGINS:
        yield f"infeasible clamp 2^-{power}", partial(_clamp, power)
        yield f"infeasible sums 2^-{power}", partial(_sums, power)
        yield f"infeasible stops 2^-{power}", partial(_stops, power)
    for steps in (4, 16):
        yield f"infeasible crane {steps}", partial(_crane, steps)
    yield "infeasible noisy copies", _noisy_copies


def refuted(instance: SuiteInstance, y=None, z=None, z_box=None) -> SuiteInstance:
    """The instance with a certificate that it has no feasible point; multipliers that are not given are zero."""
    given = lambda part, size: zeros(size) if part is None else wide(part)  # noqa: E731
    multipliers = given(y, instance.b.size), given(z, instance.h.size), given(z_box, instance.n)
    proof = SuiteReference(zeros(0), *multipliers, digits=np.inf)
    return with_reference(replace(instance, verdict=INFEASIBLE), proof)


def _clamp(power: int) -> SuiteInstance:
    """Masses in a row between two jaws that leave less room than they need."""
    n, room = 6, 6.0 * (1.0 - 2.0**-power / 2)
    rows = sparse.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))  # x_i + 1 ≤ x_{i+1}
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    lb[0], ub[-1] = 0.5, room - 0.5
    z_box = np.zeros(n)
    z_box[0], z_box[-1] = -1.0, 1.0
    story = f"{n} blocks of 1 m between jaws that are {room:.10g} m apart: too little by 2^-{power} of half their length."
    names = {"variables": tuple(f"block{i}.x" for i in range(n)), "units": ("m",) * n}
    found = programme(
        f"infeasible clamp 2^-{power}",
        "infeasible",
        story,
        np.eye(n),
        -np.arange(n) * 1.0,
        G=rows,
        h=-np.ones(n - 1),
        lb=lb,
        ub=ub,
        **names,
    )
    return refuted(found, z=np.ones(n - 1), z_box=z_box)


def _sums(power: int) -> SuiteInstance:
    rng = np.random.default_rng(power)
    n, m = 16, 8
    A = np.round(GRID * rng.standard_normal((m, n)) * (rng.random((m, n)) < 0.5)) / GRID + np.eye(m, n)
    b, T = np.round(GRID * rng.standard_normal(m)) / GRID, rng.integers(-2, 3, m).astype(float)
    right = np.concatenate([b, [T @ b + 2.0**-power]])
    story = f"Couplings between {n} masses, the last row the sum of others but for 2^-{power} on its right-hand side."
    names = {"variables": tuple(f"mass{i}.acceleration" for i in range(n)), "units": ("m/s²",) * n}
    found = programme(
        f"infeasible sums 2^-{power}",
        "infeasible",
        story,
        np.eye(n),
        rng.integers(-9, 9, n),
        A=np.vstack([A, T @ A]),
        b=right,
        **names,
    )
    return refuted(found, y=np.concatenate([T, [-1.0]]))


def _stops(power: int) -> SuiteInstance:
    """Geared shafts at stops that ask for opposite turns."""
    n = 5
    A = sparse.diags_array([np.full(n - 1, -2.0), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))  # x_{i+1} = 2 x_i
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    lb[0], ub[-1] = 1.0, 2.0 ** (n - 1) * (1.0 - 2.0**-power)
    y = -(2.0 ** np.arange(n - 2, -1, -1))
    z_box = np.zeros(n)
    z_box[0], z_box[-1] = -(2.0 ** (n - 1)), 1.0
    story = f"{n} shafts geared 1 : 2, the first pushed on by its stop, the last held back by its own, 2^-{power} short."
    names = {"variables": tuple(f"shaft{i}.acceleration" for i in range(n)), "units": ("rad/s²",) * n}
    found = programme(
        f"infeasible stops 2^-{power}",
        "infeasible",
        story,
        np.diag(4.0 ** -np.arange(n)),
        np.zeros(n),
        A=A,
        b=np.zeros(n - 1),
        lb=lb,
        ub=ub,
        **names,
    )
    return refuted(found, y=y, z_box=z_box)


def _crane(steps: int) -> SuiteInstance:
    """A trolley that is to be at rest at a place that its drive does not reach in time."""
    h, far = 0.5, steps**2 / 8.0
    names, rows, right = [], [], []
    n = 3 * steps
    for k in range(steps):  # x⁺ = x + h v, v⁺ = v + h u
        names += [f"step{k}.u", f"step{k + 1}.x", f"step{k + 1}.v"]
        row = np.zeros((2, n))
        row[0, 3 * k + 1], row[1, 3 * k + 2], row[1, 3 * k] = 1.0, 1.0, -h
        if k:
            row[0, 3 * k - 2], row[0, 3 * k - 1], row[1, 3 * k - 1] = -1.0, -h, -1.0
        rows.append(row)
        right += [0.0, 0.0]
    end = np.zeros((1, n))
    end[0, 3 * steps - 2] = 1.0
    A, b = np.vstack([*rows, end]), np.array([*right, far])
    y = np.zeros(b.size)
    y[-1] = -1.0
    for k in range(steps - 1, -1, -1):  # adjoints of place and velocity, backwards
        follow = A[: 2 * steps].T @ y[: 2 * steps] + A[-1] * y[-1]
        y[2 * k], y[2 * k + 1] = -follow[3 * k + 1], -follow[3 * k + 2]
    pull = -(A.T @ y)
    bounded = np.arange(n) % 3 == 0
    limit = np.where(bounded, 1.0, np.inf)
    story = f"Trolley of 1 kg, {steps} steps of {h} s, force up to 1 N: it is to be {far:g} m away, farther than it can get."
    units = ("N", "m", "m/s") * steps
    found = programme(
        f"infeasible crane {steps}",
        "infeasible",
        story,
        np.diag(np.where(bounded, 1.0, 0.125)),
        np.zeros(n),
        A=A,
        b=b,
        lb=-limit,
        ub=limit,
        variables=tuple(names),
        units=units,
    )
    return refuted(found, y=y, z_box=pull)


def _noisy_copies() -> SuiteInstance:
    """Four-bar with a duplicated hinge and noise on its rows; the certificate is the least residual of its rows."""
    compulsion = make_problem("noisy copies").compulsion
    story = "Four-bar with one hinge said twice and noise of 1e-8 on its rows: they contradict each other by 8e-8."
    instance = of_compulsion("infeasible noisy copies", "infeasible", story, compulsion)
    A, b = sparse.csr_array(instance.A), instance.b
    K = sparse.block_array([[sparse.eye_array(b.size), A], [A.T, sparse.csr_array((A.shape[1],) * 2)]], format="csr")
    both, _ = solve_wide(sparse.csr_array(K), np.concatenate([b, np.zeros(A.shape[1])]), instance.name)
    return refuted(instance, y=Doubled(-both.hi[: b.size], -both.lo[: b.size]))
