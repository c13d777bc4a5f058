"""Selection of the contact mode: active gaps, sticking or slipping set-valued elements, directions of lossy power flow.

The laws of set-valued elements are a linear complementarity problem. Bard-type pivoting changes the first violated element
until none is left, and ends for problems with a unique solution (Murty, Note on a Bard-type scheme, 1974). A gear train at
rest starts to move only if it accelerates against the losses and Coulomb friction of the motion that would follow; otherwise
it sticks.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.backend import Backend
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import checked_load
from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.contact.impact import LEAVING, resting
from gauss.dynamics.contact.mode_trial import BOUND_TOLERANCE, UNBOUNDED_WIDTH, ModeProblem, ModeTrial, ModeTrials
from gauss.dynamics.gap_functions import gaps, set_valued_rows
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.store import cached
from gauss.errors import SimulationError
from gauss.system import FREE, ContactMode, State, System

MOST_PIVOTS = 100  # changes of elements, in one selection


class ActiveMode(NamedTuple):
    """Selected mode with its solution."""

    gaps: tuple[int, ...]  # gaps that stay closed
    mode: ContactMode  # mode of all other elements
    # forces of set-valued elements along their coordinates, and of links with losses on the driven ones [N m, N]
    forces: dict[str, float]
    solution: Solution  # certified solution
    system: System  # the phase without its gaps
    load: np.ndarray  # (n_v,) generalised forces of the losses

    @property
    def case(self) -> tuple:
        """Key of the phase."""
        return self.gaps, self.mode


class ModeSelector(ModeTrials):
    """Selection of modes of one system."""

    def choose(
        self,
        state: State,
        touching: np.ndarray,
        backend: str | Backend | type,
        backlash_sides: dict[str, int] | None = None,
        load=None,
    ) -> ActiveMode:
        """Mode in a state with the closed gaps ``touching``.

        SimulationError if a solution is not certified, or no mode is consistent.

        Parameters
        ----------
        backend : str or Backend
            Backend of the trials.
        backlash_sides : dict, optional
            Sides of the backlash in contact; those of the state when not given.
        load : array_like, shape (n_v,), optional
            Generalised forces added to those of the scene [N m, N].
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
        stays = slack <= LEAVING * self.scale_of(at, found) * gap_scales(self.system)[touching]
        return ActiveMode(
            tuple(touching[stays].tolist()), found.mode, found.forces, found.solution, found.system, found.load
        )

    def _moved_from_rest(self, at: ModeProblem, found: ModeTrial, root: str) -> ModeTrial:
        """Trial of a gear train at rest: moving against its losses if it accelerates so, else sticking."""
        column = self.system.column(root)
        for way in (1, -1):
            moving = self._pivoted(at, self._with_train_friction(found.mode.but(trains={root: way})))
            unit = self.system.scale.coordinates[column]
            if moving.solution.qdd[column] * way > LEAVING * self.scale_of(at, moving) * unit:
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
                found = self.consistent(at, mode)
            except SimulationError as error:
                slipping = self._slipping(at, mode, rests & np.array(free, dtype=bool), J, D)
                if slipping is None:
                    raise error
                found = slipping
            signs = np.array([found.mode.set_valued[name] for name in self.names], dtype=int)
            force = np.array([found.forces[name] for name in self.names])
            over = self.beyond(signs, force, at.state.t)
            returns = rests & (signs * (J @ found.x - D) > LEAVING * self.scale_of(at, found) * self.sizes)
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
                    found = self.consistent(at, mode.but(set_valued={self.names[i]: sign}))
                except SimulationError:
                    continue
                if sign * (J[i] @ found.x - D[i]) < 0.0:
                    return found
        return None


def active_mode(system: System, state: State, load=None, backend: str = "auto") -> ActiveMode:
    """Mode in a state of a system with set-valued elements or links with losses; ``load`` (n_v,) is added.

    SimulationError as :meth:`ModeSelector.choose`.
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
