"""Linkage: elements added by builder methods, and its analyses."""

from dataclasses import dataclass, field, replace

import numpy as np

from gauss.errors import LinkageError, SceneError, did_you_mean
from gauss.linkages import balancing, cycles, dynamics, energy, quality
from gauss.linkages import scene as scenes
from gauss.linkages.chain import Chain, end_of_turn, full_turn
from gauss.linkages.crank_ranges import closing_ranges, sweep
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.decompose import decompose
from gauss.linkages.elements import CrankMotor, Driver, LinkJoint, Load, PlanarLink
from gauss.scene import GROUND, Scene, values
from gauss.scene.builder import name_of


@dataclass(frozen=True)
class Linkage:
    """Planar linkage of a crank and Assur groups.

    Parameters
    ----------
    name : str
        Name of the linkage.
    gravity : array_like, shape (2,)
        Acceleration of gravity in the plane [m/s²].

    Attributes
    ----------
    links, joints, modes, poses : dict
        Elements by name; the methods fill them.
    drives, motors, loads : list
        Drives, motors and loads; the methods fill them.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.Linkage("four-bar", gravity=(0, -9.8))
    >>> crank = bar.link("crank", mass=1.2, inertia=0.016, com=(0.2, 0))
    >>> coupler = bar.link("coupler", mass=3.0, inertia=0.25, com=(0.5, 0))
    >>> rocker = bar.link("rocker", mass=2.2, inertia=0.09, com=(0.35, 0))
    >>> A = bar.revolute("A", "ground", crank)
    >>> B = bar.revolute("B", crank, coupler, at=(0.4, 0))
    >>> C = bar.revolute("C", rocker, coupler, at=(0.7, 0), child_at=(1.0, 0))
    >>> D = bar.revolute("D", "ground", rocker, at=(1.2, 0))
    >>> drive = bar.drive("A", speed=10.0)
    >>> load = bar.load("rocker", moment=-100.0)
    >>> print(round(bar.cycle([0.0]).torque[0], 10))
    -85.3539501473
    """

    name: str = "linkage"
    gravity: tuple = (0.0, -9.81)
    links: dict[str, PlanarLink] = field(default_factory=dict)
    joints: dict[str, LinkJoint] = field(default_factory=dict)
    drives: list[Driver] = field(default_factory=list)
    motors: list[CrankMotor] = field(default_factory=list)
    loads: list[Load] = field(default_factory=list)
    modes: dict[str, int] = field(default_factory=dict)
    poses: dict[str, tuple] = field(default_factory=dict)

    def __post_init__(self):
        """Check the name and gravity."""
        values.text(self.name, "name of the linkage")
        object.__setattr__(self, "gravity", values.vector(self.gravity, "gravity", "m/s²", 2))

    def link(self, name: str, mass: float = 0.0, inertia: float = 0.0, com=(0.0, 0.0)) -> PlanarLink:
        """Add a link; see :class:`gauss.linkages.PlanarLink`."""
        return self.add(PlanarLink(name, mass, inertia, com))

    def revolute(self, name: str, parent, child, at=(0.0, 0.0), child_at=(0.0, 0.0)) -> LinkJoint:
        """Add a pin, at ``at`` in the frame of the parent and ``child_at`` in that of the child [m]."""
        return self.add(LinkJoint(name, "revolute", name_of(parent), name_of(child), at, child_at))

    def prismatic(
        self, name: str, parent, child, at=(0.0, 0.0), angle=0.0, child_at=(0.0, 0.0), child_angle=0.0
    ) -> LinkJoint:
        """Add a slide: the parent carries the guide, the point ``child_at`` of the child runs on it.

        See :class:`gauss.linkages.LinkJoint` for the arguments.
        """
        return self.add(LinkJoint(name, "prismatic", name_of(parent), name_of(child), at, child_at, angle, child_angle))

    def drive(self, joint, speed: float = 1.0, acceleration: float = 0.0, start: float = 0.0) -> Driver:
        """Drive the crank, in place of a former drive; see :class:`gauss.linkages.Driver`."""
        return self.add(Driver(name_of(joint), speed, acceleration, start))

    def set_speed(self, speed: float) -> Driver:
        """Let the crank turn at another speed [rad/s], without acceleration."""
        return self.add(replace(self._driver(), speed=speed, acceleration=0.0))

    def motor(self, speed, torque, inertia: float = 0.0) -> CrankMotor:
        """Add the motor that turns the crank in :meth:`run`; see :class:`gauss.linkages.CrankMotor`."""
        return self.add(CrankMotor(speed, torque, inertia))

    def load(self, link, force=(0.0, 0.0), moment: float = 0.0, **options) -> Load:
        """Load a link; see :class:`gauss.linkages.Load`."""
        return self.add(Load(name_of(link), force, moment, **options))

    def mode(self, joint, mode: int):
        """Choose the assembly, +1 or −1, of the dyad with this inner joint; see :class:`gauss.linkages.Dyad`."""
        name = name_of(joint)
        if not isinstance(name, str):
            raise SceneError(f"mode: expected the name of a joint, got {joint!r:.80}.")
        self.modes[name] = mode

    def pose(self, link, pose):
        """Give the pose x, y [m], angle [rad] of the ternary link of a class III group near the start of the cycle."""
        self.poses[name_of(link)] = values.vector(pose, f"pose of link {name_of(link)!r}", "m, m, rad", 3)

    def add(self, element):
        """Add a PlanarLink, LinkJoint, Driver, CrankMotor or Load and return it.

        Raises
        ------
        SceneError
            If its name is taken, or a name that it refers to does not exist.
        """
        if isinstance(element, PlanarLink):
            self._require_new(element.name, "link", {**self.links, GROUND: None})
            self.links[element.name] = element
        elif isinstance(element, LinkJoint):
            self._require_new(element.name, "joint", self.joints)
            for end in (element.parent, element.child):
                self._require_link(end, f"joint {element.name!r}", [*self.links, GROUND])
            self.joints[element.name] = element
        elif isinstance(element, Driver):
            self.drives[:] = [element]
        elif isinstance(element, CrankMotor):
            self.motors[:] = [element]
        elif isinstance(element, Load):
            self._require_link(element.link, "load", self.links)
            self.loads.append(element)
        else:
            raise SceneError(f"expected a PlanarLink, LinkJoint, Driver, CrankMotor or Load, got {element!r}.")
        return element

    @staticmethod
    def _require_new(name: str, kind: str, taken):
        if name in taken:
            raise SceneError(f"{kind} {name!r}: the name is taken; choose another.")

    @staticmethod
    def _require_link(name: str, what: str, existing):
        if not isinstance(name, str) or name not in existing:
            raise SceneError(f"{what}: no link {name!r}. {did_you_mean(str(name), existing)}")

    # Analyses of the chain of groups.

    @property
    def chain(self) -> Chain:
        """Crank and groups in order; ``print(linkage.chain)`` shows them.

        Raises
        ------
        LinkageError
            If the linkage does not decompose; the message gives the reason.
        """
        gravity = complex(*self.gravity)
        loads = tuple(self.loads)
        return decompose(self.name, gravity, self.links, self.joints, self._driver(), loads, self.modes, self.poses)

    def _driver(self) -> Driver:
        if not self.drives:
            raise LinkageError(
                f"{self.name} has no drive: say which pin the motor turns, e.g. linkage.drive('A', speed=10.0)."
            )
        return self.drives[0]

    def cycle(self, angles=None, speed: float | None = None, acceleration: float | None = None) -> Cycle:
        """Motion, reactions and torque at crank angles (k,) [rad]; a turn in steps of 1° when not given.

        See :func:`gauss.linkages.cycles.cycle`.
        """
        chain = self.chain
        return cycles.cycle(chain, full_turn(chain, 360) if angles is None else angles, speed, acceleration)

    def sweep(self, steps: int = 360) -> np.ndarray:
        """Crank angles of a turn, both ends included, or of a range; see :func:`gauss.linkages.crank_ranges.sweep`."""
        return sweep(self.chain, steps)

    def closing_ranges(self) -> list[tuple[float, float]]:
        """Ranges of crank angles at which it closes [rad]; see :func:`gauss.linkages.crank_ranges.closing_ranges`."""
        return closing_ranges(self.chain)

    def work(self, angles=None) -> np.ndarray:
        """Work (k,) of the driving torque from the first crank angle to each [J]; see :func:`gauss.linkages.energy.work`."""
        chain = self.chain
        return energy.work(chain, np.append(full_turn(chain, 360), end_of_turn(chain)) if angles is None else angles)

    def flywheel(self, fluctuation: float) -> energy.Flywheel:
        """Flywheel for a speed fluctuation δ; see :func:`gauss.linkages.energy.flywheel`."""
        return energy.flywheel(self.chain, fluctuation)

    def grashof(self) -> quality.Grashof | None:
        """Grashof class of a four-bar or slider-crank; see :func:`gauss.linkages.quality.grashof`."""
        return quality.grashof(self.chain)

    def dead_centres(self, output: str) -> np.ndarray:
        """Crank angles at which a link or slide stands still [rad]; see :func:`gauss.linkages.quality.dead_centres`."""
        return quality.dead_centres(self.chain, output)

    def least_transmission(self) -> dict[str, tuple[float, float]]:
        """Least transmission angle of each dyad and where [rad]; see :func:`gauss.linkages.quality.least_transmission`."""
        return quality.least_transmission(self.chain)

    def reduced_inertia(self, angles) -> np.ndarray:
        """Reduced inertia (k,) on the crank [kg m²]; see :func:`gauss.linkages.dynamics.reduced_inertia`."""
        return dynamics.reduced_inertia(self.chain, angles)

    def run(self, duration: float, motor=None, **options) -> dynamics.CrankRun:
        """Run under a motor, its own when none is given; see :func:`gauss.linkages.dynamics.run`."""
        if motor is None and not self.motors:
            raise LinkageError(f"{self.name} has no motor: say e.g. linkage.motor(speed=[0, 20], torque=[120, 0]).")
        motor = self.motors[0] if motor is None else motor
        return dynamics.run(self.chain, motor, duration, **{"added_inertia": getattr(motor, "inertia", 0.0)} | options)

    def counterweights(self, *links: str) -> balancing.Counterweights:
        """Counterweights on links pivoted on the ground; see :func:`gauss.linkages.balancing.counterweights`."""
        return balancing.counterweights(self.chain, links)

    def counter_rotors(self, *links: str) -> balancing.CounterRotors:
        """Counter-rotating discs; see :func:`gauss.linkages.balancing.counter_rotors`."""
        return balancing.counter_rotors(self.chain, links)

    def with_counterweight(self, link: str, moment, radius: float) -> "Linkage":
        """Linkage with a point mass added to a link, given by its mass × place relative to the ground pivot (2,) [kg m].

        Parameters
        ----------
        link : str
            Link pivoted on the ground.
        moment : array_like, shape (2,)
            Mass × place in link axes, e.g. from :meth:`counterweights`.
        radius : float
            How far from the pivot the mass is [m].
        """
        added = balancing.weighted(self.chain, link, moment, radius)
        return replace(self, links=self.links | {link: added})

    def to_scene(self, angle: float | None = None, torque=None) -> Scene:
        """Return the same linkage as a Gauss scene; see :func:`gauss.linkages.scene.to_scene`."""
        return scenes.to_scene(self.chain, angle, torque)
