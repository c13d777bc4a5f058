"""Functions of a state as machine code: one table of terms, one compiled wrapper for one state and for batches (n, …).

Several functions asked for at once are traced in one graph, where equal operations are computed once.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Function, Interface, PythonWrapper, batch_code, entry_code, fastcall, write
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.constraint_leak import LARGEST_LEAK, REFUSED_LEAK, constraint_leak, may_leak
from gauss.dynamics.inertial_regressor import STANDARD
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales, loop_residual
from gauss.dynamics.mobility import mobility_at_start
from gauss.dynamics.null_space_dynamics import null_space_terms
from gauss.dynamics.parameter_terms import size_of
from gauss.dynamics.projection import fixed_columns
from gauss.dynamics.rigid_loops import is_in_other_pose, refuse_other_pose
from gauss.dynamics.state_terms import REFERENCES, StateTerms
from gauss.dynamics.store import cached, cached_on_disk
from gauss.dynamics.term_table import TERMS, Term, traced_loads
from gauss.dynamics.traced_system import FINITE, absolute_sum, off_unit
from gauss.errors import ArgumentError, StateError, did_you_mean
from gauss.system import State, System, refuse_changed, whole

DOC = """Terms of one state, or of a batch (n, …) of states, in machine code.

Parameters
----------
q, v, acceleration, load : array_like, shape (…, n_q), (…, n_v), (…, n_v), (…, n_v)
    Coordinates (quaternions of unit length), rates, accelerations of all joints, generalised forces added to the loads of
    the scene; those that the function takes.
out : ndarray, optional
    Array of doubles for the result, a tuple of arrays for several.
t : float or array_like
    Time [s].

Raises
------
StateError
    If an argument does not fit.
"""
LARGEST_RATIO = 1e8  # of a rate to an independent one, in units of the scene: beyond, that one does not determine it
NULL_SPACE_RESIDUAL = 1e-6  # K N, relative to the scales of the rows: where rates are not determined it is of order one
LINEAR = ("coriolis_matrix", "jacobian_rate", "momentum")  # in the rates: finite where these are
ARGUMENTS = "q", "v", "acceleration", "load"  # in this order


class Request(NamedTuple):
    """A term that is asked for."""

    name: str  # name of the function
    frame: str = ""  # name of its frame or parameter
    reference: str = ""  # its axes


def state_function(
    system: System, names: Sequence[str], reference: str = REFERENCES[0], independent=None, device=None
) -> Callable:
    """Compiled function of a state, or of several at once; see :meth:`gauss.System.function`.

    ArgumentError if there is no such function, or it is called with options that it does not have.
    StateError if there is no such frame or joint, or coordinates cannot be independent.
    SimulationError if the law of a load cannot be compiled.
    """
    requests, columns = _requested(system, names, reference, independent)
    laws = traced_loads(system).key if any(TERMS[one.name].has_loads for one in requests) else ""
    key = state_function, requests, columns, laws
    make = lambda: compiled(system, _function(system, requests, columns), columns, key)  # noqa: E731
    if device is None:
        return cached(system, key, make)
    from gauss.codegen.gpu.devices import device_name  # on demand: most systems stay on this CPU

    device = device_name(device)
    return cached(system, (*key, device), lambda: _on_device(system, requests, columns, key, device))


def traced_function(system: System, names: Sequence[str]) -> tuple[Function, Interface]:
    """Trace of a function of a state, or of several at once, with its arguments and the shapes of its results.

    The last outputs of the trace are error measures, one for each limit of the interface.

    ArgumentError, StateError, SimulationError as of :func:`state_function`.
    """
    found = _function(system, *_requested(system, names, REFERENCES[0], None))
    return found.trace(), found.interface


def _requested(system: System, names: Sequence[str], reference: str, independent):
    """Requests for names, and the places of independent coordinates if these are given."""
    if reference not in REFERENCES:
        raise ArgumentError(f"reference: no axes {reference!r}. {did_you_mean(reference, REFERENCES)}")
    requests = tuple(_request(system, name, reference) for name in names)
    if not requests:
        raise ArgumentError(f"function: expected names of functions. {did_you_mean('', TERMS)}")
    columns = None if independent is None else _columns(system, independent)
    if columns is None and "null_space" in names:
        raise ArgumentError("null_space: expected the names of independent joints, independent=(…).")
    if columns is not None or "loop_constraints" in names:
        refuse_changed(system)
    return requests, columns


def evaluate(system: System, names, given: dict, t, reference: str, independent) -> dict:
    """Results of several functions of a state, by their names; see :meth:`gauss.System.evaluate`.

    StateError if an argument is missing or does not fit.
    """
    names = (names,) if isinstance(names, str) else tuple(names)
    function = state_function(system, names, reference, independent)
    terms = [TERMS[name.partition(":")[0]] for name in names]
    needed = _arguments(terms)
    for name in needed:
        if given[name] is None:
            raise StateError(f"evaluate: {', '.join(names)}: expected {name} as well.")
    found = function(*(given[name] for name in needed), None, t)
    parts = iter(found if sum(len(term.shapes) for term in terms) > 1 else (found,))
    results = [[next(parts) for _ in term.shapes] for term in terms]
    return {name: own[0] if len(own) == 1 else tuple(own) for name, own in zip(names, results, strict=True)}


def _arguments(terms) -> list[str]:
    """Names of the vectors that terms take."""
    letters = {letter for term in terms for letter in term.arguments}
    return [name for name in ARGUMENTS if name[0] in letters]


def _request(system: System, name: str, reference: str) -> Request:
    """Request for a name such as "jacobian:hand"."""
    own, _, frame = name.partition(":") if isinstance(name, str) else (name, "", "")
    if own == "forward_dynamics":
        raise ArgumentError(
            "forward_dynamics: compiled alone, for all coordinates; call system.forward_dynamics(q, v, load) beside other "
            "functions, and take the independent accelerations of its result."
        )
    if own not in TERMS:
        raise ArgumentError(f"no function {own!r} of a state. {did_you_mean(str(own), TERMS)}")
    term = TERMS[own]
    if (term.of_frame or term.of_parameter) != bool(frame):
        words = "a frame, as in '{}:name'" if term.of_frame else "a parameter, as in '{}:mass:body'"
        words = f"takes no frame, got {frame!r}" if frame else f"expected the name of {words.format(own)}"
        raise ArgumentError(f"{own}: {words}.")
    if term.of_parameter:
        size_of(system, frame)  # raises
    elif frame:
        system.frame(frame)  # raises
    return Request(own, frame, reference if term.has_reference else "")


def _columns(system: System, independent) -> tuple[int, ...]:
    """Places of independent coordinates in v."""
    names = (independent,) if isinstance(independent, str) else tuple(independent)
    columns = fixed_columns(system, names)
    freedoms = mobility_at_start(system).nearby
    if len(columns) != freedoms or len(set(columns)) != freedoms:
        raise StateError(
            f"independent: expected {freedoms} different coordinates, one for each degree of freedom, "
            f"of {', '.join(system.coordinates)}; got {', '.join(map(repr, names)) or 'none'}."
        )
    return tuple(columns)


class TracedFunction(NamedTuple):
    """Function of a state before it is compiled."""

    trace: Callable[[], Function]  # () → its trace, whose last outputs are the error measures of :func:`error_measures`
    interface: Interface  # its arguments and results
    name: str  # its name in messages
    # (state, arguments by name) → its results where elimination leaves few digits; None where it is not by elimination
    by_null_space: Callable[[State, dict], Sequence[np.ndarray]] | None = None


def _function(system: System, requests, columns) -> TracedFunction:
    """Traced function of requests, and its interface in Python."""
    names = _arguments([TERMS[one.name] for one in requests])
    sizes = {name: system.n_q if name == "q" else system.n_v for name in names}
    of_loops = any(TERMS[one.name].of_loops for one in requests)
    leaks = (of_loops or columns is not None) and may_leak(system)
    largest = LARGEST_LEAK if columns is None else REFUSED_LEAK
    limits = (*error_limits(columns), *((largest,) if leaks else ()))
    interface = Interface(sizes, "t", limits, _shapes(system, requests, columns))

    def values(*given):
        arguments = dict(zip(names, given[:-1], strict=True))
        q, v, (t,) = arguments["q"], arguments.get("v", np.zeros(system.n_v)), given[-1]
        terms = StateTerms(system, q, v, t) if columns is None else ConstrainedTerms(system, q, v, t, columns)
        found = [_traced(TERMS[one.name], terms, one, arguments) for one in requests]
        parts = [result if isinstance(result, tuple) else (result,) for result in found]
        residual, total, *others = error_measures(terms, given, of_loops or columns is not None)
        others += [constraint_leak(system, Mechanism(system, q, v, t))] if leaks else []
        overflow = np.abs(sum(_overflow(one.name, own, v) for one, own in zip(requests, parts, strict=True)))  # −∞, too
        return *(part for own in parts for part in own), [residual, total + overflow, *others]

    name = ", ".join(":".join(filter(None, one[:2])) for one in requests)
    by_null_space = partial(null_space_terms, system, requests) if leaks and columns is None else None
    return TracedFunction(lambda: write(values, *interface.sizes, 1, name="state"), interface, name, by_null_space)


def _on_device(system: System, requests, columns, key, device: str) -> Callable:
    """Function of requests over rows on a device; its reasons to refuse a row are those of the function on this CPU."""
    from gauss.codegen.gpu.device_function import DeviceFunction, RowsOnDevice

    function = _function(system, requests, columns)
    make = lambda: RowsOnDevice(device, function.trace(), function.interface)  # noqa: E731
    rows = cached_on_disk(system, (RowsOnDevice, *key, device), make)
    own = cached(system, key, lambda: compiled(system, function, columns, key))
    return DeviceFunction(rows, own, function.name)


def compiled(system: System, function: TracedFunction, columns, key: tuple) -> Callable:
    """Machine code of a function of a state, with the checks of its arguments.

    ``columns``: places of its independent coordinates in v, None where
    none are chosen. ``key``: what tells it from other functions of the system in the cache.
    """
    trace, interface, name, by_null_space = function
    sizes, limits = interface.vectors, interface.limits
    entry = cached_on_disk(system, (entry_code, *key), lambda: entry_code(trace(), interface))
    batch = lambda: cached_on_disk(system, (batch_code, *key), lambda: batch_code(trace(), interface)).entry()  # noqa: E731

    def normalised(given):
        q, *others, t = interface.split(given)
        state = system.state(q, others[0] if "v" in sizes else None, t)
        if not all(np.isfinite(part).all() for part in (*others, t)):
            raise StateError(f"{name}: expected finite numbers, got {others[-1] if others else ''} at t = {t}.")
        if not np.array_equal(state.q, q):
            found = run(state.q, *others, None, t)
        elif by_null_space is None or is_in_other_pose(system, state.q):
            raise StateError(refused_state(system, state, name, columns))
        else:
            found = tuple(by_null_space(state, dict(zip(sizes, (q, *others), strict=True))))
            if not all(np.isfinite(part).all() for part in found):
                raise StateError(refused_state(system, state, name, columns))
        return np.concatenate([np.ravel(part) for part in (found if isinstance(found, tuple) else (found,))])

    outputs = entry.outputs - len(limits)
    last = PythonWrapper(normalised, replace(interface, limits=()), outputs, None, name, DOC)
    run = fastcall(entry, interface, last, name, DOC, batch)
    return run


def _traced(term: Term, terms: StateTerms, one: Request, arguments: dict):
    """Results of a term over symbols."""
    return term.trace(terms, one, arguments.get("load" if "l" in term.arguments else "acceleration"))


def _shapes(system: System, requests, columns) -> tuple[tuple[int, ...], ...]:
    """Shapes of the results of requests."""
    sizes = {"V": system.n_v, "v": system.n_v if columns is None else len(columns), "r": whole(system).n_loop_constraints}
    sizes["i"] = len(STANDARD) * system.structure.n_bodies
    shapes = [(one, shape) for one in requests for shape in TERMS[one.name].shapes]

    def length(one: Request, letter: str) -> int:
        return size_of(system, one.frame) if letter == "p" else sizes[letter] if letter in sizes else int(letter)

    return tuple(tuple(length(one, letter) for letter in shape) for one, shape in shapes)


def _overflow(name: str, results: tuple, v: np.ndarray):
    """Sum that is finite only if results of rates are: of vectors, and of squares of the rates, with which matrices grow."""
    if "v" not in TERMS[name].arguments or name in LINEAR:
        return 0.0
    vectors = [np.ravel(part).sum() for part in results if np.ndim(part) < 2]
    return sum(vectors) + ((v * v).sum() if len(vectors) < len(results) else 0.0)


def error_limits(columns) -> tuple[float, ...]:
    """Limits of :func:`error_measures` for independent coordinates at these places, None where none are chosen."""
    return (RESIDUAL_TOLERANCE, FINITE, *(() if columns is None else (LARGEST_RATIO, NULL_SPACE_RESIDUAL)))


def error_measures(terms: StateTerms, given, of_loops: bool) -> list:
    """Residual of the state, a sum of all inputs that is finite only if each is, sizes of N and of K N.

    A sum is NaN if one of its terms is. Without independent coordinates the state need not meet the constraints: its
    residual is that of the quaternions. It is infinite where results are ``of_loops``, and one that cannot move has another
    pose than in the scene.
    """
    system, unit = terms.system, terms.system.scale.coordinates
    residual, total = off_unit(system, terms.q), absolute_sum(*given)
    if of_loops and system.rigid_joints:
        residual = residual + math.where(is_in_other_pose(system, terms.q), np.inf, 0.0)
    if not isinstance(terms, ConstrainedTerms):
        return [residual, total]
    rows = loop_residual(system, terms.q, terms.t)[0]
    residual = residual + np.abs(rows / loop_constraint_scales(system)).sum()
    N = terms.null_space * unit[terms.independent]
    moved = [terms.mechanism.moving(column).velocity() / loop_constraint_scales(system) for column in N.T]
    return [residual, total, np.abs(N / unit[:, None]).sum(), np.abs(moved).sum()]


def distance_of_loops(system: System, state: State) -> float:
    """Residual of the loop constraints, in shares of their scales."""
    return float(np.abs(loop_residual(system, state.q, state.t)[0] / loop_constraint_scales(system)).sum())


def refused_state(system: System, state: State, name: str, columns) -> str:
    """Why a state with unit quaternions and finite numbers is refused.

    StateError if a loop that cannot move has another pose than in the scene.
    """
    if distance_of_loops(system, state) <= RESIDUAL_TOLERANCE:
        refuse_other_pose(system, state.q)
    if columns is None:
        return f"{name}: no finite result in this state."
    rows = distance_of_loops(system, state)
    if rows > RESIDUAL_TOLERANCE:
        return (
            f"{name}: q does not meet the constraints, by {rows:.3g} of their scales; system.initial_state or "
            "system.projected make a state that does."
        )
    names = ", ".join(system.coordinates[k] for k in columns)
    if may_leak(system):
        return (
            f"{name}: bodies of one loop differ so much in mass or inertia that too few digits are left in this state, or "
            f"{names} do not determine the other rates; give the lightest bodies more, or take gauss.linearise."
        )
    return f"{name}: {names} do not determine the other rates in this state; take other independent coordinates."
