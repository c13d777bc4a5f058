"""Search for steady operating points: ω̇ = 0 for every choice of links that stick.

One coordinate is scanned over its range of speeds (Brent's method between changes of sign); several are solved by Newton's
method from many starts, the mode being searched anew at every step.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.optimize import brentq

from gauss.errors import SceneError, SimulationError
from gauss.rotors.contract import reduce
from gauss.rotors.laws import Constant, Periodic
from gauss.rotors.links import GearPair, TorsionSpring
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.mode_search import find_phase
from gauss.rotors.network import Network
from gauss.rotors.operating_point import OperatingPoint, point_of, slopes
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import REST_SPEED, ReducedNetwork
from gauss.scene import values

SCANNED = 400  # speeds of a network of one coordinate
STARTS = 400  # of Newton's method otherwise, at most
MOST_FRUITLESS_STARTS = 40  # in a row without a new point
MOST_CHOSEN = 5  # dry links up to which all choices of sticking ones are tried; else all or none
SPEED_RANGE = 1.3  # largest speed searched, relative to the largest known one
TAIL_SPEEDS = 100  # speeds beyond the range
FARTHEST = 1e6  # ranges: limit of the search
NEWTON_STEPS = 30
SMALLEST_STEP = 1e-3  # of a Newton step in the line search
SPEED_DIFFERENCE = 1e-6  # relative to the largest speed: closer points are one
RESIDUAL_TORQUE = 1e-10  # relative to the largest torque
SLIPS = (0.002, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0)  # at starts of Newton's method


def operating_points(network: Network, t: float = 0.0) -> list[OperatingPoint]:
    """All steady operating points that are found, slowest first.

    Every choice of sticking links is tried. A network that is then of one coordinate is scanned over its range of speeds;
    else Newton's method starts from many combinations of speeds, slips and shafts at rest. Springs are rigid, torques
    periodic in the angle act with their mean, other functions of the angle as at the start.

    Parameters
    ----------
    network : Network
        The network.
    t : float
        Time at which torques are evaluated [s].

    Returns
    -------
    list of OperatingPoint
        Speeds [rad/s] and torques of each, and whether it is stable.

    Raises
    ------
    SceneError
        If the time is no finite number.
    """
    t = values.number(t, "operating_points: t", "s")
    v_0 = reduce(network).v_0
    reduced = replace(reduce(_rigid(network, ())), v_0=v_0)
    equations, roots = NetworkEquations(reduced), list(reduced.roots)
    found: list[NetworkPhase] = []
    points: list[np.ndarray] = []
    for speeds in _candidates(network, t, v_0):
        w = speeds[roots]
        if all(np.abs(w - other).max() > SPEED_DIFFERENCE * reduced.largest for other in points):
            phase = find_phase(equations, t, np.zeros_like(w), w)
            if _residual(phase, t, w) <= RESIDUAL_TORQUE:
                points.append(w)
                found.append(phase)
    result = [point_of(phase, t, w) for phase, w in zip(found, points, strict=True)]
    return sorted(result, key=lambda point: tuple(np.abs(point.speeds)))


def _candidates(network: Network, t: float, v_0: float):
    """Speeds (n,) of the shafts that might be steady, for every choice of sticking links."""
    dry = [link.name for link in network.links.values() if link.dry]
    counts = range(len(dry) + 1) if len(dry) <= MOST_CHOSEN else (0, len(dry))
    for held in (names for count in counts for names in combinations(dry, count)):
        try:
            reduced = replace(reduce(_rigid(network, held)), v_0=v_0)
        except SceneError:  # the links close a loop whose ratios contradict: they cannot all stick
            continue
        search = _scan if reduced.n_groups == 1 else _newton_from_everywhere
        for w in search(NetworkEquations(reduced), t, SPEED_RANGE * v_0 / REST_SPEED):
            yield reduced.K * w[reduced.group]


def _rigid(network: Network, held) -> Network:
    """Network in steady operation: rigid springs, mean periodic torques, sticking links as gears."""
    rigid = Network(network.name)
    for shaft in network.shafts.values():
        rigid.add(replace(shaft, speed=None))  # initial speeds need not fit
    for link in network.links.values():
        elastic = isinstance(link, TorsionSpring) and link.stiffness
        binds = elastic or link.name in held
        rigid.add(GearPair(link.name, link.driven, link.driver, link.ratio) if binds else link)
    for torque in network.torques.values():
        if isinstance(torque.law, Periodic):
            torque = replace(torque, law=Constant(float(np.mean(torque.law.torque))))
        rigid.add(torque)
    return rigid


def _torques(phase: NetworkPhase, t: float, w) -> np.ndarray:
    """Residual torques (n_g,) of the groups [N m]."""
    return phase.instant(t, np.zeros_like(w), w).acceleration * phase.reduced.factors(phase.f)[1]


def _residual(phase: NetworkPhase, t: float, w) -> float:
    """Largest residual torque, relative to the scale of torques."""
    found = phase.instant(t, np.zeros_like(w), w)
    return float(np.abs(_torques(phase, t, w)).max() / phase.size(t, np.zeros_like(w), w, found))


def _scan(equations: NetworkEquations, t: float, largest: float):
    """Roots of the torque over the speed of the only group."""

    def residual(speed: float) -> float:
        w = np.array([speed])
        return float(_torques(find_phase(equations, t, np.zeros(1), w), t, w)[0])

    # evenly over the range, and far beyond it in case that no initial or no-load speed is known
    speeds = np.concatenate(
        [np.linspace(largest * REST_SPEED, largest, SCANNED), largest * np.geomspace(1.0, FARTHEST, TAIL_SPEEDS)[1:]]
    )
    grid = np.concatenate([-speeds[::-1], speeds])
    torques = [residual(speed) for speed in grid]
    yield np.zeros(1)
    for a, b, u, v in zip(grid, grid[1:], torques, torques[1:], strict=False):
        if u == 0.0:
            yield np.array([a])
        elif u * v < 0 and a * b > 0:
            yield np.array([brentq(residual, a, b, xtol=1e-14 * largest, rtol=1e-15)])


def _newton_from_everywhere(equations: NetworkEquations, t: float, largest: float):
    """Speeds found by Newton's method, until many starts in a row find nothing new."""
    rng, fruitless = np.random.default_rng(0), 0
    known: list[np.ndarray] = []
    for _ in range(STARTS):
        try:
            found = _newton(equations, t, _guess(equations.reduced, rng, largest), largest)
        except SimulationError:
            found = None
        if found is not None and all(np.abs(found - other).max() > SPEED_DIFFERENCE * largest for other in known):
            known.append(found)
            fruitless = 0
            yield found
        elif (fruitless := fruitless + 1) >= MOST_FRUITLESS_STARTS:
            return


def _guess(reduced: ReducedNetwork, rng, largest: float) -> np.ndarray:
    """Random speeds with a slip of each friction drive, some groups at rest."""
    w = rng.uniform(-0.2, 1.0, reduced.n_groups) * largest / np.abs(reduced.K).max()
    for _ in reduced.friction_drives:  # as often as the longest chain needs
        for b in reduced.friction_drives:
            p, d = reduced.driver[b], reduced.driven[b]
            slip = SLIPS[(b * 5 + int(rng.integers(len(SLIPS)))) % len(SLIPS)]
            w[reduced.group[d]] = (1 - slip) * reduced.K[p] * w[reduced.group[p]] / (reduced.ratio[b] * reduced.K[d])
    for g in reduced.frictional:
        if rng.random() < 0.3:
            w[g] = 0.0
    return w


def _newton(equations: NetworkEquations, t: float, w: np.ndarray, largest: float) -> np.ndarray | None:
    """Speeds without acceleration near a guess; the mode is searched anew at every step."""
    for _ in range(NEWTON_STEPS):
        phase = find_phase(equations, t, np.zeros_like(w), w)
        residual = _torques(phase, t, w)
        if _residual(phase, t, w) <= 0.1 * RESIDUAL_TORQUE:
            return w
        free = np.flatnonzero(phase.mode.direction != 0)
        A = slopes(phase, t, w)[np.ix_(free, free)]
        step = np.zeros_like(w)
        step[free] = -np.linalg.lstsq(A, phase.instant(t, np.zeros_like(w), w).acceleration[free], rcond=None)[0]
        share = 1.0
        while share > SMALLEST_STEP and np.abs(_torques(phase, t, w + share * step)).max() >= np.abs(residual).max():
            share *= 0.5
        moved = w + share * step
        crossing = (np.sign(moved) != np.sign(w)) & (w != 0) & np.isin(np.arange(len(w)), equations.reduced.frictional)
        w = np.where(crossing, 0.0, moved)  # what passes through rest may stick
        if np.abs(w).max() > FARTHEST * largest or not np.isfinite(w).all():
            return None
    return w if _residual(find_phase(equations, t, np.zeros_like(w), w), t, w) <= RESIDUAL_TORQUE else None
