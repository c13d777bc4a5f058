"""The network in minimal coordinates: every set of shafts bound by gears is one.

Inside a group α̈_j = K_j α̈_root, and a torque on shaft j acts on the root with the factor F_j: the products of the speed
factors k = (1 − ε)/i and of the torque factors f along the tree of gears (Rotor chains, section 2, III.52–III.64).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.errors import StateError, did_you_mean
from gauss.rotors.elements import Torque
from gauss.rotors.friction_links import FrictionDrive
from gauss.rotors.links import GearPair
from gauss.rotors.network import Network
from gauss.scene.builder import name_of

CYCLE = 1e-9  # relative difference of ratios round a cycle that rounding of typed numbers explains
REST_SPEED = 1e-6  # v_0 relative to the largest known speed (Rotor chains, section 4)
SLOW_SPEED = 1e-2  # slow speed relative to the largest known one


class GearBranch(NamedTuple):
    """Gear between a shaft and its parent on the way to the root."""

    link: int  # link, child, parent: indices
    child: int
    parent: int
    rate: float  # ω_child/ω_parent
    forward: bool  # whether the child is the driven shaft


@dataclass(frozen=True)
class ReducedNetwork:
    """Network in minimal coordinates.

    Parameters
    ----------
    names : tuple of str
        Shafts, n of them.
    links : tuple of ShaftLink
        Links, n_l of them.
    driven, driver : ndarray of int, shape (n_l,)
        Shafts of each link.
    inertia : ndarray, shape (n,)
        J [kg m²].
    group, K : ndarray, shape (n,)
        Group of each shaft, and its speed over that of the root of the group.
    roots : tuple of int
        Root shaft of each group, n_g of them.
    inward : tuple of GearBranch
        Gears from the leaves to the roots.
    redundant : tuple of int
        Gears that close a loop, redundant constraints.
    terms : tuple of Torque
        Applied torques that are functions.
    dry : dict of int to list of Torque
        Dry friction of shafts.
    angle : ndarray, shape (n,)
        Angles at the start [rad].
    speed : ndarray, shape (n_g,)
        Speeds of the roots at the start [rad/s].
    v_0 : float
        Speed below which a friction drive counts as at rest [rad/s].
    """

    network: Network
    names: tuple
    links: tuple
    driven: np.ndarray
    driver: np.ndarray
    inertia: np.ndarray
    group: np.ndarray
    K: np.ndarray
    roots: tuple
    inward: tuple
    redundant: tuple
    terms: tuple
    dry: dict
    angle: np.ndarray
    speed: np.ndarray
    v_0: float

    @property
    def largest(self) -> float:
        """Largest speed given in the network [rad/s]."""
        return self.v_0 / REST_SPEED

    @property
    def slow(self) -> float:
        """Scale of slow speeds [rad/s]; that of angles is 1 rad."""
        return SLOW_SPEED * self.largest

    @property
    def n_groups(self) -> int:
        """Number of coordinates."""
        return len(self.roots)

    def shaft_place(self, shaft) -> int:
        """Index of a shaft, or of its name; SceneError if there is none."""
        return self.names.index(self.network.require_shaft(shaft))

    def link_place(self, link) -> int:
        """Index of a link, or of its name; StateError if there is none."""
        name, names = name_of(link), [one.name for one in self.links]
        if name not in names:
            raise StateError(f"no link {name!r} in {self.network.name!r}. {did_you_mean(str(name), names)}")
        return names.index(name)

    @cached_property
    def frictional(self) -> tuple[int, ...]:
        """Groups with friction that depends on the sense of rotation: they can stick at rest."""
        return tuple(sorted({int(self.group[j]) for j in (*self.dry, *self.driver[self.lossy])}))

    def branches(self, group: int) -> list[GearBranch]:
        """Gears of one group, from the leaves inward."""
        return self._branches[group]

    @cached_property
    def _branches(self) -> list[list[GearBranch]]:
        found: list[list[GearBranch]] = [[] for _ in self.roots]
        for branch in self.inward:
            found[self.group[branch.child]].append(branch)
        return found

    @cached_property
    def ratio(self) -> np.ndarray:
        """Ratios (n_l,) of the links."""
        return np.array([link.ratio for link in self.links])

    @cached_property
    def lossy(self) -> np.ndarray:
        """Links whose torque factor depends on the direction of the power."""
        return np.array([b for b, link in enumerate(self.links) if link.lossy], dtype=int)

    @cached_property
    def lossy_drives(self) -> list[list[int]]:
        """For each group the lossy links, but gears, driven by its shafts."""
        found: list[list[int]] = [[] for _ in self.roots]
        for b in self.lossy:
            if not isinstance(self.links[b], GearPair):
                found[self.group[self.driver[b]]].append(int(b))
        return found

    @cached_property
    def dry_links(self) -> list[int]:
        """Links that can stick and slip."""
        return [b for b, link in enumerate(self.links) if link.dry]

    @cached_property
    def loose_springs(self) -> list[int]:
        """Springs with backlash."""
        return [b for b, link in enumerate(self.links) if link.backlash]

    @cached_property
    def friction_drives(self) -> list[int]:
        """Friction drives."""
        return [b for b, link in enumerate(self.links) if isinstance(link, FrictionDrive)]

    def factors(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (n,) of all shafts and J_pr (n_g,) [kg m²] of all groups, for torque factors f (n_l,) of the links."""
        F = np.ones(len(self.names))
        for branch in reversed(self.inward):
            F[branch.child] = F[branch.parent] * psi(branch, f)
        return F, np.bincount(self.group, self.inertia * self.K * F, self.n_groups)

    def split(self, torque: np.ndarray) -> np.ndarray:
        """Link torques (…, n_l) with those in power loops replaced by the split of least norm of the multipliers.

        The motion determines them only up to torques that circulate; λ = Q_em/i (III.70).
        """
        for links, N in self._loops:
            ratios = self.ratio[links]
            multipliers = torque[..., links] / ratios
            torque = torque.copy()
            torque[..., links] = (multipliers - (multipliers @ N) @ N.T) * ratios
        return torque

    @cached_property
    def _loops(self) -> list[tuple]:
        """Gears of each group with loops, and an orthonormal basis of the self-stresses (multipliers without effect)."""
        found = []
        for group in sorted({int(self.group[self.driven[b]]) for b in self.redundant}):
            links = [
                b for b, link in enumerate(self.links) if isinstance(link, GearPair) and self.group[self.driven[b]] == group
            ]
            U, s, _ = np.linalg.svd(gear_rows(self, links))
            found.append((links, U[:, int((s > CYCLE * s[0]).sum()) :]))
        return found


def psi(branch: GearBranch, f):
    """Torque on the parent for a torque on the child."""
    return f[branch.link] if branch.forward else 1.0 / f[branch.link]


def gear_rows(reduced: ReducedNetwork, links) -> np.ndarray:
    """Rows i ω_driven − (1 − ε) ω_driver = 0 (III.12) of gears, (rows, n)."""
    rows = np.zeros((len(links), len(reduced.names)))
    for row, b in zip(rows, links, strict=True):
        row[reduced.driven[b]] += reduced.links[b].ratio
        row[reduced.driver[b]] -= 1.0 - reduced.links[b].slip
    return rows


def active(terms: tuple[Torque, ...], t: float) -> np.ndarray:
    """1 for torques that act at a time and just after it, else 0."""
    return np.array([float(torque.active(t)) for torque in terms])
