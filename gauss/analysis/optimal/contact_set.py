"""Closed gaps of a phase of an optimal motion: its smooth system, what its forces may be, and the impact at its start.

While a gap is closed its force pushes, λ_N ≥ 0, and with friction it sticks, |λ_T| ≤ μ λ_N; an open one is nowhere negative.
Gauss's principle for velocities gives the rates v⁺ after an impact: the nearest to v⁻ in the mass metric with
K v⁺ − C = −e (K v⁻ − C) for all gaps that close, whose impulses push and stick as well.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from gauss.analysis.optimal.equations import Casadi, OptimalEquations, unlimited
from gauss.dynamics import compile_scene
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mechanism import Mechanism
from gauss.errors import ArgumentError, did_you_mean
from gauss.scene import Contact
from gauss.system import State, System, phase_scene, sides
from gauss.system.contact_mode import slips
from gauss.system.relations import place_residuals

STICKS = "{} sticks"  # name of the tangential constraint of a rough contact


class ContactSet:
    """Gaps that are closed in a phase.

    Parameters
    ----------
    whole : System
        System with all its unilateral constraints.
    names : sequence of str
        Names of the closed gaps, or of unilateral constraints all of whose gaps are.
    """

    def __init__(self, whole: System, names: Sequence[str]):
        self.whole, self.sides = whole, sides(whole.scene)
        known = [side.name for side in self.sides]
        given = {one for name in names for one in ([name] if name in known else self._gaps_of(name, known))}
        self.names = tuple(name for name in known if name in given)
        self.places = [known.index(name) for name in self.names]

    def _gaps_of(self, name, known: list[str]) -> list[str]:
        """Gaps of a unilateral constraint."""
        contact = self.whole.scene.contacts.get(name) if isinstance(name, str) else None
        if contact is None:
            raise ArgumentError(
                f"optimal motion: closed: no stop, rope or contact {name!r}. "
                f"{did_you_mean(str(name), (*known, *self.whole.scene.contacts))}"
            )
        return list(contact.sides(self.whole.scene))

    def __or__(self, other: "ContactSet") -> "ContactSet":
        return ContactSet(self.whole, (*self.names, *other.names))

    def less(self, other: "ContactSet") -> "ContactSet":
        """Those that are not closed in another one."""
        return ContactSet(self.whole, [name for name in self.names if name not in other.names])

    @cached_property
    def system(self) -> System:
        """System in which they are bilateral constraints, and the open ones are dropped."""
        scene = self.whole.scene
        if not scene.contacts:
            return self.whole
        rough = {STICKS.format(one.name): one for one in slips(scene) if one.name in self.names}
        stuck = {name: replace(one, name=name) for name, one in rough.items()}
        smooth = phase_scene(scene, self.names)
        return compile_scene(replace(smooth, relations=smooth.relations | stuck, set_valued=scene.set_valued))

    @property
    def scales(self) -> np.ndarray:
        """Scales of its gap functions [m, rad]."""
        return gap_scales(self.whole)[self.places]

    def widths(self, t, q, v) -> np.ndarray:
        """Its gap functions, in shares of their scales."""
        watched = place_residuals(self.whole, [self.sides[k] for k in self.places])
        found = np.array(watched.values(kinematics(self.whole, State(t[0], q, v)))).reshape(-1)  # their rates follow them
        return found[: len(self.places)] / self.scales

    def admissible(self, mechanism: Mechanism, multipliers, unit: float) -> list:
        """What of forces is not negative: normal forces, and μ² λ_N² − λ_T² where gaps stick, in shares of their units.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism of which they are constraints.
        multipliers : ndarray
            All of its multipliers, which pull where they are positive.
        unit : float
            Work of a unit force on a unit displacement [J], or of an impulse on a unit rate.
        """
        rows, found = mechanism.relation_rows, []
        for k, scale in zip(self.places, self.scales, strict=True):
            side, contact = self.sides[k], self.sides[k].whole
            normal = -multipliers[rows[side.name].start] * (scale / unit)
            found.append(normal)
            if isinstance(contact, Contact) and contact.friction:
                across = multipliers[rows[STICKS.format(side.name)]] * (scale / unit)
                found.append((contact.friction * normal) ** 2 - across @ across)
        return found

    @property
    def gap_labels(self) -> tuple[tuple[str, float], ...]:
        """What its gap functions are in messages, and their units [m, rad]."""
        return tuple((f"the gap of {name!r}", scale) for name, scale in zip(self.names, self.scales, strict=True))

    @property
    def force_labels(self) -> tuple[tuple[str, float], ...]:
        """What :meth:`admissible` gives in messages, and its units [N, N m; of cones their square]."""
        found = []
        for k, name, scale in zip(self.places, self.names, self.scales, strict=True):
            unit, contact = self.whole.scale.energy / scale, self.sides[k].whole
            found.append((f"the force of {name!r}", unit))
            if isinstance(contact, Contact) and contact.friction:
                found.append((f"the cone of friction of {name!r}", unit**2))
        return tuple(found)

    @cached_property
    def opened(self) -> "ContactSet":
        """All gaps that are not closed."""
        return ContactSet(self.whole, [side.name for side in self.sides]).less(self)

    def open_gaps(self, equations: OptimalEquations) -> Casadi | None:
        """(t, x, u) → all gaps that are not closed; None if there are none."""
        opened = self.opened
        return equations.in_units(lambda t, q, v, _: opened.widths(t, q, v), "gaps") if opened.names else None

    def forces(self, equations: OptimalEquations) -> Casadi | None:
        """(t, x, u) → what of the forces of a phase is not negative; None without closed gaps."""

        def values(t, q, v, u):
            loaded = LoadedMechanism(equations.system, equations.loads(u), t[0], q, v, np.zeros(v.size))
            return np.array(self.admissible(loaded.mechanism, loaded.motion()[1], self.whole.scale.energy), dtype=object)

        return equations.in_units(values, "forces") if self.names else None

    def pulls(self, equations: OptimalEquations, closed: "ContactSet") -> Casadi | None:
        """(t, x, u) → less the normal forces that gaps of another phase would have if they did not open in this one."""
        opening, system = closed.less(self), unlimited(closed.system)

        def values(t, q, v, u):
            loaded = LoadedMechanism(system, equations.loads(u), t[0], q, v, np.zeros(v.size))
            rows, y = loaded.mechanism.relation_rows, loaded.motion()[1]
            places = np.array([rows[name].start for name in opening.names])
            return y[places] * (opening.scales / self.whole.scale.energy)

        return equations.in_units(values, "pulls") if opening.names else None


def impact_between(
    equations: OptimalEquations, touching: ContactSet, struck: ContactSet, units: np.ndarray
) -> tuple[Casadi, Casadi]:
    """(t, x, u) → state after an impact, and impulses that are not negative, in shares of their units.

    Parameters
    ----------
    equations : OptimalEquations
        Equations of the phase before it.
    touching : ContactSet
        Gaps that are closed at the impact.
    struck : ContactSet
        Those that rebound, each with its own coefficient of restitution.
    """
    whole = touching.whole
    restitution = {name: struck.sides[k].whole.restitution for k, name in zip(struck.places, struck.names, strict=True)}

    def moved(t, q, v):
        mechanism = Mechanism(touching.system, q, v, t[0])
        residual = mechanism.velocity_residual()
        rebound = np.zeros(residual.size)
        for name, e in restitution.items():
            rebound[mechanism.relation_rows[name]] = e
        return mechanism, *mechanism.response(np.zeros(v.size), -(1.0 + rebound) * residual)

    def after(t, q, v, _):
        return np.concatenate([q, v + moved(t, q, v)[1]])

    def impulses(t, q, v, _):
        mechanism, _, multipliers = moved(t, q, v)
        found = touching.admissible(mechanism, multipliers, whole.scale.energy * whole.scale.time)
        return np.array(found, dtype=object)

    return equations.in_units(after, "impact", units), equations.in_units(impulses, "impulses")
