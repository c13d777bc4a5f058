"""Functions of a state in 50 digits: an operation graph evaluated by mpmath, and accelerations by their equations."""

import mpmath
import numpy as np
from scipy.linalg import qr

from gauss.analysis.export.exported_function import exported_functions
from gauss.codegen import LOOKUPS, Expression
from gauss.system import System, whole

DIGITS = 50
STEP = mpmath.mpf(10) ** -15  # of coordinates, rates and loads
OPERATIONS = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "neg": lambda x: -x,
    "less": lambda x, y: mpmath.mpf(x < y),
    "less_equal": lambda x, y: mpmath.mpf(x <= y),
    "select": lambda condition, x, y: x if condition else y,
    "min": min,
    "max": max,
} | {name: getattr(mpmath, name) for name in ("sqrt", "sin", "cos", "exp", "log", "floor", "atan2")}


class InManyDigits:
    """Function of a state, evaluated in 50 digits."""

    def __init__(self, system: System, name: str):
        (self.exported,) = exported_functions(system, name)
        self.takes_load = "load" in self.exported.inputs

    def __call__(self, q, v=(), load=()) -> list[np.ndarray]:
        function, given = self.exported.function, {"q": q, "v": v, "load": load, "t": [0.0]}
        inputs = [number for name in self.exported.inputs for number in given[name]]
        with mpmath.workdps(DIGITS):
            values = {symbol.index: mpmath.mpf(x) for symbol, x in zip(function.inputs, inputs, strict=True)}
            for node in function.nodes:
                if node.is_constant:
                    values[node.index] = mpmath.mpf(node.value)
                elif node.op in LOOKUPS:
                    values[node.index] = mpmath.mpf(LOOKUPS[node.op](node.value, float(values[node.operands[0].index])))
                elif node.op != "symbol":
                    values[node.index] = OPERATIONS[node.op](*(values[x.index] for x in node.operands))
            found = [values[x.index] if isinstance(x, Expression) else mpmath.mpf(x) for x in function.outputs]
        return list(self.exported.split(found, self.exported.outputs).values())


class ConstrainedAccelerations:
    """Accelerations of the tree by M q̈ + h = τ + Kᵀ λ, K q̈ = γ, without loads of the scene, in 50 digits.

    Parameters
    ----------
    system : System
        The system.
    state : State
        State whose independent rows of K are taken.
    """

    def __init__(self, system: System, state):
        self.terms = {name: InManyDigits(system, name) for name in ("mass_matrix", "bias_forces", "loop_constraints")}
        unreduced = whole(system)
        self.tree = np.concatenate([np.r_[unreduced.joints[edge.constraint].v] for edge in unreduced.tree])
        K = self.rows(state.q, state.v)[0].astype(float)
        K = K / np.maximum(np.linalg.norm(K, axis=1), 1e-9)[:, None]
        _, R, order = qr(K.T, pivoting=True)
        pivots = np.abs(np.diag(R))
        self.independent = np.sort(order[: int((pivots > 1e-6 * pivots.max(initial=0.0)).sum())])

    def rows(self, q, v) -> tuple[np.ndarray, np.ndarray]:
        """K (m, n) of the tree, and γ (m,)."""
        _, K, bias = self.terms["loop_constraints"](q, v)
        return K[:, self.tree], bias

    def __call__(self, q, v, load) -> list[np.ndarray]:
        tree, (K, bias) = self.tree, self.rows(q, v)
        K, bias, n = K[self.independent], bias[self.independent], len(tree)
        with mpmath.workdps(DIGITS):
            whole = mpmath.zeros(n + len(K), n + len(K))
            whole[:n, :n] = mpmath.matrix(self.terms["mass_matrix"](q)[0][np.ix_(tree, tree)].tolist())
            if len(K):
                whole[n:, :n] = mpmath.matrix(K.tolist())
                whole[:n, n:] = mpmath.matrix(K.T.tolist())
            forces = np.array(load, dtype=object)[tree] - self.terms["bias_forces"](q, v)[0][tree]
            found = mpmath.lu_solve(whole, mpmath.matrix([*forces, *bias]))
        return [np.array(list(found[:n]), dtype=object)]


def along(function, state, load, changes) -> np.ndarray:
    """Derivative of accelerations along changes of coordinates, rates and loads."""
    points = []
    with mpmath.workdps(DIGITS):
        for sign in (1, -1):
            moved = [
                [mpmath.mpf(x) + sign * STEP * mpmath.mpf(d) for x, d in zip(part, change, strict=True)]
                for part, change in zip((state.q, state.v, load), changes, strict=True)
            ]
            points.append(function(*moved)[0])
        return np.array((points[0] - points[1]) / (2 * STEP), dtype=float)


def tangent(system, state, rng) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random change of coordinates, rates and loads that stays on the constraints."""
    dq, dv, dload = rng.standard_normal((3, system.n_v))
    if not system.has_closures:
        return dq, dv, dload
    function = InManyDigits(system, "loop_constraints")
    of = lambda q: next(part for part in function(q, state.v) if part.ndim == 2)  # noqa: E731
    K = np.array(of(state.q), dtype=float)
    pinv = np.linalg.pinv(K, rcond=1e-10)
    dq = dq - pinv @ (K @ dq)
    with mpmath.workdps(DIGITS):
        ahead, behind = (
            of([mpmath.mpf(x) + sign * STEP * mpmath.mpf(d) for x, d in zip(state.q, dq, strict=True)]) for sign in (1, -1)
        )
        turning = np.array((ahead - behind) / (2 * STEP), dtype=float) @ state.v
    return dq, dv - pinv @ (K @ dv + turning), dload
