"""Torsional vibrations: eigenfrequencies and modes K φ = ω² M φ, and Campbell diagrams."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh, null_space

from gauss.arguments import real_array
from gauss.errors import SceneError
from gauss.rotors.contract import reduce
from gauss.rotors.links import GearPair, TorsionSpring
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.mode import Mode, indicate
from gauss.rotors.motion import RotorMotion
from gauss.rotors.network import Network
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import ReducedNetwork, active

RIGID_FREQUENCY = 1e-6  # relative to the highest: below it is a rigid motion, the root of the rounding of its square
NO_SLIP = 1e-9  # slip, relative to the speed: below it a link sticks
LINEAR_SLIP = 1e-6  # slip within which a curve is straight
OSCILLATING_PART = 1e-6  # imaginary part, relative to the largest eigenvalue


@dataclass(frozen=True)
class Modes:
    """Undamped torsional modes, lowest first; rigid motions have frequency 0.

    Parameters
    ----------
    names : tuple of str
        Shafts.
    frequencies : ndarray, shape (m,)
        [Hz].
    shapes : ndarray, shape (n, m)
        Amplitudes of the shafts, the largest of each mode 1.
    state : str
        State that they are linearised in.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> spring = fan.spring("coupling", wheel, motor, stiffness=200.0)
    >>> modes = rotors.eigenmodes(fan)
    >>> modes.names, modes.frequencies.round(3), modes.state
    (('motor', 'wheel'), array([0.   , 7.797]), 'friction drives and clutches open')
    """

    names: tuple
    frequencies: np.ndarray
    shapes: np.ndarray
    state: str = "friction drives and clutches open"


def eigenmodes(network: Network, at: RotorMotion | None = None) -> Modes:
    """Torsional eigenfrequencies and modes: K φ = (2 π f)² M φ in the coordinates of the groups.

    Gears are ideal, backlash is closed. Friction drives and clutches transmit nothing, except those that stick at the end of
    a given motion: they bind their shafts, as do shafts stuck at rest.

    Parameters
    ----------
    network : Network
        The network.
    at : RotorMotion, optional
        Motion of the network, at the end of which the modes are found.

    Returns
    -------
    Modes
        Frequencies [Hz] and amplitudes of the shafts.
    """
    reduced = reduce(network)
    M = np.diag(np.bincount(reduced.group, reduced.inertia * reduced.K**2, reduced.n_groups))
    stiff, state = stiffness(reduced), Modes.state
    if at is None:
        squares, shapes = eigh(stiff, M)
    else:
        rows, state = _bound(at)
        free = null_space(rows) if len(rows) else np.eye(len(M))
        squares, shapes = eigh(free.T @ stiff @ free, free.T @ M @ free)
        shapes = free @ shapes
    shapes = reduced.K[:, None] * shapes[reduced.group]
    frequencies = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
    frequencies[frequencies <= RIGID_FREQUENCY * frequencies.max(initial=0.0)] = 0.0
    peaks = shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    return Modes(reduced.names, frequencies, shapes / peaks, state)


def _bound(at: RotorMotion) -> tuple[np.ndarray, str]:
    """Rows (m, n_g) of the speeds of the groups that vanish at the end of a motion, and the state in words."""
    reduced, rows = at.reduced, []
    stuck, sticking, open_links = at.stuck[-1], [], []
    for g in dict.fromkeys(reduced.group[stuck]):
        rows.append(np.eye(reduced.n_groups)[g])
    for b, link in enumerate(reduced.links):
        if isinstance(link, GearPair | TorsionSpring):
            continue
        p, d = reduced.driver[b], reduced.driven[b]
        ahead, behind = at.speeds[-1, p], reduced.ratio[b] * at.speeds[-1, d]
        if abs(ahead - behind) <= NO_SLIP * max(abs(ahead), abs(behind), reduced.v_0) and at.torques[-1, b] != 0.0:
            row = np.zeros(reduced.n_groups)
            row[reduced.group[p]] += reduced.K[p]
            row[reduced.group[d]] -= reduced.ratio[b] * reduced.K[d]
            rows.append(row)
            sticking.append(link.name)
        else:
            open_links.append(link.name)
    shafts = [name for name, held in zip(reduced.names, stuck, strict=True) if held]
    parts = {"sticking": sticking, "slipping or open": open_links, "stuck at rest": shafts}
    said = [f"{what}: {', '.join(names)}" for what, names in parts.items() if names]
    return np.array(rows), "; ".join([f"at t = {at.t[-1]:g} s", *said])


def stiffness(reduced: ReducedNetwork) -> np.ndarray:
    """Stiffness (n_g, n_g) of the springs in the coordinates of the groups [N m/rad]."""
    K = np.zeros((reduced.n_groups, reduced.n_groups))
    for b, link in enumerate(reduced.links):
        if isinstance(link, TorsionSpring):
            twist = np.zeros(reduced.n_groups)
            p, d = reduced.driver[b], reduced.driven[b]
            twist[reduced.group[p]] += reduced.K[p] / link.ratio
            twist[reduced.group[d]] -= reduced.K[d]
            K += link.stiffness * np.outer(twist, twist)
    return K


@dataclass(frozen=True)
class Campbell:
    """Campbell diagram: damped frequencies over the speed of one shaft, and their crossings with orders of excitation.

    Parameters
    ----------
    shaft : str
        Shaft whose speed is varied.
    speeds : ndarray, shape (k,)
        [rad/s].
    frequencies, damping : ndarray, shape (k, m)
        Of the modes that oscillate, lowest first [Hz], and their damping ratios; nan where a mode is overdamped.
    crossings : tuple of (order, speed, frequency)
        Resonances: order · speed = 2 π · frequency [1, rad/s, Hz].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> spring = fan.spring("coupling", wheel, motor, stiffness=200.0)
    >>> diagram = rotors.campbell(fan, "motor", [10.0, 80.0], orders=(1,))
    >>> diagram.frequencies.shape
    (2, 1)
    >>> [tuple(round(float(x), 3) for x in crossing) for crossing in diagram.crossings]
    [(1.0, 48.99, 7.797)]
    """

    shaft: str
    speeds: np.ndarray
    frequencies: np.ndarray
    damping: np.ndarray
    crossings: tuple


def campbell(network: Network, shaft, speeds, orders=(1, 2, 3)) -> Campbell:
    """Campbell table: motors, loads, dampers and friction drives linearised at each speed, near zero slip.

    Parameters
    ----------
    network : Network
        The network.
    shaft : str or Shaft
        Shaft whose speed is varied.
    speeds : array_like, shape (k,)
        Its speeds, not 0 [rad/s].
    orders : sequence of float
        Excitations per turn of the shaft.

    Returns
    -------
    Campbell
        Eigenfrequencies over the speeds, and where orders meet them.

    Raises
    ------
    SceneError
        If a speed is 0 or not finite.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> spring = fan.spring("coupling", wheel, motor, stiffness=200.0)
    >>> diagram = rotors.campbell(fan, "motor", [10.0, 80.0], orders=(1, 2))
    >>> [tuple(round(float(x), 3) for x in crossing) for crossing in diagram.crossings]
    [(1.0, 48.99, 7.797), (2.0, 24.495, 7.797)]
    """
    orders = np.ravel(real_array(orders, "orders", "numbers"))
    name, speeds = network.require_shaft(shaft), real_array(speeds, "speeds", "speeds [rad/s]")
    if speeds.ndim != 1 or not np.isfinite(speeds).all() or not speeds.all():
        raise SceneError(f"speeds: expected a list of finite speeds [rad/s] other than 0, got {speeds!r}.")
    reduced = reduce(network)
    equations = NetworkEquations(reduced)
    unit = _following(reduced, reduced.names.index(name))
    rows = [_oscillations(equations, speed * unit) for speed in speeds]
    width = max((len(row) for row in rows), default=0)
    table = np.full((len(rows), width), np.nan + 0j)
    for row, values in zip(table, rows, strict=True):
        row[: len(values)] = values
    frequencies = table.imag / (2 * np.pi)
    crossings = tuple(
        found for order in orders for column in frequencies.T for found in _crossings(order, np.abs(speeds), column)
    )
    return Campbell(name, speeds, frequencies, -table.real / np.abs(table), crossings)


def _following(reduced: ReducedNetwork, shaft: int) -> np.ndarray:
    """Speeds of the roots when a shaft turns with 1 rad/s and no link slips."""
    speed = {shaft: 1.0}
    waiting = [shaft]
    while waiting:
        j = waiting.pop()
        for link, d, p in zip(reduced.links, reduced.driven, reduced.driver, strict=True):
            k = link.rate if isinstance(link, GearPair) else 1.0 / link.ratio
            for here, there, factor in ((p, d, k), (d, p, 1.0 / k)):
                if here == j and there not in speed:
                    speed[int(there)] = factor * speed[j]
                    waiting.append(int(there))
    return np.array([speed.get(root, 0.0) for root in reduced.roots])


def _oscillations(equations: NetworkEquations, w: np.ndarray) -> list[complex]:
    """Eigenvalues with positive imaginary part of the linearised motion, slowest first."""
    reduced, n = equations.reduced, len(w)
    state = np.array([1.0 if link.backlash else 0.0 for link in reduced.links])
    direction = np.where(w < 0, -1.0, 1.0)
    signs = np.zeros(len(indicate(reduced, reduced.K * w[reduced.group])))
    gate, dry = active(reduced.terms, 0.0), np.zeros(len(reduced.dry))
    phase = NetworkPhase(equations, Mode(np.ones(len(reduced.links), bool), state, direction, gate, dry, signs))
    matrix = np.zeros((2 * n, 2 * n))
    matrix[:n, n:] = np.eye(n)
    # curves of friction drives are linear within a small part of the slip C only
    bend = min((_bend(link) for link in (reduced.links[b] for b in reduced.friction_drives)), default=1.0)
    sizes = np.concatenate([np.full(n, 1e-5), np.full(n, 1e-4 * bend * np.abs(w).max())])
    for k in range(2 * n):
        step = sizes[k] * (np.arange(2 * n) == k)
        ahead, back = (phase.instant(0.0, sign * step[:n], w + sign * step[n:]).acceleration for sign in (1.0, -1.0))
        matrix[n:, k] = (ahead - back) / (2 * sizes[k])
    found = np.linalg.eigvals(matrix)
    return sorted((x for x in found if x.imag > OSCILLATING_PART * max(np.abs(found).max(), 1e-300)), key=lambda x: x.imag)


def _bend(link) -> float:
    """Slip at which a curve would reach its torque of full slip if it went on straight; at most 1."""
    slope = float(link.curve(LINEAR_SLIP, 1.0)) / LINEAR_SLIP
    return min(1.0, float(link.curve(1.0, 1.0)) / slope) if slope > 0 else 1.0


def _crossings(order: float, speeds, frequencies):
    """Crossings of a line of excitation with a frequency curve, by linear interpolation between the speeds."""
    difference = order * speeds / (2 * np.pi) - frequencies
    for k in range(len(speeds) - 1):
        if difference[k] * difference[k + 1] < 0 or difference[k] == 0:
            share = 0.0 if difference[k] == 0 else difference[k] / (difference[k] - difference[k + 1])
            speed = speeds[k] + share * (speeds[k + 1] - speeds[k])
            yield float(order), float(speed), float(order * speed / (2 * np.pi))
