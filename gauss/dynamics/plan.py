"""Selection of driver and dynamics: ordered tables of rules, of which the first whose conditions hold is the plan.

Motions, by :func:`gauss.simulate`:

==================  ==============  =====================================================================================
driver              dynamics        applies to
==================  ==============  =====================================================================================
constant            none            scenes without degrees of freedom
time stepping       compiled        ``integrator="time_stepping"``
time stepping       callbacks       the same with opaque laws, called by machine code
time stepping       pair kernels    the same with many contacts of shapes
time stepping       certified       the same, where the dynamics cannot be compiled
events              compiled        unilateral constraints, joint friction, limited forces, losses
events              certified       the same, with an explicit backend
library             compiled        integrators of other libraries
compiled loop       embedded loops  smooth scenes with independent loop constraints, by explicit integrators
compiled loop       compiled        smooth scenes: integrator and dynamics in machine code
compiled loop       call graph      many kinematic loops, by explicit integrators
compiled loop       tree recursion  large trees, by explicit integrators
compiled loop       callbacks       opaque laws, called by machine code, by explicit integrators
Python loop         call graph      many kinematic loops, by implicit integrators
Python loop         tree recursion  large trees, by implicit integrators
Python loop         compiled        opaque laws, and systems too large for a compiled step, by implicit integrators
library             certified       all other scenes, by integrators of other libraries
samples             compiled        inputs held between samples of a control law, where no rule of machine code applies
Python loop         certified       all other scenes
==================  ==============  =====================================================================================

Single states: "unilateral" where frictionless contacts are the only non-smooth elements, "call graph" for many loops, "tree
recursion" for large trees, "embedded loops" for loops, "compiled", and "certified" for all others. See
:class:`gauss.dynamics.rules.Plan`.
"""

from collections.abc import Callable, Hashable

from gauss.codegen import content_key
from gauss.dynamics.conditions import (
    callbacks,
    closed_form_contacts,
    compilable,
    compilable_by_kernels,
    contacts_alone,
    definite_mass_matrix,
    explicit,
    few_bodies,
    few_closed_gaps,
    few_contact_operations,
    few_loop_rows,
    few_loops,
    has_contacts,
    has_opaque_laws,
    large_loops,
    large_tree,
    located_contacts,
    narrow,
    no_held_inputs,
    own_backend,
    shapes_in_contact,
    small_contact_problem,
    smooth,
    takes_pair_kernels,
    traced_laws,
    written_out,
)
from gauss.dynamics.front_rank import has_loops, independent_fronts, regular_fronts
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Plan, Question, Rule, RuleTable, named
from gauss.dynamics.store import cached, cached_on_disk
from gauss.integrators import IMPLICIT, LIBRARIES, METHODS, FixedStep, Library, Taylor
from gauss.system import System

Condition = Callable[[Question], list[str]]  # question → violations in words


_KEYS: dict[int, str] = {}  # names of built-in methods, by their address


def is_time_stepping(ask) -> bool:
    """Whether the integrator of a question, or of a problem, is Moreau–Jean time stepping."""
    return isinstance(ask.method, FixedStep) and ask.method.nonsmooth


def _no_time_stepping(ask: Question) -> bool:
    """Other integrators than time stepping."""
    return not is_time_stepping(ask)


def _is_nonsmooth(ask: Question) -> bool:
    """Unilateral or set-valued elements, without time stepping."""
    return bool(ask.system.nonsmooth) and not is_time_stepping(ask)


def _smooth(ask: Question) -> bool:
    """Smooth scenes, by integrators of gauss."""
    return not (is_time_stepping(ask) or _is_nonsmooth(ask) or isinstance(ask.method, Library))


def _library(ask: Question) -> bool:
    """Integrators of other libraries."""
    return isinstance(ask.method, Library)


def no_inputs_of_series(ask: Question) -> list[str]:
    """The method is no Taylor series, or no inputs are held between samples: series have no inputs."""
    return no_held_inputs(ask) if isinstance(ask.method, Taylor) else []


def _held(ask: Question) -> bool:
    """Inputs held between samples of a control law."""
    return ask.held


def _by_accelerations(ask: Question) -> bool:
    """Whether a step needs no more than accelerations of single states."""
    return not _beyond_accelerations(ask)


def _beyond_accelerations(ask: Question) -> str:
    """Reason why equations of motion are needed beyond accelerations of single states; empty if there is none."""
    method = ask.method
    if method is not None and (method.implicit if isinstance(method, Library) else method.mechanical):
        return f"integrator {method.name!r}"
    return "stabilisation 'partitioning'" if ask.drift.partitioned else ""


def _refused(ask: Question, why: str) -> str:
    needs = _beyond_accelerations(ask)
    if closed_form_contacts(ask) or (_is_nonsmooth(ask) and located_contacts(ask)):
        return f"scene {ask.system.scene.name!r}: {why}; use integrator='time_stepping' with a step, and the backend 'auto'."
    return f"{needs} needs the equations of motion in machine code: {why}. Use integrator 'dop853' and 'projection' here."


def _both(one: Callable[[Question], bool], other: Callable[[Question], bool]) -> Callable[[Question], bool]:
    def both(ask: Question) -> bool:
        return one(ask) and other(ask)

    both.__doc__ = " and ".join((condition.__doc__ or "").rstrip(".") for condition in (one, other))
    return both


def _motionless(ask: Question) -> bool:
    """Scenes without degrees of freedom."""
    return not ask.system.n_v


def _with_feedback(ask: Question) -> bool:
    """Baumgarte feedback on the constraints."""
    return ask.drift.gains is not None


def _without_feedback(ask: Question) -> bool:
    """No Baumgarte feedback on the constraints."""
    return ask.drift.gains is None


_CODE = own_backend, compilable
_KERNELS = own_backend, compilable_by_kernels
_WHOLE = *_CODE, written_out, traced_laws, narrow
_DENSE_STEP = own_backend, smooth(compilable), smooth(few_bodies), small_contact_problem
_STEP, _CALLING_STEP = (*_DENSE_STEP, smooth(traced_laws)), (*_DENSE_STEP, callbacks, few_contact_operations)
_PAIR_KERNELS = own_backend, takes_pair_kernels
_ALONE = _both(_smooth, _by_accelerations)
_LOOP = *_WHOLE, no_inputs_of_series
_KERNEL_LOOP = *_KERNELS, callbacks, explicit, no_held_inputs
_CALLING_LOOP = *_CODE, callbacks, explicit, written_out

MOTIONS = RuleTable(
    (
        Rule("constant", "none", when=_motionless),
        Rule("time stepping", "compiled", "certified", is_time_stepping, (*_STEP, few_contact_operations)),
        Rule("time stepping", "callbacks", "certified", _both(is_time_stepping, has_opaque_laws), _CALLING_STEP),
        Rule("time stepping", "pair kernels", "", _both(is_time_stepping, shapes_in_contact), _PAIR_KERNELS),
        Rule("time stepping", "certified", when=is_time_stepping, conditions=(no_held_inputs, closed_form_contacts)),
        Rule("events", "compiled", "certified", _is_nonsmooth, (own_backend, no_held_inputs, located_contacts)),
        Rule("events", "certified", when=_is_nonsmooth, conditions=(no_held_inputs, located_contacts)),
        Rule("library", "compiled", "", _library, (*_WHOLE, no_held_inputs)),
        Rule(
            "compiled loop", "embedded loops", "compiled", _both(_ALONE, has_loops), (*_LOOP, explicit, independent_fronts)
        ),
        Rule("compiled loop", "compiled", "refined", _both(_smooth, _without_feedback), _LOOP),
        Rule("compiled loop", "compiled", "certified", _both(_smooth, _with_feedback), _LOOP),
        Rule("compiled loop", "call graph", "certified", _both(_ALONE, large_loops), _KERNEL_LOOP),
        Rule("compiled loop", "tree recursion", "certified", _both(_ALONE, large_tree), _KERNEL_LOOP),
        Rule("compiled loop", "callbacks", "certified", _both(_ALONE, has_opaque_laws), _CALLING_LOOP),
        Rule("samples", "compiled", "certified", _both(_held, _by_accelerations)),
        Rule("Python loop", "call graph", "certified", _both(_ALONE, large_loops), _KERNELS),
        Rule("Python loop", "tree recursion", "certified", _both(_ALONE, large_tree), _CODE),
        Rule("Python loop", "compiled", "certified", _ALONE, (*_CODE, written_out)),
        Rule("library", "certified", when=_both(_library, _by_accelerations)),
        Rule("Python loop", "certified", when=_ALONE),
    ),
    _refused,
)
_WHOLE_BATCH = compilable, few_bodies, traced_laws
TIME_STEPPING_FIRST = "integrator='time_stepping', or "
# Batches (ensembles) of motions of one system.
BATCHES = RuleTable(
    (
        Rule("batch", "compiled", "simulate", is_time_stepping, (*_STEP, closed_form_contacts)),
        Rule(
            "batch", "embedded loops", "simulate", _both(_no_time_stepping, has_loops), (*_WHOLE_BATCH, independent_fronts)
        ),
        Rule("batch", "compiled", "simulate", _no_time_stepping, _WHOLE_BATCH),
    ),
    lambda ask, why: (
        f"scene {ask.system.scene.name!r} cannot be compiled: {why}; use "
        f"{TIME_STEPPING_FIRST if _is_nonsmooth(ask) else ''}simulate for each motion."
    ),
)


def _unilateral(*laws: Condition) -> Rule:
    return Rule("state", "unilateral", "certified", has_contacts, (contacts_alone, smooth(compilable), *map(smooth, laws)))


def _of_states(*laws: Condition) -> tuple[Rule, ...]:
    """Rules of single states; ``laws`` are conditions on laws beside straight-line code."""
    return (
        _unilateral(*laws),
        Rule("state", "call graph", "certified", large_loops, (compilable_by_kernels,)),
        Rule("state", "tree recursion", "certified", large_tree, (compilable,)),
        Rule("state", "embedded loops", "compiled", has_loops, (written_out, compilable, *laws, regular_fronts)),
        Rule("state", "compiled", "certified", conditions=(written_out, compilable, *laws)),
    )


def _refused_state(ask: Question, why: str) -> str:
    return f"scene {ask.system.scene.name!r} cannot be compiled: {why}; use system.accelerations(state, load)."


_ACTIVE_SET = contacts_alone, smooth(compilable), smooth(traced_laws)
_AT_ONCE = *_ACTIVE_SET, smooth(definite_mass_matrix)
# Active set of frictionless contacts; "tiered": by numpy first, compiled above a threshold of evaluations.
CONTACTS = RuleTable(
    (
        Rule("state", "compiled", "certified", has_contacts, (*_AT_ONCE, few_contact_operations)),
        Rule("state", "tiered", "certified", has_contacts, _ACTIVE_SET),
        Rule("state", "certified"),
    ),
    _refused_state,
)
# A smooth phase between events.
MODES = RuleTable(
    (
        Rule(
            "events",
            "compiled",
            "certified",
            conditions=(own_backend, compilable, few_closed_gaps, definite_mass_matrix),
        ),
        Rule("events", "tiered", "certified", conditions=(own_backend, compilable)),
        Rule("events", "certified"),
    ),
    _refused_state,
)
# Time steps and impacts: free accelerations, and responses to unit forces.
RESPONSES = RuleTable(
    (
        Rule("state", "tree recursion", "certified", large_tree, (own_backend, compilable, traced_laws)),
        Rule("state", "compiled", "certified", conditions=(own_backend, compilable, traced_laws)),
        Rule("state", "certified"),
    ),
    _refused_state,
)
# Functions of a state trace the laws once; accelerations call every law anew, for it may have changed.
FUNCTIONS = RuleTable(_of_states(traced_laws), _refused_state)
ACCELERATIONS = RuleTable((*_of_states(), Rule("state", "certified")), _refused_state)
# Accelerations of batches on a device: one straight-line function of all.
DEVICE_FUNCTIONS = RuleTable(
    (Rule("batch", "compiled", "certified", conditions=(compilable, few_bodies, traced_laws)),), _refused_state
)
# Derivatives of accelerations.
DERIVATIVES = RuleTable(
    (Rule("state", "compiled", conditions=(compilable, traced_laws, few_bodies)),),
    lambda ask, why: f"scene {ask.system.scene.name!r} cannot be differentiated: {why}.",
)
# Linear models of many states: written out as a whole, or that of each state by compiled derivatives.
LINEAR_MODELS = RuleTable(
    (
        Rule("state", "compiled", conditions=(compilable, traced_laws, few_loops, few_loop_rows)),
        Rule("Python loop", "compiled", conditions=(compilable, traced_laws, few_bodies)),
    ),
    lambda ask, why: f"linear models of {ask.system.scene.name!r} cannot be prepared: {why}; call gauss.linearise instead.",
)

# Code of other languages.
EXPORTS = RuleTable(
    (Rule("state", "compiled", conditions=(compilable, traced_laws, few_loops)),),
    lambda ask, why: f"scene {ask.system.scene.name!r} cannot be exported: {why}.",
)


def motion_plan(system: System) -> Plan:
    """Plan of a motion with the default integrator of :func:`gauss.simulate`."""
    return plan_of(Question(system, Laws(system), method=METHODS["dop853"]))


# Rules ask for the kind of a method alone; steps of time stepping belong to the simulation.
_TIME_STEPPING = FixedStep("time_stepping", "time stepping", 1, "", 1, lambda *_: NotImplemented, nonsmooth=True)


def time_stepping_plan(system: System) -> Plan:
    """Plan of a motion by time stepping; SimulationError if the conditions of no rule hold."""
    return MOTIONS.plan(Question(system, Laws(system), method=_TIME_STEPPING))


def plan_of(ask: Question, wanted: Plan | None = None) -> Plan:
    """Plan of a motion, cached with the system; of a plain one on disk, for its conditions reduce the system.

    SimulationError if the conditions of no rule hold, or not those of the wanted one.
    """
    make = lambda: MOTIONS.plan(ask, wanted)  # noqa: E731
    if ask.system.dynamics is None or ask.laws.called:
        return make()
    key = plan_of, method_key(ask.method), ask.stabilisation, ask.drift, named(ask.backend), ask.laws.key, ask.held, wanted
    return (cached_on_disk if ask.system.is_plain and wanted is None else cached)(ask.system, key, make)


def method_key(method) -> Hashable:
    """Cache key of a method: the name of a built-in one, the content of another, which is never a text."""
    key: Hashable = _KEYS.get(id(method))
    if key is None:
        known = (*LIBRARIES, *IMPLICIT) if isinstance(method, Library) else (METHODS.get(method.name),)
        if not any(method is one for one in known):
            return content_key(method)
        key = _KEYS[id(method)] = method.name  # the object stays in its table: no other one takes its address
    return key
