"""Steady operation: every set of speeds at which nothing accelerates, and whether it is stable."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import brentq

from gauss.errors import SceneError, SimulationError
from gauss.rotors.contract import reduce
from gauss.rotors.laws import Constant, Periodic
from gauss.rotors.links import Gear, TorsionSpring
from gauss.rotors.mechanics import Equations
from gauss.rotors.mode_search import settle
from gauss.rotors.network import Network
from gauss.rotors.phase import Phase
from gauss.rotors.reduced import REST, Reduced

SCANNED = 400  # speeds of a network of one coordinate
STARTS = 400  # of Newton's method otherwise, at most
BARREN = 40  # starts in a row without a new point, after which there are thought to be no more
CHOSEN = 5  # links that may hold or slip, up to which all choices are tried; else all or none
RANGE = 1.3  # largest speed looked at, over the largest that the network knows of
TAIL = 100  # speeds beyond the range
FARTHEST = 1e6  # ranges beyond which nothing is looked for
NEWTON = 30  # steps
SAME = 1e-6  # speeds that differ by less, over the largest, are one point
ZERO = 1e-10  # torque that is left, over the largest torque
SLIPS = (0.002, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0)  # where Newton's method starts


@dataclass(frozen=True)
class OperatingPoint:
    """Steady operation.

    Parameters
    ----------
    reduced : Reduced
        The network, springs taken as rigid.
    speeds : ndarray, shape (n,)
        Of the shafts [rad/s].
    torques : ndarray, shape (n_l,)
        Q_em of the links [N m].
    stuck : ndarray of bool, shape (n,)
        Shafts that friction holds.
    eigenvalues : ndarray
        Of the deviation of the speeds that are free [1/s].
    input, useful, bearings : float
        Power of motors, loads and bearings [W].
    slip_loss, mesh_loss : ndarray, shape (n_l,)
        Power lost in the links [W].
    """

    reduced: Reduced
    speeds: np.ndarray
    torques: np.ndarray
    stuck: np.ndarray
    eigenvalues: np.ndarray
    input: float
    useful: float
    bearings: float
    slip_loss: np.ndarray
    mesh_loss: np.ndarray

    @property
    def stable(self) -> bool:
        """Whether a small deviation dies out."""
        return bool((self.eigenvalues.real < 0).all())

    @property
    def efficiency(self) -> float:
        """Useful power over input, nan without input."""
        return self.useful / self.input if self.input > 0 else float("nan")

    def speed(self, shaft) -> float:
        """Speed of a shaft [rad/s]."""
        return float(self.speeds[self.reduced.names.index(self.reduced.network.require_shaft(shaft))])

    def slip(self, link) -> float:
        """Slip 1 − i ω_driven/ω_driver (III.73) of a link; nan where the driver stands."""
        b = list(self.reduced.network.links).index(getattr(link, "name", link))
        v_d = self.speeds[self.reduced.driver[b]]
        return float(1.0 - self.reduced.links[b].ratio * self.speeds[self.reduced.driven[b]] / v_d) if v_d else float("nan")


def operating_points(network: Network, t: float = 0.0) -> list[OperatingPoint]:
    """All steady operating points that are found, slowest first.

    Every choice of clutches that hold is tried. What is then of one coordinate is scanned over its range of speeds; else
    Newton's method starts from many combinations of speeds, slips and shafts at rest. Springs are rigid, torques periodic
    in the angle act with their mean, other functions of the angle as at the start.

    Parameters
    ----------
    network : Network
        What turns.
    t : float
        Time [s] whose torques act.

    Returns
    -------
    list of OperatingPoint
        Speeds [rad/s] and torques of each, and whether it is stable.
    """
    v_0 = reduce(network).v_0
    reduced = replace(reduce(_rigid(network, ())), v_0=v_0)
    equations, roots = Equations(reduced), list(reduced.roots)
    largest = reduced.v_0 / REST
    found: list[Phase] = []
    points: list[np.ndarray] = []
    for speeds in _candidates(network, t, v_0):
        w = speeds[roots]
        if all(np.abs(w - other).max() > SAME * largest for other in points):
            phase = settle(equations, t, np.zeros_like(w), w)
            if _left(phase, t, w) <= ZERO:
                points.append(w)
                found.append(phase)
    result = [_point(phase, t, w) for phase, w in zip(found, points, strict=True)]
    return sorted(result, key=lambda point: tuple(np.abs(point.speeds)))


def _candidates(network: Network, t: float, v_0: float):
    """Speeds (n,) of the shafts that might be steady, for every choice of clutches and the like that hold."""
    dry = [link.name for link in network.links.values() if link.dry]
    choices = [range(len(dry) + 1)] if len(dry) <= CHOSEN else [(0, len(dry))]
    for held in (names for count in choices[0] for names in combinations(dry, count)):
        try:
            reduced = replace(reduce(_rigid(network, held)), v_0=v_0)
        except SceneError:  # what holds closes a loop of other ratios: these cannot all hold
            continue
        search = _scan if reduced.n_groups == 1 else _newton_from_everywhere
        for w in search(Equations(reduced), t, RANGE * v_0 / REST):
            yield reduced.K * w[reduced.group]


def _rigid(network: Network, held) -> Network:
    """The network as it turns steadily, some links holding like gears."""
    rigid = Network(network.name)
    for shaft in network.shafts.values():
        rigid.add(replace(shaft, speed=None))  # those at the start need not fit
    for link in network.links.values():
        elastic = isinstance(link, TorsionSpring) and link.stiffness
        binds = elastic or link.name in held
        rigid.add(Gear(link.name, link.driven, link.driver, link.ratio) if binds else link)
    for torque in network.torques.values():
        periodic = isinstance(torque.law, Periodic)
        rigid.add(replace(torque, law=Constant(float(np.mean(torque.law.torque)))) if periodic else torque)
    return Network(
        rigid.name, {name: replace(x, speed=None) for name, x in rigid.shafts.items()}, rigid.links, rigid.torques
    )


def _torques(phase: Phase, t: float, w) -> np.ndarray:
    """What is left to accelerate each group [N m]."""
    return phase.instant(t, np.zeros_like(w), w).acceleration * phase.reduced.factors(phase.f)[1]


def _left(phase: Phase, t: float, w) -> float:
    """Largest torque that is left, over the largest that acts."""
    found = phase.instant(t, np.zeros_like(w), w)
    return float(np.abs(_torques(phase, t, w)).max() / phase.size(t, np.zeros_like(w), w, found))


def _scan(equations: Equations, t: float, largest: float):
    """Roots of the torque over the speed of the only group."""

    def left(speed: float) -> float:
        w = np.array([speed])
        return float(_torques(settle(equations, t, np.zeros(1), w), t, w)[0])

    # evenly over the range that the network knows of, and far beyond in case that nothing said how fast it may turn
    ways = np.concatenate([np.linspace(largest * REST, largest, SCANNED), largest * np.geomspace(1.0, FARTHEST, TAIL)[1:]])
    grid = np.concatenate([-ways[::-1], ways])
    values = [left(speed) for speed in grid]
    yield np.zeros(1)
    for a, b, u, v in zip(grid, grid[1:], values, values[1:], strict=False):
        if u == 0.0:
            yield np.array([a])
        elif u * v < 0 and a * b > 0:
            yield np.array([brentq(left, a, b, xtol=1e-14 * largest, rtol=1e-15)])


def _newton_from_everywhere(equations: Equations, t: float, largest: float):
    """Speeds at which Newton's method ends; it gives up when many starts in a row lead nowhere new."""
    rng, known, barren = np.random.default_rng(0), [], 0
    for _ in range(STARTS):
        try:
            found = _newton(equations, t, _guess(equations.reduced, rng, largest), largest)
        except SimulationError:
            found = None
        if found is not None and all(np.abs(found - other).max() > SAME * largest for other in known):
            known.append(found)
            barren = 0
            yield found
        elif (barren := barren + 1) >= BARREN:
            return


def _guess(reduced: Reduced, rng, largest: float) -> np.ndarray:
    """Speeds with a slip of each friction drive, some groups at rest."""
    w = rng.uniform(-0.2, 1.0, reduced.n_groups) * largest / np.abs(reduced.K).max()
    for _ in reduced.friction_drives:  # as often as the longest chain needs
        for b in reduced.friction_drives:
            p, d = reduced.driver[b], reduced.driven[b]
            slip = SLIPS[(b * 5 + int(rng.integers(len(SLIPS)))) % len(SLIPS)]
            w[reduced.group[d]] = (1 - slip) * reduced.K[p] * w[reduced.group[p]] / (reduced.ratio[b] * reduced.K[d])
    for g in reduced.rubbing:
        if rng.random() < 0.3:
            w[g] = 0.0
    return w


def _newton(equations: Equations, t: float, w: np.ndarray, largest: float) -> np.ndarray | None:
    """Speeds without acceleration near a guess; the mode is found anew at every step."""
    for _ in range(NEWTON):
        phase = settle(equations, t, np.zeros_like(w), w)
        left = _torques(phase, t, w)
        if _left(phase, t, w) <= 0.1 * ZERO:
            return w
        free = np.flatnonzero(phase.mode.direction != 0)
        slopes = _slopes(phase, t, w)[np.ix_(free, free)]
        step = np.zeros_like(w)
        step[free] = -np.linalg.lstsq(slopes, phase.instant(t, np.zeros_like(w), w).acceleration[free], rcond=None)[0]
        share = 1.0
        while share > 1e-3 and np.abs(_torques(phase, t, w + share * step)).max() >= np.abs(left).max():
            share *= 0.5
        moved = w + share * step
        crossing = (np.sign(moved) != np.sign(w)) & (w != 0) & np.isin(np.arange(len(w)), equations.reduced.rubbing)
        w = np.where(crossing, 0.0, moved)  # friction may hold what passes through rest
        if np.abs(w).max() > FARTHEST * largest or not np.isfinite(w).all():
            return None
    return w if _left(settle(equations, t, np.zeros_like(w), w), t, w) <= ZERO else None


def _slopes(phase: Phase, t: float, w) -> np.ndarray:
    """∂ω̇/∂ω of the roots in a mode, by central differences."""
    size = 1e-2 * phase.reduced.v_0
    columns = []
    for k in range(len(w)):
        step = size * (np.arange(len(w)) == k)
        ahead, back = (phase.instant(t, np.zeros_like(w), w + way * step).acceleration for way in (1.0, -1.0))
        columns.append((ahead - back) / (2 * size))
    return np.array(columns).T


def _point(phase: Phase, t: float, w: np.ndarray) -> OperatingPoint:
    reduced = phase.reduced
    found = phase.instant(t, np.zeros_like(w), w)
    free = np.flatnonzero(phase.mode.direction != 0)
    slopes = _slopes(phase, t, w)[np.ix_(free, free)]
    rows = [lock.row[free] for lock in phase.locks if lock.kind == "link"]
    if rows and free.size:  # links that hold take freedoms away: their deviations are not free to decay
        _, s, Vt = np.linalg.svd(np.array(rows))
        basis = Vt[int((s > 1e-12).sum()) :].T
        slopes = basis.T @ slopes @ basis
    motor, load, loss = found.power
    return OperatingPoint(
        reduced,
        reduced.K * w[reduced.group],
        phase.link_torques(found),
        phase.standing()[reduced.group],
        np.linalg.eigvals(slopes) if slopes.size else np.zeros(0),
        float(motor),
        float(-load),
        float(-loss),
        found.slipped,
        found.meshed,
    )
