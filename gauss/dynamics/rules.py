"""What a plan is, and how it is read from a table of rules.

Rules that do not apply are passed over; of the others the first that nothing speaks against is the :class:`Plan`, and those
before it are kept with what spoke against them. The tables are in :mod:`gauss.dynamics.plan`.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from gauss.dynamics.drift import Drift
from gauss.dynamics.laws import Laws
from gauss.errors import SimulationError
from gauss.integrators import Integrator
from gauss.system import System


class Rejected(NamedTuple):
    """A rule that applies, and what spoke against it.

    Attributes
    ----------
    driver, dynamics : str
        As of a :class:`Plan`.
    why : tuple of str
        The reasons.
    """

    driver: str
    dynamics: str
    why: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.driver}, {self.dynamics} dynamics: {'; '.join(self.why)}"


@dataclass(frozen=True)
class Plan:
    """How a motion, or the accelerations of a state, are computed.

    Parameters
    ----------
    driver : str
        Who advances time: "compiled loop", "Python loop", "events" (smooth phases between located events), "time stepping",
        "library", "batch", or "constant" where nothing can move; "state" for a single state.
    dynamics : str
        Where accelerations come from: "compiled" (code written out for the scene), "call graph" (a kernel for each kind of
        link and loop), "tree recursion" (a kernel for each kind of link), "unilateral" (compiled, with forces of contacts),
        "certified" (the compulsion of every state solved by a QP backend, with a certificate), or "none".
    stabilisation : str
        How drift off the constraints is undone.
    fallback : str
        What goes on where accelerations are not confirmed; empty where every one is certified.
    rejected : tuple of Rejected
        Rules of the table that apply, and what spoke against them.
    """

    driver: str
    dynamics: str
    stabilisation: str = "projection"
    fallback: str = ""
    rejected: tuple[Rejected, ...] = field(default=(), compare=False)

    @classmethod
    def from_json(cls, text: str) -> "Plan":
        """Plan from what :meth:`to_json` wrote."""
        *named, rejected = json.loads(text)
        return cls(*named, tuple(Rejected(driver, dynamics, tuple(why)) for driver, dynamics, why in rejected))

    def to_json(self) -> str:
        """All of it as text."""
        return json.dumps([self.driver, self.dynamics, self.stabilisation, self.fallback, self.rejected])

    def __str__(self) -> str:
        fallback = f"; fallback: {self.fallback}" if self.fallback else ""
        return "\n".join(
            [
                f"{self.driver}, {self.dynamics} dynamics, stabilisation {self.stabilisation!r}{fallback}",
                *(f"not {rejected}" for rejected in self.rejected),
            ]
        )


class Question(NamedTuple):
    """What is to be computed.

    Attributes
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.
    backend : str or object
        How accelerations are to be solved.
    method : Integrator or None
        How time advances; None for single states.
    drift : Drift
        How drift off the constraints is undone.
    stabilisation : str
        The same as it was asked for.
    """

    system: System
    laws: Laws
    backend: object = "auto"
    method: Integrator | None = None
    drift: Drift = Drift()
    stabilisation: str = "projection"


class Rule(NamedTuple):
    """One row of a table.

    Attributes
    ----------
    driver, dynamics, fallback : str
        Of the plan.
    when : callable
        Question → whether the rule applies.
    conditions : tuple of callable
        Question → what speaks against it.
    """

    driver: str
    dynamics: str
    fallback: str = ""
    when: Callable[[Question], bool] = lambda ask: True
    conditions: tuple[Callable[[Question], list[str]], ...] = ()

    def against(self, ask: Question) -> list[str]:
        """All that speaks against it."""
        return list(dict.fromkeys(reason for condition in self.conditions for reason in condition(ask)))


class Table(NamedTuple):
    """Rules in order.

    Attributes
    ----------
    rules : tuple of Rule
        The first that holds is taken.
    refusal : callable
        (question, reasons) → message where none does.
    """

    rules: tuple[Rule, ...]
    refusal: Callable[[Question, str], str]

    def plan(self, ask: Question, wanted: Plan | None = None) -> Plan:
        """Plan by the first rule that holds; with ``wanted``, by the rule of that driver and dynamics.

        Raises
        ------
        SimulationError
            If no rule holds, or the one that is wanted does not.
        """
        rejected: list[Rejected] = []
        for rule in (rule for rule in self.rules if rule.when(ask)):
            if wanted is not None and (rule.driver, rule.dynamics) != (wanted.driver, wanted.dynamics):
                continue
            against = rule.against(ask)
            if not against:
                return Plan(rule.driver, rule.dynamics, ask.stabilisation, rule.fallback, tuple(rejected))
            rejected.append(Rejected(rule.driver, rule.dynamics, tuple(against)))
        if wanted is not None:
            offered = "; ".join(f"{rule.driver}, {rule.dynamics} dynamics" for rule in self.rules if rule.when(ask))
            why = "; ".join(map(str, rejected)) or f"no such rule applies. These do: {offered}"
            raise SimulationError(f"plan {wanted.driver!r}, {wanted.dynamics!r}: {why}.")
        raise SimulationError(self.refusal(ask, "; ".join(dict.fromkeys(why for found in rejected for why in found.why))))
