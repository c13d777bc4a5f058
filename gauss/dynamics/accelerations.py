"""Accelerations of single states: machine code with an error check, and the certified recursion where the check fails."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gauss.backends.certificate import TOLERANCE
from gauss.codegen import (
    EntryCode,
    Function,
    Interface,
    NativeFunction,
    PythonWrapper,
    batch_code,
    entry_code,
    fastcall,
    write,
)
from gauss.dynamics.assemble import checked_load
from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.contact.mode_selection import active_mode, has_joint_modes
from gauss.dynamics.contact.unilateral import unilateral_dynamics
from gauss.dynamics.engines.call_graph import refined_call_graph
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.tiering import TieredFunction
from gauss.dynamics.engines.tree_recursion import corrected_recursion
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.plan import ACCELERATIONS, DEVICE_FUNCTIONS, FUNCTIONS
from gauss.dynamics.rules import Plan, Question
from gauss.dynamics.store import cached, cached_on_disk
from gauss.dynamics.traced_refinement import embedded_once, refined, refined_once
from gauss.dynamics.traced_system import FINITE, Program
from gauss.system import State, System

if TYPE_CHECKING:
    from gauss.codegen.gpu.device_function import DeviceFunction

NAME = "forward_dynamics"
DOC = """Joint accelerations (n_v,) of a state under generalised forces, in machine code with an error check.

Parameters
----------
q, v, load : ndarray, shape (…, n_q), (…, n_v), (…, n_v)
    Coordinates (quaternions of unit length), rates, generalised forces added to the loads of the scene [N m, N]; vectors, or
    batches of them where the system is compiled as a whole.
out : ndarray, shape (…, n_v), optional
    Array for the result.
t : float
    Time [s].

Raises
------
StateError
    If an argument does not fit.
SimulationError
    If no accelerations can be certified.
"""
BY_KERNELS: dict[str, Callable[[System, Sequence], NativeFunction]] = {  # dynamics with all laws evaluated by Python
    "call graph": refined_call_graph,
    "tree recursion": corrected_recursion,
}


class Accelerations:
    """Accelerations of one system; every law is called at every evaluation, because it may change."""

    def __init__(self, system: System):
        self.system, laws = system, Laws(system, trace=False)
        self.loads, self._shapes = LoadForces(system, laws.called) if laws.called else None, ((system.n_q,), (system.n_v,))
        self.plan = ACCELERATIONS.plan(Question(system, laws))
        self.compiled = None if self.plan.dynamics == "certified" else compiled(system, laws, self.plan)

    def __call__(self, state: State, load=None) -> np.ndarray:
        """Accelerations (n_v,); ``load`` (n_v,) is added to the loads of the scene."""
        if self.compiled is None:
            return _certified(self.system, state, load)
        load = checked_load(self.system, load)
        if self.loads is not None and self._fits(state):  # else the machine code says what does not
            load = load + self.loads(state)[0]
        return self.compiled(state.q, state.v, load, None, state.t)

    def _fits(self, state: State) -> bool:
        q, v, shapes = state.q, state.v, self._shapes
        if type(q) is np.ndarray is type(v):  # the usual case, quickly
            return (q.shape, v.shape) == shapes
        return (np.shape(q), np.shape(v)) == shapes


def forward_dynamics(system: System) -> Callable:
    """Compiled function (q, v, load, out=None, t=0.0) → q̈.

    SimulationError if the system cannot be compiled, with the reasons.
    """
    if not system.n_v:
        return _last(system, system.loads)
    laws = Laws(system)
    plan = FUNCTIONS.plan(Question(system, laws))
    laws = Laws(system, trace=False) if plan.dynamics in BY_KERNELS else laws
    f = compiled(system, laws, plan)
    if plan.dynamics == "unilateral" or not laws.called:
        return f

    def calling(given):
        q, v, load, t = interface.split(given)
        return f(q, v, load + loads(State(t, q, v))[0], None, t)

    loads = LoadForces(system, laws.called)
    interface = Interface(_sizes(system), "t")
    return PythonWrapper(calling, interface, system.n_v, None, NAME, DOC)


def forward_dynamics_on_device(system: System, device) -> "DeviceFunction":
    """Function (q, v, load, t=0.0) → q̈ of batches on a device; rows that fail the check are repeated on this CPU.

    SimulationError if the system cannot be compiled as a whole, with the reasons.
    """
    from gauss.codegen.gpu.device_function import DeviceFunction, RowsOnDevice
    from gauss.codegen.gpu.devices import device_name

    laws, device = Laws(system), device_name(device)
    DEVICE_FUNCTIONS.plan(Question(system, laws))
    limits = (ACCELERATION_TOLERANCE, RESIDUAL_TOLERANCE, FINITE)
    interface = Interface(_sizes(system), "t", limits, ((system.n_v,),))

    def make() -> RowsOnDevice:
        trace = write(partial(refined_once, Program(system, laws)), *interface.sizes, 1, name=NAME)
        return RowsOnDevice(device, trace, interface)

    key = forward_dynamics_on_device, laws.key, device
    rows = cached_on_disk(system, key, make)
    return cached(system, (DeviceFunction, *key), lambda: DeviceFunction(rows, forward_dynamics(system), NAME))


def compiled(system: System, laws: Laws, plan: Plan) -> Callable:
    """Machine code of the dynamics under the traced loads.

    Results that fail the check are certified, or, above the compile threshold, refined to round-off by machine code; those
    of embedded loops are left to the general elimination first.
    """

    def make():
        interface = Interface(_sizes(system), "t", limits=(ACCELERATION_TOLERANCE, RESIDUAL_TOLERANCE, FINITE))
        last = _last(system, laws.traced)
        if plan.dynamics in BY_KERNELS:
            by_kernels = BY_KERNELS[plan.dynamics]
            entry = written(by_kernels, interface, lambda: by_kernels(system, laws.traced))
            rows = batched(by_kernels, interface, lambda: by_kernels(system, laws.traced))
            return fastcall(entry, interface, last, NAME, DOC, rows)
        program, sizes = Program(system, laws), (*interface.sizes, 1)
        once = embedded_once if plan.dynamics == "embedded loops" else refined_once

        def to_roundoff():
            strict = replace(interface, limits=(TOLERANCE, RESIDUAL_TOLERANCE, FINITE))
            entry = written(refined, strict, lambda: write(partial(refined, program), *sizes, name=NAME))
            return fastcall(entry, strict, last, NAME, DOC)

        def traced():
            return write(partial(once, program), *sizes, name=NAME)

        general = replace(plan, dynamics=plan.fallback)
        further = to_roundoff if once is refined_once else partial(compiled, system, laws, general)

        def single():
            from gauss.dynamics.chain_lanes import in_chain_lanes

            return in_chain_lanes(system, laws, once, sizes, NAME) or traced()

        entry, rows = written(once, interface, single), batched(once, interface, traced)
        return fastcall(entry, interface, TieredFunction(last, further), NAME, DOC, rows)

    def written(what: Callable, interface: Interface, trace: Callable[[], Function | NativeFunction]) -> EntryCode:
        return cached_on_disk(system, (entry_code, what, laws.key), lambda: entry_code(trace(), interface))

    def batched(what: Callable, interface: Interface, trace: Callable[[], Function | NativeFunction]) -> Callable:
        key = batch_code, what, laws.key
        return lambda: cached_on_disk(system, key, lambda: batch_code(trace(), interface)).entry()

    if plan.dynamics == "unilateral":
        return _unilateral(system, Laws(smooth_system(system), laws.trace))
    return cached(system, (compiled, plan.dynamics, laws.key), make)


def _unilateral(system: System, laws: Laws) -> Callable:
    """Machine code of accelerations with frictionless contacts."""
    loads = [bound for bound in system.loads if bound.load.name not in [other.load.name for other in laws.called]]
    make = lambda: unilateral_dynamics(system, laws, _last(system, loads), DOC)  # noqa: E731
    return cached(system, (unilateral_dynamics, laws.key), make)


def _last(system: System, loads) -> PythonWrapper:
    """The same function by the certified engine."""
    interface = Interface(_sizes(system), "t")

    def certified(given):
        q, v, load, t = interface.split(given)
        return _certified(system, State(t, q, v), load, loads)

    return PythonWrapper(certified, interface, system.n_v, None, NAME, DOC)


def _sizes(system: System) -> dict[str, int]:
    return {"q": system.n_q, "v": system.n_v, "load": system.n_v}


def _certified(system: System, state: State, load, loads=None) -> np.ndarray:
    checked = system.state(state.q, state.v, state.t)
    if has_joint_modes(system):
        return active_mode(system, checked, load).solution.qdd
    return CertifiedEngine().rates(system, checked, load, loads).acceleration
