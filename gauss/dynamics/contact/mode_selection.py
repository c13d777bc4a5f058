"""What holds at an instant: which closed gaps stay closed, which grips hold or slip and how, which way power is lost.

While a grip does not slide, its force is a multiplier within its bounds (see :class:`gauss.scene.SetValued`). The case of
every grip (held, pushed one way, pushed the other) is found by changing the first that is wrong, until none is; this
ends for problems with one answer (Murty, Note on a Bard-type scheme, 1974). Each trial is a compulsion with the held grips
as rows, the others as loads, and the closed gaps as rows G x ≤ h. The ways of the power through links that lose some are
those that the forces of a trial have. A train of gears at rest sets out if it does so against the losses, and the dry
friction of its joints, of the coming motion; else these hold it.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion, checked_load
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.contact.impact import LEAVING, certified, resting
from gauss.dynamics.engines.lossy import NonIdealRows, balance, balanced, non_ideal_rows
from gauss.dynamics.gap_functions import Gaps, closed, gaps, set_valued_rows, with_gaps
from gauss.dynamics.gear_trains import trains
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.scene import JointFriction
from gauss.scene.values import as_function, evaluated
from gauss.system import FREE, ContactMode, State, System, build, phase_scene

MOST_CHANGES = 100  # of what grips do, until nothing is wrong
MOST_ROUNDS = 60  # of the ways of the power
BEYOND = 1e-9  # of the width of its bounds: a force so near to one counts as within
OPEN = 1e-3  # of the force of the scene: what counts as that width where a bound is missing
NOTHING = 1e-12  # of the largest force: a force so small has no way


class ActiveMode(NamedTuple):
    """What holds.

    Attributes
    ----------
    gaps : tuple of int
        Gaps that stay closed.
    told : ContactMode
        What all else does.
    forces : dict of str to float
        Forces of grips along their coordinates, and of links that lose power on the driven ones [N m, N].
    solution : Solution
        What shows it.
    system : System
        The phase without its gaps.
    load : ndarray, shape (n_v,)
        Generalised forces that stand for the losses.
    """

    gaps: tuple[int, ...]
    told: ContactMode
    forces: dict[str, float]
    solution: Solution
    system: System
    load: np.ndarray

    @property
    def case(self) -> tuple:
        """What tells one phase of a motion from another."""
        return self.gaps, self.told


class ModeTrial(NamedTuple):
    """Answer of a trial: what follows if everything does as told."""

    told: ContactMode
    system: System
    solution: Solution
    forces: dict[str, float]
    load: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Accelerations (a, q̈)."""
        return np.concatenate([self.solution.a, self.solution.qdd])


class ModeProblem(NamedTuple):
    """What does not change from trial to trial."""

    state: State
    whole: Kinematics
    gaps: Gaps
    touching: np.ndarray
    backend: str
    load: np.ndarray


class ModeSelector:
    """Decides what holds in states of one system.

    Parameters
    ----------
    system : System
        With one-sided constraints, grips, or links that lose power.
    """

    def __init__(self, system: System):
        scene = system.scene
        self.system, self.names, self.grips = system, tuple(scene.grips), tuple(scene.grips.values())
        self.one_way = np.array([grip.one_way for grip in self.grips], dtype=bool)
        self.sticks = np.array([grip.sticks for grip in self.grips], dtype=bool)
        self.slopes = np.array([_slope(system, grip) for grip in self.grips]).reshape(len(self.grips), system.n_v)
        self.losses, self.trains, self.plays = scene.losses, trains(scene), scene.plays
        units, energy = system.scale.coordinates, system.scale.energy
        self.sizes, self.roots = (
            set_valued_scales(system),
            np.array([units[system.column(train.root)] for train in self.trains]),
        )
        driven = {name: energy / units[system.column(link.driven)] for name, link in self.losses.items()}
        self.efforts = driven | dict(zip(self.names, (energy / self.sizes).tolist(), strict=True))
        self.rubbing = {  # dry friction of joints of trains: the root, and the way that the joint turns with it
            grip.name: (train.root, np.sign(train.rates[grip.joint]))
            for grip in self.grips
            for train in self.trains
            if isinstance(grip, JointFriction) and grip.joint in train.rates
        }
        self.cases: dict[ContactMode, tuple[System, NonIdealRows]] = {}

    def case(self, told: ContactMode) -> tuple[System, NonIdealRows]:
        """System without one-sided constraints in which all else does as it is told, and its links that lose power."""
        if told not in self.cases:
            plain = not (self.names or self.losses or self.plays)
            system = self.system if plain else build(phase_scene(self.system.scene, (), told), self.system.dynamics.anew())
            self.cases[told] = system, non_ideal_rows(system, self.system, told)
        return self.cases[told]

    def rates(self, state: State) -> np.ndarray:
        """Rates (g,) with which the grips slide."""
        return self.slopes @ state.v - np.array([float(grip.rate(state.t)) for grip in self.grips])

    def turning(self, state: State) -> np.ndarray:
        """Rates of the roots of the trains."""
        return np.array([state.v[self.system.column(train.root)] for train in self.trains])

    def overtaken(self, state: State) -> np.ndarray:
        """Grips that let their driven joint go one way only, which it would have to be slower for: an impact ends that."""
        return np.flatnonzero(self.one_way & (self.rates(state) < -resting(self.system, state.v) * self.sizes))

    def flanks(self, state: State) -> dict[str, int]:
        """Flanks of elastic links that touch in a state."""
        motion, found = Kinematics(self.system, state), {}
        for name, play in self.plays.items():
            touch = {side: float(play.touch(*play.ends(motion), side)) for side in (-1, 1)}
            best = max(touch, key=touch.get)
            found[name] = best if touch[best] > 0.0 else 0
        return found

    def touching(self, state: State) -> np.ndarray:
        """Gaps of a state that touch and do not open."""
        return closed(self.system, gaps(kinematics(self.system, state)), state.v)

    def choose(
        self, state: State, touching: np.ndarray, backend: str, flanks: dict[str, int] | None = None, load=None
    ) -> ActiveMode:
        """What holds when the gaps ``touching`` may stay closed.

        Parameters
        ----------
        state : State
            Where it is and how it moves.
        touching : ndarray of int
            Gaps.
        backend : str
            How trials are solved.
        flanks : dict, optional
            Flanks of elastic links that touch; those of the state when not given.
        load : array_like, shape (n_v,), optional
            Generalised forces added to those of the scene [N m, N].

        Raises
        ------
        SimulationError
            If an answer is not certified, or no case is right.
        """
        whole = kinematics(self.system, state)
        at = ModeProblem(state, whole, gaps(whole), touching, backend, checked_load(self.system, load))
        rates, turning, small = self.rates(state), self.turning(state), resting(self.system, state.v)
        signs = (
            np.where(self.sticks, np.where(np.abs(rates) <= small * self.sizes, 0, -np.sign(rates)), 1).astype(int).tolist()
        )
        ways = np.where(np.abs(turning) <= small * self.roots, FREE, np.sign(turning)).astype(int).tolist()
        told = self._led(
            ContactMode(
                grips=dict(zip(self.names, signs, strict=True)),
                ways=dict.fromkeys(self.losses, 0),
                trains={train.root: way for train, way in zip(self.trains, ways, strict=True)},
                flanks=self.flanks(state) if flanks is None else flanks,
            )
        )
        resting_trains = [train.root for train in self.trains if told.trains[train.root] == FREE]
        found = self._fitting(at, told)
        for _ in range(MOST_CHANGES):
            before = found.told
            for root in resting_trains:
                found = self._set_out(at, found, root)
            if found.told == before:
                break
        slack = at.gaps.J[touching] @ found.x - at.gaps.D[touching]
        stays = slack <= LEAVING * self._scale(at, found) * gap_scales(self.system)[touching]
        return ActiveMode(
            tuple(touching[stays].tolist()), found.told, found.forces, found.solution, found.system, found.load
        )

    def _set_out(self, at: ModeProblem, found: ModeTrial, root: str) -> ModeTrial:
        """Trial in which a train at rest moves against its losses, where it does, or is held by them."""
        column = self.system.column(root)
        for way in (1, -1):
            moving = self._fitting(at, self._led(found.told.but(trains={root: way})))
            unit = self.system.scale.coordinates[column]
            if moving.solution.qdd[column] * way > LEAVING * self._scale(at, moving) * unit:
                return moving
        return self._fitting(at, self._led(found.told.but(trains={root: 0})))

    def _led(self, told: ContactMode) -> ContactMode:
        """The same with dry friction of joints of trains as the trains are told: against the motion, or holding."""
        grips = {
            name: int(-told.trains[root] * sign) for name, (root, sign) in self.rubbing.items() if told.trains[root] != FREE
        }
        return told.but(grips=grips)

    def _fitting(self, at: ModeProblem, told: ContactMode) -> ModeTrial:
        """Trial that agrees with what was told of trains, and in which no grip is wrong."""
        _, J, D = set_valued_rows(at.whole)
        free = [name not in self.rubbing or told.trains[self.rubbing[name][0]] == FREE for name in self.names]
        rests = self.sticks & (np.abs(self.rates(at.state)) <= resting(self.system, at.state.v) * self.sizes)
        for _ in range(MOST_CHANGES):
            try:
                found = self._consistent(at, told)
            except SimulationError as error:
                found = self._slipping(at, told, rests & np.array(free, dtype=bool), J, D)
                if found is None:
                    raise error
            signs = np.array([found.told.grips[name] for name in self.names], dtype=int)
            force = np.array([found.forces[name] for name in self.names])
            over = self.beyond(signs, force, at.state.t)
            returns = rests & (signs * (J @ found.x - D) > LEAVING * self._scale(at, found) * self.sizes)
            wrong = np.flatnonzero((over | returns) & np.array(free, dtype=bool))
            if not wrong.size:
                return found
            first = wrong[0]
            told = found.told.but(grips={self.names[first]: 0 if returns[first] else int(np.sign(force[first]))})
        names = ", ".join(repr(self.names[i]) for i in wrong)
        raise SimulationError(f"t = {at.state.t:.6g} s: no forces of {names} within their limits were found.")

    def _slipping(self, at: ModeProblem, told: ContactMode, rests, J, D) -> ModeTrial | None:
        """Trial in which a grip that constraints do not let hold sets out against its force; None if that is of no avail.

        They move it where its row depends on theirs, as a clutch between joints of which a prescribed motion turns both: it
        stands still for an instant and slips on the other way.
        """
        for i in (i for i in np.flatnonzero(rests) if not told.grips[self.names[i]]):
            for sign in (-1, 1):
                try:
                    found = self._consistent(at, told.but(grips={self.names[i]: sign}))
                except SimulationError:
                    continue
                if sign * (J[i] @ found.x - D[i]) < 0.0:
                    return found
        return None

    def _consistent(self, at: ModeProblem, told: ContactMode) -> ModeTrial:
        """Trial whose power flows as is told of it."""
        for _ in range(MOST_ROUNDS):
            found = self._trial(at, told)
            ways = self.ways(told, found.forces)
            if ways == told.ways:
                return found
            told = told.but(ways=ways)
        names = ", ".join(repr(name) for name in ways if ways[name] != found.told.ways[name])
        raise SimulationError(
            f"t = {at.state.t:.6g} s: no way of the power through {names} was found that fits its forces: what lossy links "
            "and grips do at once may be open; soften one of them by an elastic link."
        )

    def ways(self, told: ContactMode, forces: dict[str, float]) -> dict[str, int]:
        """Ways of the power through links that lose some, for given forces; those of no force as before."""
        largest, found = self.largest(forces), {}
        for name, link in self.losses.items():
            flow = forces[name] * self.direction(told, link.driver) / link.ratio
            before = told.ways[name]
            unclear = before and abs(forces[name]) <= NOTHING * largest * self.efforts[name]
            found[name] = 0 if not self.direction(told, link.driver) else before if unclear else 1 if flow >= 0.0 else -1
        return found

    def largest(self, forces: dict[str, float]) -> float:
        """Largest of some forces, in forces of the scene."""
        return max((abs(force) / self.efforts[name] for name, force in forces.items()), default=0.0)

    def beyond(self, signs, force: np.ndarray, t: float) -> np.ndarray:
        """Which (g,) of the grips that hold have a force outside of their bounds."""
        low, high = np.array([grip.bounds(t) for grip in self.grips]).reshape(-1, 2).T
        efforts = np.array([self.efforts[name] for name in self.names])
        slack = BEYOND * np.where(np.isfinite(high - low), high - low, OPEN * efforts)
        return (np.asarray(signs) == 0) & ((force < low - slack) | (force > high + slack))

    def direction(self, told: ContactMode, joint: str) -> float:
        """Way in which the train of a joint turns or sets out, over its rate; 0 at rest."""
        train = next(train for train in self.trains if joint in train.rates)
        way = told.trains[train.root]
        return 0.0 if way == FREE else float(way * np.sign(train.rates[joint]))

    def _trial(self, at: ModeProblem, told: ContactMode) -> ModeTrial:
        system, links = self.case(told)
        motion, extra, what = kinematics(system, at.state), links.W - links.R, f"what holds at t = {at.state.t:.6g} s"
        applied, found = Applied(motion), None
        if links.names and not at.touching.size:
            problem = assemble_motion(motion, applied, at.load)
            Q, found = balanced(problem, links, lambda problem: certified(problem, at.backend, what))
            return ModeTrial(told, system, found, forces_of(self.system, system, told, at.state, found), Q @ extra)

        def lacking(Q):
            nonlocal found
            problem = with_gaps(assemble_motion(motion, applied, at.load + Q @ extra), at.gaps, at.touching)
            found = certified(problem, at.backend, what)
            return -found.multipliers[links.rows] - Q

        Q = balance(lacking, np.zeros(len(links.names)))
        return ModeTrial(told, system, found, forces_of(self.system, system, told, at.state, found), Q @ extra)

    def _scale(self, at: ModeProblem, found: ModeTrial) -> float:
        """Largest acceleration at hand, in coordinates of the scene [1/s²]."""
        solution, biases = found.solution, at.gaps.D[at.touching] / gap_scales(self.system)[at.touching]
        largest = solution.compulsion.acceleration_scale(solution.a, solution.qdd)
        return max(largest, np.abs(biases).max(initial=0.0))


def active_mode(system: System, state: State, load=None, backend: str = "auto") -> ActiveMode:
    """What holds in a state of a system with grips or links that lose power; ``load`` (n_v,) is added.

    Raises
    ------
    SimulationError
        As :meth:`ModeSelector.choose`.
    """
    holder = mode_selector(system)
    return holder.choose(state, holder.touching(state), backend, load=load)


def on_boundary(system: System, state: State, held: ActiveMode) -> list[str]:
    """Names of grips that are between sticking and slipping: at a limit of their force, or setting out from rest."""
    holder = mode_selector(system)
    rests, found = np.abs(holder.rates(state)) <= resting(system, state.v) * holder.sizes, []
    for name, grip, at_rest in zip(holder.names, holder.grips, rests, strict=True):
        low, high = grip.bounds(state.t)
        slack = BEYOND * (high - low if np.isfinite(high - low) else OPEN)
        sticks, force = not held.told.grips[name], held.forces[name]
        at_limit = min(force - low, high - force) <= slack
        if at_limit if sticks else at_rest and grip.sticks:
            found.append(name)
    return found


def mode_selector(system: System) -> ModeSelector:
    """Holder of a system, made once."""
    return system.dynamics.on_demand((ModeSelector,), lambda: ModeSelector(system))


def has_joint_modes(system: System) -> bool:
    """Whether what holds in a state can be found: there are grips, and neither losses nor friction of contacts."""
    others = system.losses or system.slips.placed
    return bool(system.grips.placed and not others and system.dynamics is not None)


def forces_of(whole: System, system: System, told: ContactMode, state: State, solution: Solution | None) -> dict[str, float]:
    """Forces of all grips and links that lose power: multipliers of what holds, laws of what slips."""
    rows = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    motion, found = Kinematics(whole, state), {}
    for name, link in (whole.scene.losses | whole.scene.grips).items():
        sign = told.grips.get(name, 0)
        law = as_function(link.effort(sign)) if sign else None
        force = evaluated(law, (state.t, motion), link.what, 1)[0] if sign else 0.0
        found[name] = float(force) if sign else float(-solution.multipliers[rows[name]])
    return found


def _slope(system: System, grip) -> np.ndarray:
    """Slopes (n_v,) of the rate with which a grip slides."""
    row = np.zeros(system.n_v)
    for joint, factor in grip.acts_on.items():
        row[system.column(joint)] += factor
    return row
