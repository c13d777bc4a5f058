"""Dynamics of one system: accelerations, compiled functions, consistent states, plans; cached on first request.

Each method imports what it answers with: a motion needs few of them.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.codegen import count, made_from, write
from gauss.dynamics.conditions import LARGE_TREE_BODIES
from gauss.dynamics.consistent_states import consistent
from gauss.dynamics.evaluation_cost import evaluation_cost, slowdown
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.plan import ACCELERATIONS, motion_plan, time_stepping_plan
from gauss.dynamics.rules import Plan, Question
from gauss.dynamics.store import Store
from gauss.errors import GaussError, SimulationError, judged_later
from gauss.system import State, Subsystem, System

if TYPE_CHECKING:
    from gauss.dynamics.contact.near_detection import CandidatePairs
    from gauss.dynamics.contact.sleepers import Sleepers
    from gauss.dynamics.contact.step_estimate import StepEstimate


class SystemDynamics(Store):
    """Dynamics of one system; its machine code is made on first request."""

    def __reduce__(self):
        return SystemDynamics, ()  # a copy makes its own machine code

    def anew(self) -> "SystemDynamics":
        """Dynamics of another system, with an empty cache."""
        return SystemDynamics()

    def plans(self, system: System) -> dict[str, Plan | SimulationError]:
        """Plans of its motions and of its single states, {name: plan}; what motions need where they have none by default."""
        motions: Plan | SimulationError
        try:
            motions = motion_plan(system)
        except SimulationError as refusal:  # of the default integrator: it says what to use
            motions = refusal
        return {"motions": motions, "accelerations": ACCELERATIONS.plan(Question(system, Laws(system, False)))}

    def candidate_pairs(self, system: System) -> "CandidatePairs":
        """Pairs of shapes that a step of time stepping looks at."""
        from gauss.dynamics.contact.near_detection import candidate_pairs

        return candidate_pairs(system)

    def time_step(self, system: System) -> "tuple[Plan, StepEstimate | None] | GaussError":
        """Plan of time stepping, and what a step by kernels of pairs takes at the start; an error with the reason."""
        from gauss.dynamics.contact.step_estimate import estimated_step

        try:
            plan = time_stepping_plan(system)
            return plan, estimated_step(system, plan)
        except GaussError as refusal:
            return refusal

    def sleepers(self, system: System) -> "Sleepers | SimulationError":
        """Bodies that may sleep in time stepping, and those that never do; where none may, the error with the reason."""
        from gauss.dynamics.contact.sleepers import sleepers

        try:
            return sleepers(Question(system, Laws(system)))
        except SimulationError as refusal:
            return refusal

    def cost(self, system: System, plan: Plan) -> tuple[float, float]:
        """Estimated cost of an evaluation by a plan [s], and its ratio to that of the fastest route that is barred."""
        return evaluation_cost(system, plan), slowdown(system, plan)

    def equal_chains(self, system: System, plan: Plan) -> list[tuple[int, int]]:
        """Numbers of equal chains that code of single states may compute together, and of their joints, for each kind."""
        from gauss.dynamics.chain_lanes import chains_for_lanes

        kinds = chains_for_lanes(system) if plan.dynamics in ("compiled", "embedded loops") else []
        return [(len(equal.chains), len(equal.chains[0].joints)) for equal in kinds]

    def called(self, system: System) -> dict[str, str]:
        """Loads with opaque laws: what a call costs, and why they are opaque."""
        from gauss.dynamics.call_cost import call_costs
        from gauss.dynamics.laws.sampled_laws import SAMPLES

        laws = Laws(system)
        sampled, costs = f"up to {SAMPLES} times before the first motion if it is a law of time", call_costs(system, laws)
        return {name: f"{costs[name]}, and {sampled}; {why}" for name, why in laws.reasons.items()}

    def operations(self, system: System, subsystems: tuple[Subsystem, ...]) -> int | None:
        """Operations of one evaluation of the forward dynamics of subsystems; None for large trees, which are not traced."""
        if sum(subsystem.n_bodies for subsystem in subsystems) > LARGE_TREE_BODIES:
            return None
        function = write(
            lambda t, q, v, effort: Mechanism(system, q, v, t[0], subsystems).motion(effort)[0],
            *(1, system.n_q, system.n_v, system.n_v),
        )
        return sum(count(function.outputs).values())

    def accelerations(self, system: System, state: State, load=None) -> np.ndarray:
        """Accelerations (n_v,)."""
        from gauss.dynamics.accelerations import Accelerations

        with judged_later():
            return self.on_demand((Accelerations,), lambda: Accelerations(system))(state, load)

    def held(self, system: System, state: State, load=None) -> Compulsion | None:
        """Compulsion of the mode in a state; None without set-valued elements, or where the state alone determines none."""
        from gauss.dynamics.contact.mode_selection import active_mode, has_joint_modes

        return active_mode(system, state, load).solution.compulsion if has_joint_modes(system) else None

    def forward_dynamics(self, system: System) -> Callable:
        """Compiled function (q, v, load, out=None, t=0.0) → q̈."""
        from gauss.dynamics.accelerations import forward_dynamics

        return made_from(forward_dynamics(system), getattr, system, "forward_dynamics")

    def function(self, system: System, names, reference: str, independent, device=None) -> Callable:
        """Compiled function of a state, or of several at once."""
        from gauss.dynamics.accelerations import forward_dynamics_on_device
        from gauss.dynamics.state_functions import state_function

        if names == ("forward_dynamics",) and independent is None:
            return self.forward_dynamics(system) if device is None else forward_dynamics_on_device(system, device)
        found = state_function(system, names, reference, independent, device)
        return made_from(found, _function_again, system, names, reference, independent) if device is None else found

    def evaluate(self, system: System, names, given: dict, t, reference: str, independent) -> dict:
        """Results of several functions of a state, by their names, for arguments by their names."""
        from gauss.dynamics.state_functions import evaluate

        return evaluate(system, names, given, t, reference, independent)

    def consistent(self, system: System, state: State, kept=(), required=False, least_violation=False, rough=False) -> State:
        """State near the given one that meets every constraint; see :func:`gauss.dynamics.consistent_states.consistent`."""
        with judged_later():
            return consistent(system, state, kept, required, least_violation, rough)

    def scene_start(self, system: System) -> State:
        """Consistent start of the scene at time 0; see :func:`gauss.dynamics.initial_states.scene_start`."""
        from gauss.dynamics.initial_states import scene_start

        with judged_later():
            return scene_start(system)

    def projected(self, system: System, state: State) -> State:
        """State projected onto the constraints; see :func:`gauss.dynamics.initial_states.projected`."""
        from gauss.dynamics.initial_states import projected

        with judged_later():
            return projected(system, state)

    def mobility(self, system: System):
        """Freedoms and redundant constraints at the start of the scene."""
        from gauss.dynamics.mobility import mobility

        return mobility(system)


def _function_again(system: System, names: tuple[str, ...], reference: str, independent) -> Callable:
    """Compiled function of a state, in another process."""
    return system.function(*names, reference=reference, independent=independent)
