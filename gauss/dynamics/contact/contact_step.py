"""Contact problem of one step: forces f with u = W f + b, W = h J M⁻¹ Jᵀ, that obey the laws of all contacts.

Rates u after the step, with b those without contact forces:

    unilateral contact   0 ≤ f ⟂ u ≥ 0;
    with friction        the same along the normal; |f_t| ≤ μ f_n, and f_t = −μ f_n u_t/|u_t| while it slides;
    set-valued element   |f| ≤ limit, and f = −limit · sign u while it slips.

Each law is a projection, f = P_C(f − u/w); that of friction is on a disc of radius μ (f_n − u_n/w_n)⁺. They are solved by
Newton's method (Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991), from starts by projected Gauss–Seidel iterations
over single contacts (Jourdan, Alart, Jean 1998), in machine code with traced laws and derivatives. Coulomb's law is not the
minimum of a function, and may have no solution. Then the convex relaxation (Anitescu 2006) is solved, the minimum of
½ fᵀ W f + bᵀ f over the friction cones: it always exists, but its contacts open a little while they slide.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Function, from_disk, jacobian, write
from gauss.codegen.kernels import CompiledContactSolver, ContactSolver, Round
from gauss.dynamics.contact.convex_relaxation import CONVEX_ERROR, CONVEX_STEPS, least_over_cones, on_cones
from gauss.errors import SimulationError
from gauss.system import State, System

LAW_TOLERANCE = 1e-10  # error of the laws that ends Newton's method, in units of the scene times 1 + the largest rate
ACCEPTED_LAW_ERROR = 1e-7  # the same: accepted error where many contacts of one body share its forces
# Plain Newton steps nearly always converge; where they cycle, strong regularisation leads near the solution, then little.
ROUNDS_OF_DENSE = (
    Round(0, 0.0, 15),
    Round(0, 1.0, 100),
    Round(0, 1e-1, 30),
    Round(0, 1e-2, 20),
    Round(0, 1e-4, 10),
    Round(0, 1e-7, 10),
    Round(30, 0.0, 15),
    Round(300, 0.0, 15),
)
MOST_TURNED = (
    1.0  # rad, and lengths of the scene, by which coordinates move in a step: longer ones are named where steps fail
)
LEAST_DIAGONAL = 1e-14  # relative to the largest diagonal entry of W: smaller rows are empty


class ContactLaws(NamedTuple):
    """Laws of the entries of the force vector."""

    normal: np.ndarray  # (m,) normal forces
    across: np.ndarray  # (k, 2) friction forces, along two tangential directions
    under: np.ndarray  # (k,) normal force of each of these
    friction: np.ndarray  # (k,) coefficients of friction
    set_valued: np.ndarray  # (g,) forces of set-valued elements
    limit: np.ndarray  # (g,) their limits [N m, N]


def laws_of(laws: ContactLaws, rows: np.ndarray) -> ContactLaws:
    """Laws of some rows, in ascending order."""
    kept = np.isin(laws.under, rows)

    def place(which: np.ndarray) -> np.ndarray:
        return np.searchsorted(rows, which)

    return ContactLaws(
        normal=place(laws.normal[np.isin(laws.normal, rows)]),
        across=place(laws.across[kept]),
        under=place(laws.under[kept]),
        friction=laws.friction[kept],
        set_valued=place(laws.set_valued),
        limit=laws.limit,
    )


@dataclass(frozen=True)
class ContactProblem:
    """Problem of one step."""

    W: np.ndarray  # W, b: rates after the step, W f + b: (n, n) and (n,)
    b: np.ndarray
    laws: ContactLaws  # laws of the forces

    def solve(self, start: np.ndarray) -> tuple[np.ndarray, float | None]:
        """Forces (n,) that obey the laws, and their error in the unit of b; None for those of the convex relaxation.

        SimulationError if neither is found.
        """
        if not start.size:
            return start, 0.0
        laws = self.laws
        if laws.normal.size and not (laws.normal == np.arange(laws.normal.size)).all():
            raise ValueError("rows of normals come first.")
        f, left = _solver()(self.W, self.b, laws.under, laws.friction, laws.limit, start)
        return (f, left) if left >= 0.0 else (self._convex(start), None)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Diagonal of W, one number for both directions of a contact (n,)."""
        w = self.W.diagonal().copy()
        w[self.laws.across] = w[self.laws.across].max(axis=1, keepdims=True, initial=0.0)
        return np.maximum(w, LEAST_DIAGONAL * w.max(initial=1e-300))

    def _convex(self, start: np.ndarray) -> np.ndarray:
        """Forces of the convex relaxation."""
        goal, size = CONVEX_ERROR * (1.0 + np.abs(self.b).max()), np.linalg.eigvalsh(self.W)[-1]
        f, error = least_over_cones(lambda f: self.W @ f + self.b, self._allowed, start, size, goal, CONVEX_STEPS)
        if not error <= goal:
            raise SimulationError(
                "no forces of contacts and set-valued elements were found that obey their laws; shorten the step."
            )
        return f

    def _allowed(self, f: np.ndarray) -> np.ndarray:
        """Projection of forces on the friction cones and the limits of set-valued elements."""
        laws, f = self.laws, f.copy()
        smooth = np.setdiff1d(laws.normal, laws.under)
        f[smooth] = np.maximum(f[smooth], 0.0)
        f[laws.under], f[laws.across] = on_cones(f[laws.under], f[laws.across], laws.friction)
        f[laws.set_valued] = np.clip(f[laws.set_valued], -laws.limit, laws.limit)
        return f


@contextmanager
def errors_of_step(system: System, state: State, h: float) -> Iterator[None]:
    """Let errors of a step of length h [s] name its time, and its length where bodies turn too far in it."""
    try:
        yield
    except SimulationError as error:
        text, moved = str(error), h * system.scale.fastest(state.v)
        text = text if text.startswith("t = ") else f"t = {state.t:.6g} s: {text}"
        if not moved <= MOST_TURNED:
            far = f"coordinates move by {moved:.2g} rad or lengths of the scene in a step of {h:.3g} s: give a shorter one."
            text = f"t = {state.t:.6g} s: {far}" + (f" {text}" if isfinite(moved) else "")  # else nothing is to be trusted
        raise SimulationError(text) from error


def unilateral(f):
    """Projection of a normal force on f ≥ 0."""
    return math.maximum(f, 0.0)


def on_disc(across, radius) -> np.ndarray:
    """Projection of tangential forces (2,) on a disc."""
    size = math.sqrt(across[0] * across[0] + across[1] * across[1])
    return np.array([math.where(radius > 0.0, math.where(size > radius, radius / size * x, x), 0.0) for x in across])


def limited(f, limit):
    """Projection of a force on |f| ≤ limit."""
    return math.clip(f, -limit, limit)


@cache
def contact_solver() -> ContactSolver:
    """Machine code of the laws; the residual is the distance of forces from their projections."""

    def normal(f, u, w):
        return [f - unilateral(f - u / w)]

    def rough(f1, f2, u1, u2, w, f, u, v, friction):
        moved, radius = np.array([f1 - u1 / w, f2 - u2 / w]), friction * unilateral(f - u / v)
        return np.array([f1, f2]) - on_disc(moved, radius)

    def set_valued(f, u, w, limit):
        return [f - limited(f - u / w, limit)]

    return ContactSolver(
        _with_slopes(normal, 3, (0, 1)),
        _with_slopes(rough, 9, (0, 1, 5, 2, 3, 6)),
        _with_slopes(set_valued, 4, (0, 1)),
        write(lambda x: [unilateral(x[0])], 1, name="pushing"),
        write(lambda x: on_disc(x[:2], x[2]), 3, name="coulomb_friction"),
        write(lambda x: [limited(*x)], 2, name="holding"),
        ROUNDS_OF_DENSE,
        LAW_TOLERANCE,
        ACCEPTED_LAW_ERROR,
        LEAST_DIAGONAL,
    )


def _with_slopes(law, size: int, over) -> Function:
    """Function of a vector: residual of a law, and its Jacobian over some entries."""

    def both(x):
        errors = law(*x)
        return errors, jacobian(errors, x[list(over)])

    return write(both, size, name=law.__name__)


@cache
def _solver() -> CompiledContactSolver:
    return from_disk((CompiledContactSolver,), lambda: CompiledContactSolver(contact_solver()))
