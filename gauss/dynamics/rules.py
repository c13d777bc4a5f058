"""Plans, and the tables of rules that select them.

Of the rules that apply, the first whose conditions all hold gives the :class:`Plan`; those before it are recorded with the
conditions that they violate. The tables are in :mod:`gauss.dynamics.plan`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

from gauss.codegen.tiers import AUTO, checked
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.errors import SimulationError
from gauss.integrators import Integrator
from gauss.system import System
from gauss.system.explain import MOST_REASONS


class Rejected(NamedTuple):
    """An applicable rule whose conditions do not hold."""

    driver: str  # driver, dynamics: as of a :class:`Plan`
    dynamics: str
    why: tuple[str, ...]  # violated conditions, in words

    def __str__(self) -> str:
        return f"{self.driver}, {self.dynamics} dynamics: {reasons_in_words(self.why)}"


def reasons_in_words(reasons: Sequence[str]) -> str:
    """The first reasons, and how many more there are: a scene may have thousands of contacts."""
    more = f"; and {len(reasons) - MOST_REASONS} more" if len(reasons) > MOST_REASONS else ""
    return "; ".join(reasons[:MOST_REASONS]) + more


@dataclass(frozen=True)
class Plan:
    """Driver and dynamics of a motion, or dynamics of a single state.

    Parameters
    ----------
    driver : str
        Who advances time: "compiled loop", "Python loop", "events" (smooth phases between located events), "time stepping",
        "library", "batch", "samples" (one motion from each sample of a control law to the next), or "constant" without
        degrees of freedom; "state" for a single state.
    dynamics : str
        Where accelerations come from: "compiled" (straight-line code of the scene), "embedded loops" (the same, with loops
        eliminated where they close), "call graph" (a kernel for each kind of
        link and loop), "tree recursion" (a kernel for each kind of link), "callbacks" (compiled, calling opaque laws),
        "unilateral" (compiled, with an active set of contacts), "pair kernels" (kernels of pairs of shapes, shared by all
        scenes), "certified" (a QP backend solves every state, with a certificate), or "none". How wide the vectors of
        straight-line code are, and whether it computes equal chains of a single state in their lanes
        (:mod:`gauss.dynamics.chain_lanes`), is left to code generation.
    stabilisation : str
        Constraint stabilisation.
    fallback : str
        Dynamics used once compiled accelerations fail a check; empty where every acceleration is certified.
    rejected : tuple of Rejected
        Applicable rules that precede the chosen one in the table.
    tier : str
        Tier of the machine code (:mod:`gauss.codegen.tiers`). Of a plan to be followed: "quick", "optimised", or "auto",
        that of the environment variable ``GAUSS_TIER``; code that is optimised already stays so, for the results are the
        same. Of a motion that has run: "quick" if quick code ran in it, else "optimised".
    sleepers : int or None
        Bodies that may sleep, of a motion with ``sleeping=`` that has run; None of others.
    """

    driver: str
    dynamics: str
    stabilisation: str = "projection"
    fallback: str = ""
    rejected: tuple[Rejected, ...] = field(default=(), compare=False)
    tier: str = field(default=AUTO, compare=False)
    sleepers: int | None = field(default=None, compare=False)

    def __post_init__(self):
        checked(self.tier, "Plan: tier")

    @classmethod
    def from_json(cls, text: str) -> "Plan":
        """Plan from the text of :meth:`to_json`."""
        import json  # few runs need it

        driver, dynamics, stabilisation, fallback, found, *later = json.loads(text)  # files of before hold fewer
        rejected = tuple(Rejected(driver, dynamics, tuple(why)) for driver, dynamics, why in found)
        return cls(driver, dynamics, stabilisation, fallback, rejected, *later)

    def ran(self, tier: str) -> "Plan":
        """Copy with the tier of the code that ran."""
        made = self.__dict__.setdefault("made", {})  # once for all motions of this plan
        if tier not in made:
            made[tier] = replace(self, tier=tier)
        return made[tier]

    def to_json(self) -> str:
        """All fields as JSON."""
        import json

        parts = self.driver, self.dynamics, self.stabilisation, self.fallback, self.rejected, self.tier, self.sleepers
        return json.dumps(parts)

    def __str__(self) -> str:
        fallback = f"; fallback: {self.fallback}" if self.fallback else ""
        sleep = "" if self.sleepers is None else f"; {self.sleepers} bodies may sleep"
        return "\n".join(
            [
                f"{self.driver}, {self.dynamics} dynamics, stabilisation {self.stabilisation!r}{fallback}{sleep}",
                *(f"not {rejected}" for rejected in self.rejected),
            ]
        )


class Question(NamedTuple):
    """Facts on which the conditions of rules are evaluated."""

    system: System  # the system
    laws: Laws  # its loads, traced or opaque
    backend: object = "auto"  # requested backend, or "auto"
    method: Integrator | None = None  # integrator; None for single states
    drift: Drift = Drift()  # constraint stabilisation with its gains
    stabilisation: str = "projection"  # its name, as given by the user
    held: bool = False  # whether inputs are held between samples of a control law


def named(backend) -> str:
    """Name of a backend."""
    return backend if isinstance(backend, str) else getattr(backend, "name", type(backend).__name__)


class Asked(Protocol):
    """Facts that every table of rules needs."""

    @property
    def stabilisation(self) -> str:
        """Name of the constraint stabilisation."""


class Rule(NamedTuple):
    """One row of a table."""

    driver: str  # driver, dynamics, fallback: of the plan
    dynamics: str
    fallback: str = ""
    when: Callable[[Any], bool] = lambda ask: True  # question → whether the rule applies
    conditions: tuple[Callable[[Any], list[str]], ...] = ()  # question → violated conditions, in words

    def against(self, ask: Asked) -> list[str]:
        """Violated conditions, each once."""
        return list(dict.fromkeys(reason for condition in self.conditions for reason in condition(ask)))


class RuleTable(NamedTuple):
    """Rules in order."""

    rules: tuple[Rule, ...]  # the first whose conditions hold is taken
    refusal: Callable[[Any, str], str]  # (question, reasons) → message where none does

    def plan(self, ask: Asked, wanted: Plan | None = None) -> Plan:
        """Plan of the first rule whose conditions hold; with ``wanted``, of the rule with that driver and dynamics.

        SimulationError if the conditions of no rule hold, or not those of the wanted one.
        """
        rejected: list[Rejected] = []
        applicable = [rule for rule in self.rules if rule.when(ask)]
        for rule in applicable:
            if wanted is not None and (rule.driver, rule.dynamics) != (wanted.driver, wanted.dynamics):
                continue
            against = rule.against(ask)
            if not against:
                return Plan(rule.driver, rule.dynamics, ask.stabilisation, rule.fallback, tuple(rejected))
            rejected.append(Rejected(rule.driver, rule.dynamics, tuple(against)))
        if wanted is not None:
            raise _refused(wanted, applicable, rejected)
        reasons = dict.fromkeys(why for found in rejected for why in found.why)
        raise SimulationError(self.refusal(ask, reasons_in_words(list(reasons))))


def _refused(wanted: Plan, applicable: list[Rule], rejected: list[Rejected]) -> SimulationError:
    """Error of a wanted plan whose rule does not apply, or whose conditions do not hold."""
    offered = "; ".join(f"{rule.driver}, {rule.dynamics} dynamics" for rule in applicable)
    why = "; ".join(map(str, rejected)) or f"no such rule applies. These do: {offered}"
    return SimulationError(f"plan {wanted.driver!r}, {wanted.dynamics!r}: {why}.")
