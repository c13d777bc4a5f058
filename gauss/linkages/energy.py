"""Energy, power and work of a linkage; flywheel for a given fluctuation of speed."""

from numbers import Real
from typing import NamedTuple

import numpy as np

from gauss.arguments import LARGEST_FLOAT
from gauss.errors import LinkageError
from gauss.linkages.chain import Chain, end_of_turn
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.cycles import crank_numbers, cycle
from gauss.linkages.loads import centre, given, load_power, power
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.plane import dot
from gauss.linkages.quadrature import cumulative, zeros


class Balance(NamedTuple):
    """Power balance of a cycle, each (k,) [W]: motor + loads = change + residual.

    Attributes
    ----------
    motor : ndarray
        M1 ω1.
    loads : ndarray
        Power of all loads.
    change : ndarray
        d(T + V)/dt of kinetic energy and potential energy of gravity.
    residual : ndarray
        Residual of the balance; rounding.
    """

    motor: np.ndarray
    loads: np.ndarray
    change: np.ndarray
    residual: np.ndarray


def kinetic(motion: LinkageKinematics) -> np.ndarray:
    """Kinetic energy T (k,) [J].

    Parameters
    ----------
    motion : LinkageKinematics
        Motion of the links.

    Returns
    -------
    ndarray, shape (k,)
        Energy [J].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import kinetic
    >>> kinetic(cycle.motion).round(3)
    array([22.631, 11.068, 20.404])
    """
    total = 0.0 * motion.crank_angle
    for link in motion.chain.links:
        v = motion.links[link.name].velocity(centre(motion, link))
        total = total + 0.5 * (link.mass * dot(v, v) + link.inertia * motion.links[link.name].omega ** 2)
    return total


def potential(motion: LinkageKinematics) -> np.ndarray:
    """Potential energy of gravity V (k,) [J], zero at the origin.

    Parameters
    ----------
    motion : LinkageKinematics
        Motion of the links.

    Returns
    -------
    ndarray, shape (k,)
        Energy [J].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import potential
    >>> potential(cycle.motion).round(3)
    array([17.715, 21.78 , 24.715])
    """
    weights = (link.mass * dot(motion.chain.gravity, centre(motion, link)) for link in motion.chain.links)
    return 0.0 * motion.crank_angle - sum(weights)


def power_balance(found: Cycle) -> Balance:
    """Power of motor and loads against the change of energy.

    Parameters
    ----------
    found : Cycle
        The cycle.

    Returns
    -------
    Balance
        Powers (k,) [W].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import power_balance
    >>> bool(abs(power_balance(cycle).residual).max() < 1e-9)
    True
    """
    motion = found.motion
    change = 0.0 * motion.crank_angle
    for link in found.chain.links:
        moving, G = motion.links[link.name], centre(motion, link)
        change = change + link.mass * dot(moving.acceleration(G) - found.chain.gravity, moving.velocity(G))
        change = change + link.inertia * moving.alpha * moving.omega
    motor, loads = found.torque * motion.crank_speed, load_power(motion)
    return Balance(motor, loads, change, motor + loads - change)


def work(chain: Chain, angles) -> np.ndarray:
    """Work (k,) of the driving torque from the first of the crank angles to each of them, ∫ M1 dθ [J].

    Speed and acceleration of the crank are those of the linkage at every angle. Jumps of resisting loads are located first;
    a law of the user's own should be smooth.

    Parameters
    ----------
    chain : Chain
        The linkage.
    angles : array_like, shape (k,)
        Crank angles [rad].

    Returns
    -------
    ndarray, shape (k,)
        Work [J].

    Raises
    ------
    LinkageError
        If the angles are no finite numbers, or as of :func:`cycle`.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> import numpy as np
    >>> from gauss.linkages import work
    >>> bool(abs(work(bar.chain, np.linspace(0, 2 * np.pi, 181))[-1]) < 1e-9)  # a turn under a conservative load
    True
    """
    angles = crank_numbers("crank angles", angles)
    return cumulative(lambda x: cycle(chain, x).torque, angles, _jumps(chain, angles.min(), angles.max()))


def _jumps(chain: Chain, start: float, end: float) -> np.ndarray:
    """Crank angles where resisting loads reverse."""
    found = [np.zeros(0)]
    for load in chain.loads:
        if load.resisting:

            def nominal_power(x, load=load):
                motion = cycle(chain, x).motion
                return power(motion, given(load, motion), load.link)

            found.append(zeros(nominal_power, start, end))
    return np.concatenate(found)


class Flywheel(NamedTuple):
    """Flywheel on the crank that keeps its speed within a given fluctuation at a constant motor torque.

    Attributes
    ----------
    cycle_work : float
        Work of the motor over a turn [J].
    mean_torque : float
        The constant torque that does the same work [N m].
    excess_energy : float
        ΔE, largest difference of the stored energy [J].
    inertia : float
        J_F [kg m²].
    slowest, fastest : float
        Crank angles of least and greatest speed [rad].
    """

    cycle_work: float
    mean_torque: float
    excess_energy: float
    inertia: float
    slowest: float
    fastest: float


def flywheel(chain: Chain, fluctuation: float) -> Flywheel:
    """Size of a flywheel: J_F = ΔE / (ω̄² δ), of first order in δ = (ω_max − ω_min) / ω̄.

    LinkageError if δ is not positive, or the crank rests.

    Parameters
    ----------
    chain : Chain
        The linkage; its crank must turn fully.
    """
    if not isinstance(fluctuation, Real) or not 0 < fluctuation <= LARGEST_FLOAT or not chain.driver.speed:
        raise LinkageError(
            f"{chain.name}: a flywheel needs a fluctuation δ > 0 and a crank that turns; "
            f"got δ = {fluctuation!r}, speed {chain.driver.speed} rad/s."
        )
    start, end = chain.driver.start, end_of_turn(chain)
    jumps = _jumps(chain, start, end)
    turn = np.array([start, end])
    total = cumulative(lambda x: cycle(chain, x).torque, turn, jumps)[-1]
    mean = total / (end - start)
    levels = zeros(lambda x: cycle(chain, x).torque - mean, start, end)
    inside = np.unique(np.concatenate([levels, jumps]))
    points = np.concatenate([[start], inside if end > start else inside[::-1], [end]])
    stored = cumulative(lambda x: mean - cycle(chain, x).torque, points, jumps)
    excess = float(np.ptp(stored))
    inertia = excess / (chain.driver.speed**2 * fluctuation)
    slowest, fastest = points[np.argmin(stored)], points[np.argmax(stored)]
    return Flywheel(float(total), float(mean), excess, inertia, float(slowest), float(fastest))
