"""A network in one mode: a plain system of differential equations, and how far it is from leaving the mode."""

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.rotors.links import TorsionSpring
from gauss.rotors.mechanics import Conditions, Equations, Instant, link_ends
from gauss.rotors.mode import Mode, indicate
from gauss.rotors.pattern import group_pattern, resting_torques
from gauss.rotors.reduced import REST

WAYS = (1.0, -1.0)
FIRM = 1e3  # how much rather a group is held by its own friction than through a link
RANK = 1e-13  # singular values below this, over the largest, belong to locks that hold the same thing


class Lock(NamedTuple):
    """Something that holds: the rate u = row · w is zero by a torque within bounds.

    Attributes
    ----------
    kind : str
        "link", or "group" (held by dry friction and its own losses).
    index : int
        Which.
    row : ndarray, shape (n_g,)
        u over the speeds of the roots.
    column : ndarray, shape (n_g,)
        Accelerations of the roots for the unit torque [1/(kg m²)].
    """

    kind: str
    index: int
    row: np.ndarray
    column: np.ndarray


class Phase:
    """Equations of a network in a mode.

    Parameters
    ----------
    equations : Equations
        Equations of the network.
    mode : Mode
        Mode.
    """

    def __init__(self, equations: Equations, mode: Mode):
        reduced = equations.reduced
        self.equations, self.reduced, self.mode = equations, reduced, mode
        self.f = np.array([link.factor(bool(way)) for link, way in zip(reduced.links, mode.forward, strict=True)])
        free = np.zeros(len(reduced.links)), np.zeros(reduced.n_groups)
        dry = np.array([mode.direction[reduced.group[j]] * np.sign(reduced.K[j]) for j in reduced.dry])
        self.conditions = Conditions(self.f, mode.state, free[0], dry, mode.gate, mode.dry_limit, free[1])
        self.locks = [self.lock(kind, index) for kind, index in self._holding()]

    def _holding(self) -> list[tuple[str, int]]:
        mode = self.mode
        found = [("link", b) for b in self.reduced.dry_links if mode.state[b] == 0]
        return found + [("group", int(g)) for g in np.flatnonzero(mode.direction == 0)]

    @cached_property
    def _factors(self):
        return self.reduced.factors(self.f)

    def lock(self, kind: str, index: int) -> Lock:
        """Row and column of something that can hold."""
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
        """Bounds of the torque of something that holds [N m]."""
        if lock.kind == "group":
            return -np.inf, np.inf
        return self.reduced.links[lock.index].bounds(t)

    @cached_property
    def _holding_matrix(self) -> np.ndarray:
        """Torques of the locks for accelerations of the roots, (locks, n_g): R (a + Hᵀ λ) = 0.

        Where they are not unique, what can bear more takes more: friction of groups before links.
        """
        R, H = (np.array([getattr(lock, key) for lock in self.locks]) for key in ("row", "column"))
        weight = np.array([FIRM if lock.kind == "group" else 1.0 for lock in self.locks])
        return -weight[:, None] * np.linalg.lstsq((R @ H.T) * weight, R, rcond=RANK)[0]

    def held(self, torques: np.ndarray) -> Conditions:
        """Conditions with these torques of the locks."""
        parts = {"link": np.zeros(len(self.f)), "group": np.zeros(self.reduced.n_groups)}
        for lock, torque in zip(self.locks, torques, strict=True):
            parts[lock.kind][lock.index] = torque
        return self.conditions._replace(held=parts["link"], stuck=parts["group"])

    def instant(self, t: float, theta, w) -> Instant:
        """Accelerations and torques."""
        return self.solve(t, theta, w)[0]

    def solve(self, t: float, theta, w) -> tuple[Instant, np.ndarray]:
        """Accelerations and torques, and the torques of the locks."""
        found = self.equations(t, theta, w, self.conditions)
        if not self.locks:
            return found, np.zeros(0)
        torques = self._holding_matrix @ found.acceleration
        found = self.equations(t, theta, w, self.held(torques))
        found.acceleration[self.standing()] = 0.0  # what is left is rounding
        return found, torques

    def landed(self, w: np.ndarray) -> np.ndarray:
        """Speeds of the roots that the locks allow, nearest in the metric of the kinetic energy."""
        if not self.locks:
            return w
        R, H = (np.array([getattr(lock, key) for lock in self.locks]) for key in ("row", "column"))
        w = w - H.T @ np.linalg.lstsq(R @ H.T, R @ w, rcond=RANK)[0]
        for lock in self.locks:
            if lock.kind != "link":
                w[np.flatnonzero(lock.row)] = 0.0
        return w

    def size(self, t: float, theta, w, found: Instant) -> float:
        """Largest single torque that acts [N m], 1 if there is none: what torques are compared with."""
        reduced, sizes = self.reduced, [float(np.abs(found.torque).max(initial=0.0)), *self.mode.dry_limit]
        for term, gate in zip(reduced.terms, self.mode.gate, strict=True):
            j = reduced.names.index(term.shaft)
            g, k = reduced.group[j], reduced.K[j]
            sizes.append(gate * abs(float(term.law(t, reduced.angle[j] + k * theta[g], k * w[g]))))
        return max(sizes) or 1.0

    def link_torques(self, found: Instant) -> np.ndarray:
        """Q_em (n_l,) [N m]; where they are not unique, of power loops and of trains stuck at rest, a definite choice."""
        torque = self.reduced.split(found.torque).copy()
        for lock in self.locks:
            if lock.kind == "group":
                ways = [(self.starting(lock.index, found, way), self.setting_out(lock.index, found, way)[1]) for way in WAYS]
                for b, value in resting_torques(self.reduced, lock.index, *ways).items():
                    torque[b] = value
        return torque

    def standing(self) -> np.ndarray:
        """Groups (n_g,) held by friction."""
        return self.mode.direction == 0

    def elastic(self, theta) -> np.ndarray:
        """Elastic energy (n_l,) of springs [J]."""
        reduced, energy = self.reduced, np.zeros(len(self.reduced.links))
        angle = reduced.angle + reduced.K * theta[reduced.group]
        for b, link in enumerate(reduced.links):
            if isinstance(link, TorsionSpring):
                twist = angle[reduced.driver[b]] / link.ratio - angle[reduced.driven[b]]
                energy[b] = link.energy(twist, self.mode.state[b])
        return energy

    def woken(self, theta, w, small: float) -> "Phase":
        """Return the phase with signs of indicators that were at zero and are not any more."""
        if self.mode.signs.all():
            return self
        values = indicate(self.reduced, self.reduced.K * w[self.reduced.group])
        signs = np.where((self.mode.signs == 0) & (np.abs(values) > small), np.sign(values), self.mode.signs)
        if np.array_equal(signs, self.mode.signs):
            return self
        return Phase(self.equations, replace(self.mode, signs=signs))

    # Margins: each is positive while the mode is right, and relative to its own scale.

    def margins(self, t: float, theta, w, scale: float) -> tuple[list, np.ndarray]:
        """What could end the mode, as (kind, index), and how far it is from that.

        Parameters
        ----------
        t, theta, w
            Where the network is.
        scale : float
            Size of the torques [N m].
        """
        reduced, mode = self.reduced, self.mode
        found, torques = self.solve(t, theta, w)
        speed, largest = reduced.K * w[reduced.group], reduced.largest
        turning = reduced.lossy[~self.standing()[reduced.group[reduced.driver[reduced.lossy]]]]
        flow = found.torque[turning] * speed[reduced.driver[turning]] / (reduced.ratio[turning] * largest * scale)
        keys = [("flow", int(b)) for b in turning]
        values = [*np.where(mode.forward[turning], flow, -flow)]
        for b in reduced.dry_links:
            if mode.state[b]:
                lead = speed[reduced.driver[b]] / reduced.ratio[b] - speed[reduced.driven[b]]
                keys.append(("link", b))
                values.append(lead * mode.state[b] / largest)
        for b in reduced.loose_springs:
            keys.append(("flank", b))
            values.append(self._flank(b, reduced.links[b], t, theta, speed))
        for g in reduced.rubbing:
            if mode.direction[g]:
                keys.append(("group", g))
                values.append(w[g] * mode.direction[g] / largest)
        for lock, torque in zip(self.locks, torques, strict=True):
            keys.append((lock.kind, lock.index))
            if lock.kind == "group":
                starts = [self.setting_out(lock.index, found, way)[0] * way for way in WAYS]
                values.append(-max(starts) * self._factors[1][lock.index] / scale)
            else:
                low, high = self.limits(lock, t)
                values.append(min(high - torque, torque - low) / scale)
        signs = indicate(reduced, speed) * mode.signs
        keys += [("indicator", i) for i in range(len(signs))]
        values += [*np.where(mode.signs == 0, np.inf, signs * REST)]
        return keys, np.array(values)

    def _flank(self, b: int, link: TorsionSpring, t, theta, speed) -> float:
        """How far a spring with backlash is from touching, or from leaving its flank."""
        reduced = self.reduced
        ends = link_ends(reduced, b, t, reduced.angle + reduced.K * theta[reduced.group], speed)
        touches = [link.touch(ends.twist, ends.lead, side) for side in (-1.0, 1.0)]
        return touches[int(self.mode.state[b] > 0)] if self.mode.state[b] else -max(touches)

    def setting_out(self, group: int, found: Instant, way: float) -> tuple[float, np.ndarray]:
        """Acceleration and pattern of a group at rest if it sets out this way."""
        reduced = self.reduced
        turning = np.where(reduced.group == group, way * np.sign(reduced.K), 1.0)
        return group_pattern(reduced, group, self.starting(group, found, way), turning, self.mode.forward)

    def starting(self, group: int, found: Instant, way: float) -> np.ndarray:
        """Torques (n,) on the shafts but those of gears, if a group at rest sets out this way [N m].

        Dry friction of its shafts, and losses of the friction drives that they drive, oppose the coming motion.
        """
        reduced, applied = self.reduced, found.applied.copy()
        for d, j in enumerate(reduced.dry):
            if reduced.group[j] == group:
                coming = way * np.sign(reduced.K[j])
                applied[j] += (self.conditions.dry[d] - coming) * self.mode.dry_limit[d]
        for b in reduced.lossy_drives[group]:
            link, j = reduced.links[b], reduced.driver[b]
            forward = found.torque[b] / link.ratio * way * reduced.K[j] >= 0
            applied[j] += (self.f[b] - link.factor(bool(forward))) * found.torque[b]
        return applied
