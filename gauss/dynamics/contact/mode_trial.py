"""Trial of a contact mode: the compulsion with sticking elements as rows, slipping ones as loads, closed gaps as G x ≤ h.

A sticking element has a multiplier within its bounds (see :class:`gauss.scene.SetValued`), a slipping one the force at a
bound against its rate. Directions of power flow through links with losses follow from the forces of the trial.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.backend import Backend
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.contact.impact import certified, resting
from gauss.dynamics.engines.cut_rows import CutRows, cut_rows, piecewise_affine_root, with_losses
from gauss.dynamics.gap_functions import Gaps, closed, gaps, with_gaps
from gauss.dynamics.gear_trains import gear_trains
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.scene import JointFriction
from gauss.scene.values import as_function, evaluated
from gauss.system import FREE, ContactMode, State, System, build, phase_scene

MOST_FLOW_CHANGES = 60  # changes of directions of power flow, in one trial
BOUND_TOLERANCE = 1e-9  # violation of a bound relative to the distance of both bounds
UNBOUNDED_WIDTH = 1e-3  # distance of the bounds where one is infinite, in forces of the scene
NO_POWER_FLOW = 1e-12  # of the largest force: smaller forces have no direction of power flow


class ModeTrial(NamedTuple):
    """Solution of one mode."""

    mode: ContactMode
    system: System
    solution: Solution
    forces: dict[str, float]
    load: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Accelerations (a, q̈)."""
        return np.concatenate([self.solution.a, self.solution.qdd])


class ModeProblem(NamedTuple):
    """State and closed gaps of one selection."""

    state: State
    whole: Kinematics
    gaps: Gaps
    touching: np.ndarray
    backend: str | Backend | type
    load: np.ndarray


class ModeTrials:
    """Trials of modes of one system.

    Parameters
    ----------
    system : System
        With unilateral constraints, set-valued elements, or links with losses.
    """

    def __init__(self, system: System):
        scene = system.scene
        self.system, self.names, self.set_valued = system, tuple(scene.set_valued), tuple(scene.set_valued.values())
        self.one_way = np.array([element.one_way for element in self.set_valued], dtype=bool)
        self.sticks = np.array([element.sticks for element in self.set_valued], dtype=bool)
        self.slopes = np.array([_slope(system, element) for element in self.set_valued]).reshape(
            len(self.set_valued), system.n_v
        )
        self.losses, self.trains, self.backlashes = scene.losses, gear_trains(scene), scene.backlashes
        units, energy = system.scale.coordinates, system.scale.energy
        self.sizes, self.roots = (
            set_valued_scales(system),
            np.array([units[system.column(train.root)] for train in self.trains]),
        )
        driven = {name: energy / units[system.column(link.driven)] for name, link in self.losses.items()}
        self.force_units = driven | dict(zip(self.names, (energy / self.sizes).tolist(), strict=True))
        self.train_friction = {  # joint friction in gear trains: root, and direction of the joint relative to it
            element.name: (train.root, np.sign(train.rates[element.joint]))
            for element in self.set_valued
            for train in self.trains
            if isinstance(element, JointFriction) and element.joint in train.rates
        }
        self.cases: dict[ContactMode, tuple[System, CutRows]] = {}

    def case(self, mode: ContactMode) -> tuple[System, CutRows]:
        """System of a mode without unilateral constraints, and its links with losses."""
        if mode not in self.cases:
            smooth = not (self.names or self.losses or self.backlashes)
            system = self.system if smooth else build(phase_scene(self.system.scene, (), mode), self.system.mechanics.anew())
            self.cases[mode] = system, cut_rows(system, self.system, (), mode)
        return self.cases[mode]

    def rates(self, state: State) -> np.ndarray:
        """Slip rates (g,) of the set-valued elements."""
        return self.slopes @ state.v - np.array([float(element.rate(state.t)) for element in self.set_valued])

    def turning(self, state: State) -> np.ndarray:
        """Rates of the roots of the gear trains."""
        return np.array([state.v[self.system.column(train.root)] for train in self.trains])

    def engaging(self, state: State) -> np.ndarray:
        """Freewheels whose driven joint is slower than the driver, which needs an impact."""
        return np.flatnonzero(self.one_way & (self.rates(state) < -resting(self.system, state.v) * self.sizes))

    def backlash_sides(self, state: State) -> dict[str, int]:
        """Side of the backlash in contact, −1, 0 or 1, of each elastic link."""
        motion, found = Kinematics(self.system, state), {}
        for name, play in self.backlashes.items():
            touch = {side: float(play.touch(*play.ends(motion), side)) for side in (-1, 1)}
            best = max(touch, key=touch.__getitem__)
            found[name] = best if touch[best] > 0.0 else 0
        return found

    def touching(self, state: State) -> np.ndarray:
        """Closed gaps of a state: those that touch and do not open."""
        return closed(self.system, gaps(kinematics(self.system, state)), state.v)

    def consistent(self, at: ModeProblem, mode: ContactMode) -> ModeTrial:
        """Trial with consistent directions of power flow."""
        for _ in range(MOST_FLOW_CHANGES):
            found = self._trial(at, mode)
            power_flow = self.power_flow(mode, found.forces)
            if power_flow == mode.power_flow:
                return found
            mode = mode.but(power_flow=power_flow)
        names = ", ".join(repr(name) for name in power_flow if power_flow[name] != found.mode.power_flow[name])
        raise SimulationError(
            f"t = {at.state.t:.6g} s: no direction of power flow through {names} fits its forces: what lossy links "
            "and set-valued elements do at once may be open; soften one of them by an elastic link."
        )

    def power_flow(self, mode: ContactMode, forces: dict[str, float]) -> dict[str, int]:
        """Directions of power flow through links with losses, for given forces; those without force as before."""
        largest, found = self.largest(forces), {}
        for name, link in self.losses.items():
            flow = forces[name] * self.direction(mode, link.driver) / link.ratio
            before = mode.power_flow[name]
            unclear = before and abs(forces[name]) <= NO_POWER_FLOW * largest * self.force_units[name]
            found[name] = 0 if not self.direction(mode, link.driver) else before if unclear else 1 if flow >= 0.0 else -1
        return found

    def largest(self, forces: dict[str, float]) -> float:
        """Largest force, in forces of the scene."""
        return max((abs(force) / self.force_units[name] for name, force in forces.items()), default=0.0)

    def beyond(self, signs, force: np.ndarray, t: float) -> np.ndarray:
        """Mask (g,) of the sticking elements with a force out of bounds."""
        low, high = np.array([element.bounds(t) for element in self.set_valued]).reshape(-1, 2).T
        force_units = np.array([self.force_units[name] for name in self.names])
        slack = BOUND_TOLERANCE * np.where(np.isfinite(high - low), high - low, UNBOUNDED_WIDTH * force_units)
        return (np.asarray(signs) == 0) & ((force < low - slack) | (force > high + slack))

    def direction(self, mode: ContactMode, joint: str) -> float:
        """Direction of motion of a joint in its gear train; 0 at rest."""
        train = next(train for train in self.trains if joint in train.rates)
        way = mode.trains[train.root]
        return 0.0 if way == FREE else float(way * np.sign(train.rates[joint]))

    def _trial(self, at: ModeProblem, mode: ContactMode) -> ModeTrial:
        system, links = self.case(mode)
        motion, extra, what = kinematics(system, at.state), links.W - links.R, f"what holds at t = {at.state.t:.6g} s"
        applied = Applied(motion)
        found: Solution
        if links.names and not at.touching.size:
            problem = assemble_motion(motion, applied, at.load)
            Q, found = with_losses(problem, links, lambda problem: certified(problem, at.backend, what))
            return ModeTrial(mode, system, found, forces_of(self.system, system, mode, at.state, found), Q @ extra)

        def residual(Q):
            nonlocal found
            problem = with_gaps(assemble_motion(motion, applied, at.load + Q @ extra), at.gaps, at.touching)
            found = certified(problem, at.backend, what)
            return -found.multipliers[links.rows] - Q

        Q = piecewise_affine_root(residual, np.zeros(len(links.names)), links.units)
        return ModeTrial(mode, system, found, forces_of(self.system, system, mode, at.state, found), Q @ extra)

    def scale_of(self, at: ModeProblem, found: ModeTrial) -> float:
        """Largest acceleration, in coordinates of the scene [1/s²]."""
        solution, biases = found.solution, at.gaps.D[at.touching] / gap_scales(self.system)[at.touching]
        largest = solution.compulsion.acceleration_scale(solution.a, solution.qdd)
        return max(largest, np.abs(biases).max(initial=0.0))


def forces_of(whole: System, system: System, mode: ContactMode, state: State, solution: Solution | None) -> dict[str, float]:
    """Forces of all set-valued elements and links with losses: multipliers if they stick, laws if they slip."""
    multipliers = np.zeros(0) if solution is None else solution.multipliers
    rows = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    motion, found = Kinematics(whole, state), {}
    for name, link in (whole.scene.losses | whole.scene.set_valued).items():
        sign = mode.set_valued.get(name, 0)
        if sign:
            effort = as_function(whole.scene.set_valued[name].effort(sign))
            found[name] = float(evaluated(effort, (state.t, motion), link.what, 1)[0])
        else:
            found[name] = float(-multipliers[rows[name]])
    return found


def _slope(system: System, element) -> np.ndarray:
    """Gradient (n_v,) of the slip rate of a set-valued element."""
    row = np.zeros(system.n_v)
    for joint, factor in element.acts_on.items():
        row[system.column(joint)] += factor
    return row
