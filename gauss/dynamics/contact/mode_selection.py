"""Selection of the contact mode: active gaps, sticking or slipping set-valued elements, directions of lossy power flow.

A sticking element has a multiplier within its bounds (see :class:`gauss.scene.SetValued`), a slipping one the force at a
bound against its rate: a linear complementarity problem. Bard-type pivoting changes the first violated element until none is
left, and ends for problems with a unique solution (Murty, Note on a Bard-type scheme, 1974). The trial of a mode is a
compulsion with sticking elements as rows, slipping ones as loads, and closed gaps as rows G x ≤ h. Directions of power flow
through links with losses follow from the forces of the trial. A gear train at rest starts to move only if it accelerates
against the losses and Coulomb friction of the motion that would follow; otherwise it sticks.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.backend import Backend
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion, checked_load
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.contact.impact import LEAVING, certified, resting
from gauss.dynamics.engines.cut_rows import CutRows, cut_rows, piecewise_affine_root, with_losses
from gauss.dynamics.gap_functions import Gaps, closed, gaps, set_valued_rows, with_gaps
from gauss.dynamics.gear_trains import gear_trains
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.store import cached
from gauss.errors import SimulationError
from gauss.scene import JointFriction
from gauss.scene.values import as_function, evaluated
from gauss.system import FREE, ContactMode, State, System, build, phase_scene

MOST_PIVOTS = 100  # changes of elements, in one selection
MOST_FLOW_CHANGES = 60  # changes of directions of power flow, in one trial
BOUND_TOLERANCE = 1e-9  # violation of a bound relative to the distance of both bounds
UNBOUNDED_WIDTH = 1e-3  # distance of the bounds where one is infinite, in forces of the scene
NO_POWER_FLOW = 1e-12  # of the largest force: smaller forces have no direction of power flow


class ActiveMode(NamedTuple):
    """Selected mode with its solution.

    Attributes
    ----------
    gaps : tuple of int
        Gaps that stay closed.
    mode : ContactMode
        Mode of all other elements.
    forces : dict of str to float
        Forces of set-valued elements along their coordinates, and of links with losses on the driven ones [N m, N].
    solution : Solution
        Certified solution.
    system : System
        The phase without its gaps.
    load : ndarray, shape (n_v,)
        Generalised forces of the losses.
    """

    gaps: tuple[int, ...]
    mode: ContactMode
    forces: dict[str, float]
    solution: Solution
    system: System
    load: np.ndarray

    @property
    def case(self) -> tuple:
        """Key of the phase."""
        return self.gaps, self.mode


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


class ModeSelector:
    """Selection of modes of one system.

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

    def overtaken(self, state: State) -> np.ndarray:
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

    def choose(
        self,
        state: State,
        touching: np.ndarray,
        backend: str | Backend | type,
        backlash_sides: dict[str, int] | None = None,
        load=None,
    ) -> ActiveMode:
        """Mode in a state with the closed gaps ``touching``.

        Parameters
        ----------
        state : State
            The state.
        touching : ndarray of int
            Closed gaps.
        backend : str or Backend
            Backend of the trials.
        backlash_sides : dict, optional
            Sides of the backlash in contact; those of the state when not given.
        load : array_like, shape (n_v,), optional
            Generalised forces added to those of the scene [N m, N].

        Raises
        ------
        SimulationError
            If a solution is not certified, or no mode is consistent.
        """
        whole = kinematics(self.system, state)
        at = ModeProblem(state, whole, gaps(whole), touching, backend, checked_load(self.system, load))
        rates, turning, small = self.rates(state), self.turning(state), resting(self.system, state.v)
        signs = (
            np.where(self.sticks, np.where(np.abs(rates) <= small * self.sizes, 0, -np.sign(rates)), 1).astype(int).tolist()
        )
        directions = np.where(np.abs(turning) <= small * self.roots, FREE, np.sign(turning)).astype(int).tolist()
        mode = self._with_train_friction(
            ContactMode(
                set_valued=dict(zip(self.names, signs, strict=True)),
                power_flow=dict.fromkeys(self.losses, 0),
                trains={train.root: way for train, way in zip(self.trains, directions, strict=True)},
                backlash_sides=self.backlash_sides(state) if backlash_sides is None else backlash_sides,
            )
        )
        resting_trains = [train.root for train in self.trains if mode.trains[train.root] == FREE]
        found = self._pivoted(at, mode)
        for _ in range(MOST_PIVOTS):
            before = found.mode
            for root in resting_trains:
                found = self._moved_from_rest(at, found, root)
            if found.mode == before:
                break
        slack = at.gaps.J[touching] @ found.x - at.gaps.D[touching]
        stays = slack <= LEAVING * self._scale(at, found) * gap_scales(self.system)[touching]
        return ActiveMode(
            tuple(touching[stays].tolist()), found.mode, found.forces, found.solution, found.system, found.load
        )

    def _moved_from_rest(self, at: ModeProblem, found: ModeTrial, root: str) -> ModeTrial:
        """Trial of a gear train at rest: moving against its losses if it accelerates so, else sticking."""
        column = self.system.column(root)
        for way in (1, -1):
            moving = self._pivoted(at, self._with_train_friction(found.mode.but(trains={root: way})))
            unit = self.system.scale.coordinates[column]
            if moving.solution.qdd[column] * way > LEAVING * self._scale(at, moving) * unit:
                return moving
        return self._pivoted(at, self._with_train_friction(found.mode.but(trains={root: 0})))

    def _with_train_friction(self, mode: ContactMode) -> ContactMode:
        """Mode with joint friction set consistently with each gear train: opposing its motion, or sticking."""
        set_valued = {
            name: int(-mode.trains[root] * sign)
            for name, (root, sign) in self.train_friction.items()
            if mode.trains[root] != FREE
        }
        return mode.but(set_valued=set_valued)

    def _pivoted(self, at: ModeProblem, mode: ContactMode) -> ModeTrial:
        """Trial with the given modes of gear trains in which no set-valued element violates its law."""
        _, J, D = set_valued_rows(at.whole)
        free = [name not in self.train_friction or mode.trains[self.train_friction[name][0]] == FREE for name in self.names]
        rests = self.sticks & (np.abs(self.rates(at.state)) <= resting(self.system, at.state.v) * self.sizes)
        for _ in range(MOST_PIVOTS):
            try:
                found = self._consistent(at, mode)
            except SimulationError as error:
                slipping = self._slipping(at, mode, rests & np.array(free, dtype=bool), J, D)
                if slipping is None:
                    raise error
                found = slipping
            signs = np.array([found.mode.set_valued[name] for name in self.names], dtype=int)
            force = np.array([found.forces[name] for name in self.names])
            over = self.beyond(signs, force, at.state.t)
            returns = rests & (signs * (J @ found.x - D) > LEAVING * self._scale(at, found) * self.sizes)
            wrong = np.flatnonzero((over | returns) & np.array(free, dtype=bool))
            if not wrong.size:
                return found
            first = wrong[0]
            mode = found.mode.but(set_valued={self.names[first]: 0 if returns[first] else int(np.sign(force[first]))})
        names = ", ".join(repr(self.names[i]) for i in wrong)
        raise SimulationError(f"t = {at.state.t:.6g} s: no forces of {names} within their limits were found.")

    def _slipping(self, at: ModeProblem, mode: ContactMode, rests, J, D) -> ModeTrial | None:
        """Trial in which an element that cannot stick, because of the constraints, slips; None if it cannot slip either.

        Its row depends on theirs, as for a clutch between two driven joints: it reverses its slip at this instant.
        """
        for i in (i for i in np.flatnonzero(rests) if not mode.set_valued[self.names[i]]):
            for sign in (-1, 1):
                try:
                    found = self._consistent(at, mode.but(set_valued={self.names[i]: sign}))
                except SimulationError:
                    continue
                if sign * (J[i] @ found.x - D[i]) < 0.0:
                    return found
        return None

    def _consistent(self, at: ModeProblem, mode: ContactMode) -> ModeTrial:
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

    def _scale(self, at: ModeProblem, found: ModeTrial) -> float:
        """Largest acceleration, in coordinates of the scene [1/s²]."""
        solution, biases = found.solution, at.gaps.D[at.touching] / gap_scales(self.system)[at.touching]
        largest = solution.compulsion.acceleration_scale(solution.a, solution.qdd)
        return max(largest, np.abs(biases).max(initial=0.0))


def active_mode(system: System, state: State, load=None, backend: str = "auto") -> ActiveMode:
    """Mode in a state of a system with set-valued elements or links with losses; ``load`` (n_v,) is added.

    Raises
    ------
    SimulationError
        As :meth:`ModeSelector.choose`.
    """
    selector = mode_selector(system)
    return selector.choose(state, selector.touching(state), backend, load=load)


def on_boundary(system: System, state: State, held: ActiveMode) -> list[str]:
    """Set-valued elements between sticking and slipping: at a bound of their force, or starting to slip."""
    selector = mode_selector(system)
    rests, found = np.abs(selector.rates(state)) <= resting(system, state.v) * selector.sizes, []
    for name, element, at_rest in zip(selector.names, selector.set_valued, rests, strict=True):
        low, high = element.bounds(state.t)
        slack = BOUND_TOLERANCE * (high - low if np.isfinite(high - low) else UNBOUNDED_WIDTH)
        sticks, force = not held.mode.set_valued[name], held.forces[name]
        at_limit = min(force - low, high - force) <= slack
        if at_limit if sticks else at_rest and element.sticks:
            found.append(name)
    return found


def mode_selector(system: System) -> ModeSelector:
    """Mode selector of a system, cached."""
    return cached(system, (ModeSelector,), lambda: ModeSelector(system))


def has_joint_modes(system: System) -> bool:
    """Whether a state alone determines the mode: set-valued elements in joints, neither losses nor contact friction."""
    others = system.losses or system.slips.placed
    return bool(system.set_valued.placed and not others and system.dynamics is not None)


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
