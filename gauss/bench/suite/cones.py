"""References with second-order cones, and of Coulomb's law: a guess gives the state of each cone, then equations are solved.

A cone is left alone (s inside, z = 0), at its apex (s = 0) or on its boundary (z = τ (s₀, −s₁), s₀² = |s₁|²); a contact
sticks (u = 0), is open (r = 0), or slides (u_n = 0, u_t = −τ r_t, |r_t| = μ r_n). These equations are smooth: Newton
steps with a double Jacobian and residuals of twice the precision solve them to some thirty digits; the conditions are
checked afterwards.
"""

import warnings

import numpy as np
from scipy import linalg, sparse

from gauss.bench.suite.doubled import Doubled, joined, product, taken, wide, zeros
from gauss.bench.suite.guess import guessed
from gauss.bench.suite.instance import SuiteInstance, SuiteReference
from gauss.bench.suite.optimality import LEAST_SIZE, largest_multiplier, residuals, speeds
from gauss.bench.suite.refine import ACTIVE, CONVERGED, DEPENDENT, STAGNATED, STEPS, held_rows
from gauss.errors import BackendError

ROUNDS = 500  # of convex problems, each with the sliding of the one before, until Coulomb's law is met (Acary, Cadoux 2011)
SLIDING_TOLERANCE = 1e-9  # relative change of the sliding
INSIDE, APEX, BOUNDARY = "inside", "apex", "boundary"


def refined_with_cones(instance: SuiteInstance) -> SuiteReference:
    """Solution of a programme with cones, or of Coulomb's law.

    BackendError if the guess does not converge, or refinement does not.
    """
    x, y, plain, z = _guess(instance)
    states, start = _states(instance, x, z)
    equations = (CoulombEquations if instance.friction.size else Convex)(instance, states, x, plain)
    unknown = wide(equations.start(x, y, plain, z, start))
    before = last = np.inf
    for _ in range(STEPS):
        value, slope = equations.value(unknown), equations.slope(unknown.rounded())
        scale = np.maximum(np.abs(slope).max(axis=1), LEAST_SIZE)
        step = _solved(slope / scale[:, None], value.rounded() / scale)
        unknown = unknown - step
        last = float(np.abs(step).max() / max(np.abs(unknown.hi).max(), LEAST_SIZE))
        if last <= CONVERGED or (last <= STAGNATED and last > before / 2):
            break
        before = last
    else:
        raise BackendError(f"{instance.name}: refinement of the cones stays at {last:.1e}.")
    x, y, z = equations.parts(unknown)
    plain_z, z_box = instance.multipliers(taken(z, slice(equations.rows.shape[0])))
    z = joined(plain_z, taken(z, slice(equations.rows.shape[0], None)))
    found = residuals(instance, x, y, z, z_box)
    _, plain_rows, bounds = held_rows(instance, x)
    cones = [block.start for block, state in zip(instance.blocks, states, strict=True) if state != INSIDE]
    active = np.concatenate([plain_rows, np.array(cones, dtype=int)])
    unique = bool(np.linalg.matrix_rank(slope / scale[:, None], tol=DEPENDENT) == len(slope))
    digits = float(-np.log10(max(last, CONVERGED)))
    return SuiteReference(x, y, z, z_box, active, bounds, max(found), digits, unique=unique)


def _solved(slope: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Newton step; the least one where rows depend on each other."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", linalg.LinAlgWarning)
        try:
            return linalg.solve(slope, value)
        except (linalg.LinAlgError, linalg.LinAlgWarning):
            return linalg.lstsq(slope, value, cond=1e-13)[0]


def _guess(instance: SuiteInstance):
    """Answer to about ten digits; of Coulomb's law by convex problems that take the sliding of the one before as given."""
    if not instance.friction.size:
        return guessed(instance)
    normal, sliding = np.arange(0, instance.n, 3), np.zeros(instance.n)
    for _ in range(ROUNDS):
        found = guessed(instance, sliding)
        u = instance.P @ found.x + instance.q
        slide = instance.friction * np.hypot(u[normal + 1], u[normal + 2])
        change = np.abs(slide - sliding[normal]).max()
        if change <= SLIDING_TOLERANCE * np.abs(instance.q).max():
            return found
        sliding[normal] = slide
    raise BackendError(f"{instance.name}: Coulomb's law is not met, the sliding still changes by {change:.1e} m/s.")


def _states(instance: SuiteInstance, x: np.ndarray, z: np.ndarray) -> tuple[list[str], np.ndarray]:
    """State of each cone, that of the smallest residual; and the factor τ of those on the boundary."""
    s, states, factors = (instance.h - instance.G @ x)[instance.orthant :], [], []
    most = largest_multiplier(instance, z, abs(instance.P) @ np.abs(x) + np.abs(instance.q))
    for block in instance.blocks:
        own = slice(block.start - instance.orthant, block.stop - instance.orthant)
        a, w = s[own], z[own]
        depth, height = (abs(part[0] - np.linalg.norm(part[1:])) / max(abs(part[0]), LEAST_SIZE) for part in (a, w))
        off = {INSIDE: abs(w[0]) / most, APEX: abs(a[0]) / max(np.abs(s).max(), LEAST_SIZE), BOUNDARY: max(depth, height)}
        states.append(min(off, key=off.__getitem__))
        if states[-1] == BOUNDARY:
            factors.append(w[0] / max(a[0], LEAST_SIZE))
    return states, np.array(factors)


class Convex:
    """Equations of a programme with cones in x, y, multipliers of rows that hold and of cones at their apex, and τ."""

    def __init__(self, instance: SuiteInstance, states: list[str], x: np.ndarray, plain: np.ndarray):
        self.instance, self.states = instance, states
        self.rows, self.right = instance.plain_rows()
        self.held = np.flatnonzero(
            plain > ACTIVE * largest_multiplier(instance, plain, abs(instance.P) @ np.abs(x) + np.abs(instance.q))
        )
        self.apex = [b for b, state in zip(instance.blocks, states, strict=True) if state == APEX]
        self.boundary = [b for b, state in zip(instance.blocks, states, strict=True) if state == BOUNDARY]
        at_apex = (
            np.concatenate([np.arange(b.start, b.stop) for b in self.apex]).astype(int) if self.apex else np.zeros(0, int)
        )
        G = sparse.csr_array(instance.G)
        self.C = sparse.vstack([sparse.csr_array(instance.A), self.rows[self.held], G[at_apex]], format="csr")
        self.c = np.concatenate([instance.b, self.right[self.held], instance.h[at_apex]])
        self.at_apex = at_apex
        self.flips = [np.r_[1.0, -np.ones(b.stop - b.start - 1)] for b in self.boundary]
        self.G_boundary = [G[b] for b in self.boundary]

    def start(self, x, y, plain, z, factors) -> np.ndarray:
        """Unknowns of a guess."""
        return np.concatenate([x, y, plain[self.held], z[self.at_apex - self.instance.orthant], factors])

    def _split(self, unknown):
        n, k = self.instance.n, self.c.size
        return (taken(unknown, part) for part in (slice(n), slice(n, n + k), slice(n + k, None)))

    def value(self, unknown: Doubled) -> Doubled:
        """Residuals of the equations."""
        instance = self.instance
        x, held, factors = self._split(unknown)
        rest = product(instance.P, x) + instance.q + product(self.C.T, held)
        on = zeros(len(self.boundary))
        for i, (block, flip, G) in enumerate(zip(self.boundary, self.flips, self.G_boundary, strict=True)):
            s = (instance.h[block] - product(G, x)) * flip
            rest = rest + product(G.T, s * taken(factors, [i] * flip.size))
            square = product(sparse.csr_array(np.ones((1, flip.size))), s * s * flip)
            on.hi[i], on.lo[i] = square.hi[0], square.lo[0]
        return joined(rest, product(self.C, x) - self.c, on)

    def slope(self, unknown: np.ndarray) -> np.ndarray:
        """Their Jacobian."""
        instance, n, k = self.instance, self.instance.n, self.c.size
        slope = np.zeros((unknown.size, unknown.size))
        slope[:n, :n], C = instance.P.toarray(), self.C.toarray()
        slope[:n, n : n + k], slope[n : n + k, :n] = C.T, C
        for i, (block, flip, G) in enumerate(zip(self.boundary, self.flips, self.G_boundary, strict=True)):
            G, at = G.toarray(), n + k + i
            s = flip * (instance.h[block] - G @ unknown[:n])
            slope[:n, :n] -= unknown[at] * G.T @ (flip[:, None] * G)
            slope[:n, at], slope[at, :n] = G.T @ s, -2.0 * G.T @ s
        return slope

    def parts(self, unknown: Doubled) -> tuple[Doubled, Doubled, Doubled]:
        """Answer x, y, and the multipliers of the plain rows followed by those of the cones."""
        instance, m = self.instance, self.instance.b.size
        x, held, factors = self._split(unknown)
        z = zeros(self.right.size + sum(instance.cones))
        shift = self.right.size - instance.orthant
        places = np.concatenate([self.held, shift + self.at_apex])
        z.hi[places], z.lo[places] = held.hi[m:], held.lo[m:]
        for i, (block, flip, G) in enumerate(zip(self.boundary, self.flips, self.G_boundary, strict=True)):
            w = (instance.h[block] - product(G, x)) * flip * taken(factors, [i] * flip.size)
            own = slice(shift + block.start, shift + block.stop)
            z.hi[own], z.lo[own] = w.hi, w.lo
        return x, taken(held, slice(m)), z


class CoulombEquations:
    """Equations of Coulomb's law in the forces r and the factors τ of what slides."""

    def __init__(self, instance: SuiteInstance, states: list[str], x: np.ndarray, plain: np.ndarray):
        self.instance, self.rows = instance, instance.plain_rows()[0]
        self.open = [3 * i for i, state in enumerate(states) if state == APEX]
        self.stuck = [3 * i for i, state in enumerate(states) if state == INSIDE]
        self.sliding = np.array([3 * i for i, state in enumerate(states) if state == BOUNDARY], dtype=int)
        self.square = instance.friction[self.sliding // 3]

    def start(self, x, y, plain, z, factors) -> np.ndarray:
        """Unknowns of a guess: u_t = −τ r_t."""
        u, at = self.instance.P @ x + self.instance.q, self.sliding
        rub = np.hypot(x[at + 1], x[at + 2])
        return np.concatenate([x, np.hypot(u[at + 1], u[at + 2]) / np.maximum(rub, LEAST_SIZE)])

    def value(self, unknown: Doubled) -> Doubled:
        """Residuals of the equations."""
        n, at = self.instance.n, self.sliding
        r, factors = taken(unknown, slice(n)), taken(unknown, slice(n, None))
        u = product(self.instance.P, r) + self.instance.q
        rest = Doubled(u.hi.copy(), u.lo.copy())
        for first in self.open:
            rest.hi[first : first + 3], rest.lo[first : first + 3] = r.hi[first : first + 3], r.lo[first : first + 3]
        across = []
        for k in (1, 2):
            slip, rub = taken(u, at + k), taken(r, at + k)
            law = slip + factors * rub
            rest.hi[at + k], rest.lo[at + k] = law.hi, law.lo
            across.append(rub * rub)
        limit = taken(r, at) * self.square
        return joined(rest, across[0] + across[1] - limit * limit)

    def slope(self, unknown: np.ndarray) -> np.ndarray:
        """Their Jacobian."""
        n, at, r = self.instance.n, self.sliding, unknown[: self.instance.n]
        slope = np.zeros((unknown.size, unknown.size))
        slope[:n, :n] = self.instance.P.toarray()
        for first in self.open:
            slope[first : first + 3] = 0.0
            slope[range(first, first + 3), range(first, first + 3)] = 1.0
        for i, first in enumerate(at):
            for k in (1, 2):
                slope[first + k, first + k] += unknown[n + i]
                slope[first + k, n + i] = r[first + k]
                slope[n + i, first + k] = 2.0 * r[first + k]
            slope[n + i, first] = -2.0 * self.square[i] ** 2 * r[first]
        return slope

    def parts(self, unknown: Doubled) -> tuple[Doubled, Doubled, Doubled]:
        """Forces r, no y, and z = (u_n/μ + |u_t|, u_t)."""
        r = taken(unknown, slice(self.instance.n))
        u = product(self.instance.P, r) + self.instance.q
        normal = np.arange(0, u.hi.size, 3)
        for first in self.stuck:  # what is left there is rounding
            u.hi[first : first + 3] = u.lo[first : first + 3] = 0.0
        u.hi[self.sliding] = u.lo[self.sliding] = 0.0
        lifted = taken(u, normal) / Doubled(self.instance.friction, np.zeros(normal.size)) + speeds(u)
        u.hi[normal], u.lo[normal] = lifted.hi, lifted.lo
        return r, zeros(0), u
