"""One phase of a motion: the mechanism between two events, and where its accelerations come from.

While a gap stays closed, or a grip holds, it is a constraint like any other; while a grip slips, it is a load. What a phase
is made of, its machine code above all, is kept with the system for the motions that follow.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.assembly import assemble, margin_kernel
from gauss.backends import solve
from gauss.dynamics.dynamics import OnDemand
from gauss.dynamics.engines.certified import Certified
from gauss.dynamics.engines.compiled import Compiled
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.lossy import Lossy, Skewed, skewed
from gauss.dynamics.holding import Holder, forces_of
from gauss.dynamics.laws import Laws
from gauss.dynamics.paying import paying
from gauss.dynamics.plan import MODES
from gauss.dynamics.rules import Question
from gauss.dynamics.switching import Watch, watch_of
from gauss.system import State, System, Told, build, phase_scene
from gauss.tracing import Kernel

REVERSED = 1e-9  # of the largest force: a force so small that flows the wrong way ends no phase


class Kept(NamedTuple):
    """What is kept of a phase from motion to motion.

    Attributes
    ----------
    system : System
        Without its one-sided constraints; what holds are rows.
    links : Skewed
        Links that lose power.
    cut : System or None
        The same system without the rows of these links, if there are any.
    margins : Kernel or None
        Of the features that touch, where there are others.
    """

    system: System
    links: Skewed
    cut: System | None
    margins: Kernel | None


def kept(whole: System, names: tuple[str, ...], told: Told, places: Mapping) -> Kept:
    """What is kept of a phase, made when it comes for the first time."""

    def make() -> Kept:
        system = build(phase_scene(whole.scene, names, told, places), OnDemand())
        links = skewed(system, whole, told)
        cut = build(phase_scene(whole.scene, names, told, places, cut=True), OnDemand()) if links.names else None
        return Kept(system, links, cut, margin_kernel(whole, list(places.values())) if places else None)

    return whole.dynamics.on_demand((Kept, names, told, tuple(places.items())), make)


class Phase:
    """One mechanism between two events, in one motion.

    Parameters
    ----------
    holder : Holder
        Of the system with its one-sided constraints and grips.
    held : tuple of int
        Numbers of its gaps that are closed.
    told : Told
        What all else does that comes and goes.
    places : mapping
        By name of a gap, the features that touch there, where there are others.
    backend : str
        How accelerations are solved.
    """

    def __init__(self, holder: Holder, held: tuple[int, ...], told: Told, places: Mapping, backend: str):
        whole, self.holder = holder.system, holder
        names = [whole.contacts.placed[i].name for i in held]
        self.case, self.held, self.told = (held, told), np.array(held, dtype=int), told
        self.open = np.setdiff1d(np.arange(len(whole.contacts.placed)), held)
        self.signs = np.array([told.grips[name] for name in holder.names], dtype=int)
        self.system, self.links, cut, self.margins = kept(whole, tuple(names), told, places)
        self.backend, may_compile = backend, MODES.plan(Question(self.system, self.laws, backend)).dynamics == "compiled"
        if self.links.names:
            self.solvers: list = [Lossy(self.system, cut, self.links, backend, may_compile)]
        else:
            self.solvers = [Certified(backend)]
        self.may_compile, self.counted = may_compile and not self.links.names, 0
        rows = {constraint.name: constraint.rows for constraint in self.system.structure.constraints}
        self.rows = np.array([rows[name].start for name in names], dtype=int)

    @property
    def solver(self) -> Engine:
        """Where its accelerations come from: numpy first, machine code once there is enough to do for it."""
        if self.may_compile and len(self.solvers) == 1:
            done = self.solvers[0].evaluations
            kernels, self.counted = paying(self.system).kernels(self.laws, done - self.counted), done
            if kernels is not None:
                self.solvers.append(Compiled(self.system, kernels, ()))
        return self.solvers[-1]

    @cached_property
    def laws(self) -> Laws:
        """Its loads."""
        return Laws(self.system)

    @cached_property
    def watch(self) -> Watch | None:
        """Switching functions of its laws, if they have any."""
        return watch_of(self.system, self.laws)

    @property
    def compiled(self) -> bool:
        """Whether there is machine code of it."""
        return len(self.solvers) > 1 or getattr(self.solvers[0], "compiled", None) is not None

    @property
    def may_end(self) -> bool:
        """Whether something in it holds that could let go, or power flows that could turn."""
        return bool(self.held.size or (self.signs == 0).any() or any(self.told.ways.values()) or self.rests)

    @property
    def rests(self) -> bool:
        """Whether losses hold a train at rest: when it sets out is decided anew every time."""
        return 0 in self.told.trains.values()

    @property
    def asks_forces(self) -> bool:
        """Whether a solution tells if it goes on; else the laws of what slips do."""
        sticking = (self.signs == 0).any()
        return bool(
            self.held.size or sticking or self.rests or any(name not in self.holder.names for name in self.holder.losses)
        )

    def holds(self, state: State) -> bool:
        """Whether forces that push, within their limits, hold what holds; if not, others may, where rows are redundant."""
        if self.rests:
            return False
        if not self.asks_forces:
            return self._flows(forces_of(self.holder.system, self.system, self.told, state, None))
        if self.links.names:
            solution, _ = self.solvers[0].solution(state)
        else:
            solution = solve(assemble(self.system, state), self.backend)
        forces = forces_of(self.holder.system, self.system, self.told, state, solution)
        grips = np.array([forces[name] for name in self.holder.names])
        pushed = (solution.multipliers[self.rows] <= 0.0).all()
        return bool(pushed and not self.holder.beyond(self.signs, grips, state.t).any()) and self._flows(forces)

    def _flows(self, forces: dict[str, float]) -> bool:
        """Whether the power through links that lose some goes the ways that it did."""
        told, ways, efforts = self.told, self.holder.ways(self.told, forces), self.holder.efforts
        least = REVERSED * self.holder.largest(forces)
        return all(ways[name] == way or abs(forces[name]) <= least * efforts[name] for name, way in told.ways.items())
