"""Network in one mode: smooth differential equations with the torques of its locks.

What sticks (a link, or a group by its friction) is a lock: a row R of the speeds and a column H of accelerations for its
unit torque. Its torques λ follow from R (a + Hᵀ λ) = 0.
"""

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.rotors.links import TorsionSpring
from gauss.rotors.mechanics import Conditions, NetworkEquations, NetworkInstant
from gauss.rotors.mode import Mode, indicate
from gauss.rotors.pattern import group_pattern, resting_torques

DIRECTIONS = (1.0, -1.0)  # of breakaway
GROUP_WEIGHT = 1e3  # of friction of groups over that of links, where torques of locks are not unique
REDUNDANT_LOCK = 1e-13  # singular value, relative to the largest, of locks that depend on each other


class Lock(NamedTuple):
    """Sticking link or group: a torque within bounds keeps the slip rate u = row · w at zero."""

    kind: str  # "link", or "group" (stuck by dry friction and its own losses)
    place: int  # number of the link or group
    row: np.ndarray  # (n_g,) u over the speeds of the roots
    column: np.ndarray  # (n_g,) accelerations of the roots for the unit torque [1/(kg m²)]


class NetworkPhase:
    """Equations of a network in a mode."""

    def __init__(self, equations: NetworkEquations, mode: Mode):
        reduced = equations.reduced
        self.equations, self.reduced, self.mode = equations, reduced, mode
        self.f = np.array([link.factor(bool(forward)) for link, forward in zip(reduced.links, mode.forward, strict=True)])
        free = np.zeros(len(reduced.links)), np.zeros(reduced.n_groups)
        dry = np.array([mode.direction[reduced.group[j]] * np.sign(reduced.K[j]) for j in reduced.dry])
        self.conditions = Conditions(self.f, mode.state, free[0], dry, mode.gate, mode.dry_limit, free[1])
        self.locks = [self.lock(kind, index) for kind, index in self._stuck()]

    def _stuck(self) -> list[tuple[str, int]]:
        mode = self.mode
        found = [("link", b) for b in self.reduced.dry_links if mode.state[b] == 0]
        return found + [("group", int(g)) for g in np.flatnonzero(mode.direction == 0)]

    @cached_property
    def _factors(self):
        return self.reduced.factors(self.f)

    @property
    def inertia(self) -> np.ndarray:
        """Reduced inertia (n_g,) of the groups [kg m²]."""
        return self._factors[1]

    def lock(self, kind: str, index: int) -> Lock:
        """Row and column of a link or group that can stick."""
        reduced, (F, J) = self.reduced, self._factors
        row, column = np.zeros(reduced.n_groups), np.zeros(reduced.n_groups)
        if kind == "group":
            row[index], column[index] = 1.0, 1.0 / J[index]
        else:
            for shaft, sign, factor in (
                (reduced.driven[index], 1.0, 1.0),
                (reduced.driver[index], -1.0 / reduced.links[index].ratio, -self.f[index]),
            ):
                g = reduced.group[shaft]
                row[g] += sign * reduced.K[shaft]
                column[g] += factor * F[shaft] / J[g]
        return Lock(kind, index, row, column)

    def limits(self, lock: Lock, t: float) -> tuple[float, float]:
        """Bounds of the torque of a lock [N m]."""
        if lock.kind == "group":
            return -np.inf, np.inf
        return self.reduced.links[lock.place].bounds(t)

    @cached_property
    def _lock_matrix(self) -> np.ndarray:
        """Torques of the locks for accelerations of the roots, (locks, n_g): R (a + Hᵀ λ) = 0.

        Where they are not unique, the weighted least norm is taken: friction of groups before links.
        """
        R, H = (np.array([getattr(lock, key) for lock in self.locks]) for key in ("row", "column"))
        weight = np.array([GROUP_WEIGHT if lock.kind == "group" else 1.0 for lock in self.locks])
        return -weight[:, None] * np.linalg.lstsq((R @ H.T) * weight, R, rcond=REDUNDANT_LOCK)[0]

    def held(self, torques: np.ndarray) -> Conditions:
        """Conditions with these torques of the locks."""
        parts = {"link": np.zeros(len(self.f)), "group": np.zeros(self.reduced.n_groups)}
        for lock, torque in zip(self.locks, torques, strict=True):
            parts[lock.kind][lock.place] = torque
        return self.conditions._replace(held=parts["link"], stuck=parts["group"])

    def instant(self, t: float, theta, w) -> NetworkInstant:
        """Accelerations and torques."""
        return self.solve(t, theta, w)[0]

    def solve(self, t: float, theta, w) -> tuple[NetworkInstant, np.ndarray]:
        """Accelerations and torques, and the torques of the locks."""
        found = self.equations(t, theta, w, self.conditions)
        if not self.locks:
            return found, np.zeros(0)
        torques = self._lock_matrix @ found.acceleration
        found = self.equations(t, theta, w, self.held(torques))
        found.acceleration[self.standing()] = 0.0  # removes rounding
        return found, torques

    def landed(self, w: np.ndarray) -> np.ndarray:
        """Speeds of the roots projected onto the locks, in the metric of the kinetic energy."""
        if not self.locks:
            return w
        R, H = (np.array([getattr(lock, key) for lock in self.locks]) for key in ("row", "column"))
        w = w - H.T @ np.linalg.lstsq(R @ H.T, R @ w, rcond=REDUNDANT_LOCK)[0]
        for lock in self.locks:
            if lock.kind != "link":
                w[np.flatnonzero(lock.row)] = 0.0
        return w

    def size(self, t: float, theta, w, found: NetworkInstant) -> float:
        """Scale of torques: the largest single one that acts [N m], 1 if there is none."""
        reduced, sizes = self.reduced, [float(np.abs(found.torque).max(initial=0.0)), *self.mode.dry_limit]
        for term, gate in zip(reduced.terms, self.mode.gate, strict=True):
            j = reduced.names.index(term.shaft)
            g, k = reduced.group[j], reduced.K[j]
            sizes.append(gate * abs(float(term.law(t, reduced.angle[j] + k * theta[g], k * w[g]))))
        return max(sizes) or 1.0

    def link_torques(self, found: NetworkInstant) -> np.ndarray:
        """Q_em (n_l,) [N m]; one admissible set where power loops, or trains stuck at rest, leave them undetermined."""
        torque = self.reduced.split(found.torque).copy()
        for lock in self.locks:
            if lock.kind == "group":
                limits = [
                    (self.breakaway_torques(lock.place, found, s), self.breakaway(lock.place, found, s)[1])
                    for s in DIRECTIONS
                ]
                for b, value in resting_torques(self.reduced, lock.place, *limits).items():
                    torque[b] = value
        return torque

    def standing(self) -> np.ndarray:
        """Groups (n_g,) that stick at rest."""
        return self.mode.direction == 0

    def elastic(self, theta) -> np.ndarray:
        """Elastic energy (n_l,) of springs [J]."""
        reduced, energy = self.reduced, np.zeros(len(self.reduced.links))
        angle = reduced.angle + reduced.K * theta[reduced.group]
        for b, link in enumerate(reduced.links):
            if isinstance(link, TorsionSpring):
                twist = angle[reduced.driver[b]] / link.ratio - angle[reduced.driven[b]]
                energy[b] = float(link.energy(twist, self.mode.state[b]))  # type: ignore[arg-type]  # a number
        return energy

    def signed(self, theta, w, small: float) -> "NetworkPhase":
        """Return the phase with signs of indicators that have left zero."""
        if self.mode.signs.all():
            return self
        values = indicate(self.reduced, self.reduced.K * w[self.reduced.group])
        signs = np.where((self.mode.signs == 0) & (np.abs(values) > small), np.sign(values), self.mode.signs)
        if np.array_equal(signs, self.mode.signs):
            return self
        return NetworkPhase(self.equations, replace(self.mode, signs=signs))

    def breakaway(self, group: int, found: NetworkInstant, direction: float) -> tuple[float, np.ndarray]:
        """Acceleration and pattern of power flow of a group at rest that breaks away in a direction (1 or −1)."""
        reduced = self.reduced
        turning = np.where(reduced.group == group, direction * np.sign(reduced.K), 1.0)
        return group_pattern(reduced, group, self.breakaway_torques(group, found, direction), turning, self.mode.forward)

    def breakaway_torques(self, group: int, found: NetworkInstant, direction: float) -> np.ndarray:
        """Torques (n,) on the shafts but those of gears, of a group at rest that breaks away in a direction [N m].

        Dry friction of its shafts, and losses of the friction drives that they drive, oppose the coming motion.
        """
        reduced, applied = self.reduced, found.applied.copy()
        for d, j in enumerate(reduced.dry):
            if reduced.group[j] == group:
                coming = direction * np.sign(reduced.K[j])
                applied[j] += (self.conditions.dry[d] - coming) * self.mode.dry_limit[d]
        for b in reduced.lossy_drives[group]:
            link, j = reduced.links[b], reduced.driver[b]
            forward = found.torque[b] / link.ratio * direction * reduced.K[j] >= 0
            applied[j] += (self.f[b] - link.factor(bool(forward))) * found.torque[b]
        return applied
