"""Smooth phase of a motion between two events: the scene of one contact mode, with its engine.

Active unilateral constraints and sticking elements are bilateral constraints, sliding ones are loads, inactive ones are
dropped. The system of a phase and its machine code are cached with the whole system for later motions.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends import Backend, solve
from gauss.codegen import Kernel
from gauss.dynamics.assemble import assemble
from gauss.dynamics.contact.mode_selection import ModeSelector
from gauss.dynamics.contact.mode_trial import forces_of
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.cut_rows import CutRowEngine, CutRows, cut_rows
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.held_joints import braking, held_joints, shared_frictions
from gauss.dynamics.engines.tiering import tiered_kernels
from gauss.dynamics.gap_functions import margin_kernel
from gauss.dynamics.laws.switching_functions import SwitchingFunctions, watch_of
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import MODES
from gauss.dynamics.rules import Question
from gauss.dynamics.system_dynamics import SystemDynamics
from gauss.system import ContactMode, State, System, build, phase_scene

REVERSED_FORCE = 1e-9  # relative to the largest force: a smaller force with reversed power flow ends no phase


class PhaseParts(NamedTuple):
    """System, cut rows and margins of a phase, cached."""

    system: System  # smooth system of the contact mode; active constraints are rows
    links: CutRows  # links with losses, held joints, and forces of sliding ones
    # the same system without them, if there are any; phases that differ by held and sliding joints share it
    cut: System | None
    margins: Kernel | None  # margins of the features in contact, where a body has several


def phase_parts(whole: System, names: tuple[str, ...], mode: ContactMode, places: Mapping) -> PhaseParts:
    """System, cut rows and margins of a phase, built at its first occurrence."""

    def make() -> PhaseParts:
        system = build(phase_scene(whole.scene, names, mode, places), SystemDynamics())
        frictions = shared_frictions(whole)
        held = held_joints(whole, names, mode, frictions)
        links = cut_rows(system, whole, held, mode, braking(whole, mode, frictions))
        cut, left = None, tuple(name for name in names if name not in links.names)
        if held or links.braking.any():
            others = phase_parts(whole, left, mode.without(frictions), places)
            cut = others.cut or others.system
        elif links.names:
            cut = build(phase_scene(whole.scene, names, mode, places, cut=True), SystemDynamics())
        return PhaseParts(system, links, cut, margin_kernel(whole, list(places.values())) if places else None)

    return whole.mechanics.on_demand((PhaseParts, names, mode, tuple(places.items())), make)


class Phase:
    """Smooth phase of one motion.

    Parameters
    ----------
    selector : ModeSelector
        Mode selection of the whole system.
    held : tuple of int
        Indices of the closed gaps.
    mode : ContactMode
        Contact mode: state of all other unilateral and set-valued elements.
    places : mapping
        Features in contact by name of the gap, where a body has several.
    backend : str, Backend or class
        Solver of the accelerations.
    """

    def __init__(
        self,
        selector: ModeSelector,
        held: tuple[int, ...],
        mode: ContactMode,
        places: Mapping,
        backend: str | Backend | type,
    ):
        whole, self.selector = selector.system, selector
        names = [whole.contacts.placed[i].name for i in held]
        self.case, self.held, self.mode, self.places = (held, mode), np.array(held, dtype=int), mode, dict(places)
        self.open = np.setdiff1d(np.arange(len(whole.contacts.placed)), held)
        self.signs = np.array([mode.set_valued[name] for name in selector.names], dtype=int)
        self.system, self.links, cut, self.margins = phase_parts(whole, tuple(names), mode, places)
        smooth = self.system if cut is None else cut
        self.backend, self.plan = backend, MODES.plan(Question(smooth, Laws(smooth), backend))
        if cut is not None:
            self.solvers: list = [CutRowEngine(self.system, cut, self.links, backend, self.plan)]
        else:
            self.solvers = [CertifiedEngine(backend)]
        rows = {constraint.name: constraint.rows for constraint in self.system.structure.constraints}
        self.rows = np.array([rows[name].start for name in names], dtype=int)

    @property
    def solver(self) -> Engine:
        """Source of accelerations: machine code, or numpy up to a threshold of evaluations."""
        if isinstance(self.solvers[-1], CertifiedEngine):
            kernels = tiered_kernels(self.system, self.plan, self.laws, self.solvers[0].evaluations)
            if kernels is not None:
                self.solvers.append(CompiledEngine(self.system, kernels))
        return self.solvers[-1]

    @cached_property
    def laws(self) -> Laws:
        """Its loads."""
        return Laws(self.system)

    @cached_property
    def watch(self) -> SwitchingFunctions | None:
        """Switching functions of its laws; None without any."""
        return watch_of(self.system, self.laws)

    @property
    def compiled(self) -> bool:
        """Whether it is compiled."""
        return len(self.solvers) > 1 or getattr(self.solvers[0], "compiled", None) is not None

    @property
    def may_end(self) -> bool:
        """Whether a constraint may be released, or a power flow reverse."""
        return bool(self.held.size or (self.signs == 0).any() or any(self.mode.power_flow.values()) or self.rests)

    @property
    def rests(self) -> bool:
        """Whether losses hold a train at rest: its breakaway is decided anew at every evaluation."""
        return 0 in self.mode.trains.values()

    @property
    def asks_forces(self) -> bool:
        """Whether its end depends on constraint forces; else on the laws of sliding elements alone."""
        sticking = (self.signs == 0).any()
        return bool(
            self.held.size or sticking or self.rests or any(name not in self.selector.names for name in self.selector.losses)
        )

    def holds(self, state: State) -> bool:
        """Whether its forces are admissible; if not, others may be where constraints are redundant."""
        if self.rests:
            return False
        if not self.asks_forces:
            return self._flows(forces_of(self.selector.system, self.system, self.mode, state, None))
        if self.links.names:
            solution, _ = self.solvers[0].solution(state)
        else:
            solution = solve(assemble(self.system, state), self.backend)
        forces = forces_of(self.selector.system, self.system, self.mode, state, solution)
        set_valued = np.array([forces[name] for name in self.selector.names])
        pushing = (solution.multipliers[self.rows] <= 0.0).all()
        return bool(pushing and not self.selector.beyond(self.signs, set_valued, state.t).any()) and self._flows(forces)

    def _flows(self, forces: dict[str, float]) -> bool:
        """Whether the power flow through links with losses keeps its directions."""
        mode, power_flow, units = self.mode, self.selector.power_flow(self.mode, forces), self.selector.force_units
        least = REVERSED_FORCE * self.selector.largest(forces)
        return all(
            power_flow[name] == way or abs(forces[name]) <= least * units[name] for name, way in mode.power_flow.items()
        )
