"""Full form: all shafts are coordinates, gears and locks are constraint rows with multipliers.

    [ Φ  −W ] [a]   [Q]
    [ A   0 ] [λ] = [0]          Φ = diag(J),  Φ a_free = Q

A holds the rows i ω̇_driven − (1 − ε) ω̇_driver = 0 (III.12); with losses the reactions are W λ, W ≠ Aᵀ: i on the driven
shaft, −1/η or −η̄ on the driver (Rotor chains, section 6). With η = 1 and ε = 0 it is Gauss's principle as it stands.
A second formulation, O(n³), that verifies the reduced form.
"""

from typing import NamedTuple

import numpy as np

from gauss.arguments import real_numbers
from gauss.errors import StateError, did_you_mean
from gauss.rotors.contract import reduce
from gauss.rotors.links import GearPair
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.mode_search import find_phase
from gauss.rotors.network import Network
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import CYCLE
from gauss.scene import values

FORMS = ("reduced", "full")
REDUNDANT_ROW = 1e-12  # singular value, relative to the largest, of redundant rows


class Snapshot(NamedTuple):
    """Accelerations and torques of one instant.

    Attributes
    ----------
    accelerations : ndarray, shape (n,)
        Of the shafts [rad/s²].
    torques : ndarray, shape (n_l,)
        Q_em of the links [N m].
    forward : ndarray of bool, shape (n_l,)
        Whether power flows from driver to driven.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> now = rotors.snapshot(drum)
    >>> now.accelerations.round(3), now.torques.round(3), now.forward
    (array([13.944, 28.457, 42.686]), array([85.78 , 61.785]), array([ True,  True]))
    """

    accelerations: np.ndarray
    torques: np.ndarray
    forward: np.ndarray


def snapshot(network: Network, t: float = 0.0, angles=None, speeds=None, form: str = "reduced") -> Snapshot:
    """Accelerations and torques of one instant.

    Parameters
    ----------
    network : Network
        What turns.
    t : float
        Time [s].
    angles, speeds : array_like, shape (n,), optional
        Of the shafts, in the order of ``network.shafts`` [rad], [rad/s]; those at the start when not given.
    form : str
        "reduced": one coordinate for each set of geared shafts, O(n); "full": all shafts with multipliers, O(n³).

    Returns
    -------
    Snapshot
        Accelerations of the shafts, torques of the links.

    Raises
    ------
    StateError
        If speeds contradict the gears, or the form does not exist.
    SceneError
        If the time is no finite number.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> rotors.snapshot(drum, speeds=[49.0, 100.0, 150.0]).torques.round(3)
    array([178.852, 121.669])
    >>> rotors.snapshot(drum, speeds=[49.0, 100.0, 150.0], form="full").torques.round(3)
    array([178.852, 121.669])
    """
    t = values.number(t, "snapshot: t", "s")
    if form not in FORMS:
        raise StateError(f"no form {form!r}. {did_you_mean(form, FORMS)}")
    reduced = reduce(network)
    roots = list(reduced.roots)
    w = reduced.speed if speeds is None else _checked(speeds, reduced, "speeds")[roots]
    if speeds is not None:
        off = np.abs(reduced.K * w[reduced.group] - speeds)
        if off.max() > CYCLE * np.abs(speeds).max():
            name = reduced.names[int(off.argmax())]
            raise StateError(f"speeds: that of {name!r} is {off.max():.3g} rad/s off the gear constraints.")
    theta = np.zeros(len(roots))
    if angles is not None:
        angles = _checked(angles, reduced, "angles")
        theta = (angles - reduced.angle)[roots]
    phase = find_phase(NetworkEquations(reduced, compiled=False), t, theta, w)
    if form == "full":
        return solve_full(phase, t, theta, w)
    found = phase.instant(t, theta, w)
    accelerations = reduced.K * found.acceleration[reduced.group]
    return Snapshot(accelerations, phase.link_torques(found), phase.mode.forward)


def _checked(given, reduced, what: str) -> np.ndarray:
    array = real_numbers(given)
    if array is None or array.shape != (len(reduced.names),) or not np.isfinite(array).all():
        raise StateError(f"{what}: expected {len(reduced.names)} finite numbers, one for each shaft, got {given!r}.")
    return array


def solve_full(phase: NetworkPhase, t: float, theta, w) -> Snapshot:
    """Accelerations and torques of a phase by the full form; multipliers of least norm where rows are redundant."""
    reduced = phase.reduced
    A, W, meaning = _rows(phase)
    found = phase.equations(t, theta, w, phase.conditions)
    a_free = found.applied / reduced.inertia
    multipliers = np.linalg.lstsq(A @ (W / reduced.inertia[:, None]), -A @ a_free, rcond=REDUNDANT_ROW)[0]
    torques = found.torque.copy()
    for b, multiplier in zip(meaning, multipliers, strict=True):
        if b is not None:
            torques[b] = multiplier * (reduced.links[b].ratio if isinstance(reduced.links[b], GearPair) else 1.0)
    return Snapshot(a_free + W @ multipliers / reduced.inertia, torques, phase.mode.forward)


def _rows(phase: NetworkPhase) -> tuple[np.ndarray, np.ndarray, list]:
    """A (r, n), W (n, r), and the link of each row, None for a shaft that sticks."""
    reduced = phase.reduced
    rows: list[np.ndarray] = []
    columns: list[np.ndarray] = []
    meaning: list[int | None] = []
    n = len(reduced.names)
    for b, link in enumerate(reduced.links):
        sticks = any(lock.kind == "link" and lock.place == b for lock in phase.locks)
        if not (sticks or isinstance(link, GearPair)):
            continue
        row, column = np.zeros(n), np.zeros(n)
        d, p, scale = reduced.driven[b], reduced.driver[b], link.ratio if isinstance(link, GearPair) else 1.0
        row[d], row[p] = link.ratio, -(1.0 - link.slip if isinstance(link, GearPair) else 1.0)
        column[d], column[p] = scale, -scale * phase.f[b]
        rows, columns, meaning = [*rows, row], [*columns, column], [*meaning, b]
    for lock in phase.locks:
        if lock.kind != "link":
            unit = np.eye(n)[reduced.roots[lock.place]]
            rows, columns, meaning = [*rows, unit], [*columns, unit], [*meaning, None]
    return np.array(rows).reshape(-1, n), np.array(columns).reshape(-1, n).T, meaning
