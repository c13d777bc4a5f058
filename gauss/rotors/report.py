"""Reports as text and tables: motions, operating points, modes."""

import numpy as np

from gauss.rotors.motion import RotorMotion
from gauss.rotors.operating_point import OperatingPoint
from gauss.rotors.vibration import Modes

LISTED = 40  # lines of a list; longer ones are cut


def report(motion: RotorMotion) -> str:
    """Speeds, torques, losses, energies and events of a run.

    Parameters
    ----------
    motion : RotorMotion
        The motion.

    Returns
    -------
    str
        Lines to be printed.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> run = rotors.simulate(drum, 0.5, times=[0.0, 0.5])
    >>> print(rotors.report(run).splitlines()[0])
    RotorMotion('gear runup', 2 samples, 0 … 0.5 s, 0 events)
    """
    reduced, stats, energy = motion.reduced, motion.stats, motion.energy()
    how = "; ".join([stats.plan.dynamics, *map(str, stats.plan.rejected)])
    lines = [
        repr(motion),
        f"  {stats.steps} steps, {stats.evaluations} evaluations ({how}), {stats.wall_time:.3g} s",
        "",
        f"  {'shaft':20} {'speed at the end':>18} {'fastest':>14}",
    ]
    for j, name in enumerate(reduced.names[:LISTED]):
        fastest = motion.speeds[np.abs(motion.speeds[:, j]).argmax(), j]
        stuck = "  stuck at rest" if motion.stuck[-1, j] else ""
        lines.append(f"  {name:20} {motion.speeds[-1, j]:12.6g} rad/s {fastest:8.5g} rad/s{stuck}")
    lines += _more(reduced.names)
    lines += [
        "",
        f"  {'link':20} {'torque at the end':>18} {'largest':>13} {'slip [1]':>9} {'heat of slip':>14} {'of mesh':>13}",
    ]
    for b, link in enumerate(reduced.links[:LISTED]):
        largest, slip = np.abs(motion.torques[:, b]).max(), round(motion.slip(link)[-1], 4) + 0.0
        lines.append(
            f"  {link.name:20} {motion.torques[-1, b]:14.6g} N m {largest:9.5g} N m {slip:9.4f} "
            f"{motion.slip_heat[-1, b]:12.6g} J {motion.mesh_heat[-1, b]:11.5g} J"
        )
    lines += _more(reduced.links)
    parts = ("input", "useful", "bearings", "slip", "mesh", "kinetic", "elastic")
    lines += ["", "  energy [J]: " + ", ".join(f"{key} {getattr(energy, key)[-1] + 0.0:.6g}" for key in parts)]
    residual = np.abs(energy.balance).max()
    lines.append(f"  balance within {residual:.2e} J, {residual / (energy.scale or 1.0):.1e} of the largest of them")
    if motion.events:
        lines += ["", *(f"  {event}" for event in motion.events[:LISTED]), *_more(motion.events)]
    return "\n".join(lines)


def table(motion: RotorMotion) -> dict[str, np.ndarray]:
    """Columns (k,) of the samples: time; angle, speed, acceleration of each shaft; torque, slip, heat of each link.

    Parameters
    ----------
    motion : RotorMotion
        The motion.

    Returns
    -------
    dict
        Columns (k,) by name and unit.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> run = rotors.simulate(drum, 0.5, times=[0.0, 0.5])
    >>> columns = rotors.table(run)
    >>> list(columns)[:3]
    ['time [s]', 'drum: angle [rad]', 'drum: speed [rad/s]']
    """
    columns = {"time [s]": motion.t}
    for name in motion.reduced.names:
        columns |= {f"{name}: angle [rad]": motion.angle(name), f"{name}: speed [rad/s]": motion.speed(name)}
        columns[f"{name}: acceleration [rad/s²]"] = motion.acceleration(name)
    for link in motion.reduced.links:
        columns |= {f"{link.name}: torque [N m]": motion.torque(link), f"{link.name}: slip [1]": motion.slip(link)}
        columns[f"{link.name}: heat [J]"] = motion.loss(link)
    return columns


def steady_table(points: list[OperatingPoint], t: float = 0.0) -> str:
    """Steady operating points with the torques of a time [s], slowest first.

    Parameters
    ----------
    points : list of OperatingPoint
        Results of :func:`operating_points`.
    t : float
        Time [s].

    Returns
    -------
    str
        Lines to be printed.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> print(rotors.steady_table(rotors.operating_points(drum)))
    <BLANKLINE>
    steady operating points with the torques at 0 s: 1
      1. stable: speeds [rad/s] drum 50.3869, layshaft 102.83, motor 154.246
         input 6406.86 W, useful 5878.04 W, losses [W] belt 336.61, gear 192.21
    """
    if not points:
        return f"\nno steady operating point with the torques at {t:g} s: at every speed in its range something accelerates"
    lines = ["", f"steady operating points with the torques at {t:g} s: {len(points)}"]
    for number, point in enumerate(points, start=1):
        speeds = ", ".join(f"{n} {w:.6g}" for n, w in zip(point.reduced.names[:LISTED], point.speeds, strict=False))
        stuck = [name for name, sticks in zip(point.reduced.names, point.stuck, strict=True) if sticks]
        lines.append(f"  {number}. {'stable' if point.stable else 'UNSTABLE'}: speeds [rad/s] {speeds}")
        if stuck:
            lines.append(f"     stuck at rest: {', '.join(stuck[:LISTED])}")
        lost = point.slip_loss + point.mesh_loss
        losses = ", ".join(f"{link.name} {x:.5g}" for link, x in zip(point.reduced.links[:LISTED], lost, strict=False))
        lines.append(f"     input {point.input:.6g} W, useful {point.useful:.6g} W, losses [W] {losses or 'none'}")
    return "\n".join(lines)


def mode_table(modes: Modes) -> str:
    """Torsional modes, lowest first, with the amplitudes of the shafts.

    Parameters
    ----------
    modes : Modes
        Result of :func:`eigenmodes`.

    Returns
    -------
    str
        Lines to be printed.
    """
    shown = modes.names[:LISTED]
    lines = ["", f"torsional modes, {modes.state}", f"  {'f [Hz]':>10}  amplitudes, the largest 1"]
    for frequency, shape in zip(modes.frequencies[:LISTED], modes.shapes.T, strict=False):
        amplitudes = "  ".join(f"{name} {value:+.3f}" for name, value in zip(shown, shape, strict=False))
        lines.append(f"  {frequency:10.5g}  {amplitudes}")
    return "\n".join(lines + _more(modes.frequencies))


def _more(things) -> list[str]:
    return [f"  … and {len(things) - LISTED} more"] if len(things) > LISTED else []
