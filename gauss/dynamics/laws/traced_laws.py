"""Laws of loads in compiled dynamics: traced laws become machine code, opaque ones are Python callbacks."""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import replace
from functools import partial
from hashlib import sha256

import numpy as np

from gauss.codegen import Expression, Function, Graph, branches, content_key, numbers_of
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.store import cached
from gauss.scene import Input
from gauss.scene.stateful_laws import preserved
from gauss.scene.values import arguments, as_function, is_scalar
from gauss.system import BoundLoad, State, System, retract

PROBES = np.array([0.0, 0.0123, 0.137, 0.731, 1.93, 6.11, 23.7, 317.0])  # times of comparison, in the time of the scene
SAME_VALUE = 1e-6  # relative: traced functions may have other round-off
PROBE_ROUNDOFF = 1e-12  # of the values at all probes, relative to the largest: poses at the end of a chain sum up round-off
TRIAL_DISTANCE = 0.3  # distance of another state from the reference, in units of the coordinates
UNTRACEABLE = ("TypeError: ", "TracerError: ")
Probe = Callable[[State], Kinematics]  # kinematics of a state at which laws are compared


class Laws:
    """Loads of a system: those with traced laws, and those with opaque ones.

    A law that returns numbers when it is traced does not depend on its arguments, or hides how: it is opaque.

    ``trace``: False: all laws are opaque.

    Attributes: ``traced``, ``called``: loads with traced laws, which become machine code, and loads with opaque laws.
    ``reasons``: why the law of a load is opaque, {name of the load: reason}. ``key``: key of the set of traced laws, those
    of inputs included: a law may have changed since it was traced. ``motion``: the system in symbols, where there are laws.
    ``functions``: traced laws over these symbols, each with the name of its load. ``of_smooth``: laws of the system without
    unilateral and set-valued elements, once they are asked for.
    """

    def __init__(self, system: System, trace: bool = True):
        self.system, self.trace = system, trace
        self.traced: list[BoundLoad] = []
        self.called: list[BoundLoad] = []
        self.reasons: dict[str, str] = {}
        key = ""
        self.functions: list[tuple[str, Function]] = []
        self.motion: Kinematics | None = None
        self.of_smooth: Laws | None = None
        self.probed: dict[tuple[float, bytes, bytes], Kinematics] = {}
        for number, bound in enumerate(system.loads):
            found = [self._traced(law) for law in bound.functions]
            functions = [function for function in found if isinstance(function, Function)]
            if len(functions) == len(found):
                self.traced.append(bound)
                key += "".join(f"load {number}: {_digest(system, function)}; " for function in functions)
                self.functions += [(bound.load.name, function) for function in functions]
            else:
                self.called.append(bound)
                self.reasons[bound.load.name] = next(reason for reason in found if isinstance(reason, str))
        self.probed.clear()
        self.key = _with_inputs(key, system)

    def _traced(self, law) -> Function | str:
        """Traced law, or the reason why it is opaque."""
        if not self.trace:
            return "it may change"
        if self.motion is None:
            self.motion = symbols(self.system)
        return _confirmed(law, traced_law(law, self.motion), self.motion, self._probe)

    def _probe(self, state: State) -> Kinematics:
        """Kinematics of a state at which laws are probed, the same for all of them."""
        key = float(state.t), state.q.tobytes(), state.v.tobytes()
        if key not in self.probed:
            self.probed[key] = kinematics(self.system, state)
        return self.probed[key]

    def fails(self, name: str) -> bool:
        """Whether a law of a load with opaque laws fails with symbols, so that it uses its arguments."""
        return any(reason in self.reasons[name] for reason in UNTRACEABLE)

    @property
    def outputs(self) -> list[Expression]:
        """Results of the traced laws, in one graph."""
        return [entry for _, function in self.functions for entry in function.outputs if isinstance(entry, Expression)]


def present_laws(system: System) -> Laws:
    """Loads of a system: traced anew, for their functions may have changed; cached where they have none."""
    return cached(system, (Laws,), lambda: Laws(system)) if system.is_plain else Laws(system)


def _with_inputs(key: str, system: System) -> Hashable:
    """Key with the content of the laws of inputs, where they have some, and with their operations when they are traced.

    The content of a law does not hold all that it looks up: an attribute of a class or of a module may have changed.
    """
    given = [one for one in system.scene.inputs.values() if not one.is_plain]
    return (key, *((content_key(one), *_operations(one, system)) for one in given)) if given else key


def _operations(given: Input, system: System) -> Iterator[str]:
    """Digests of the laws of an input, traced with a symbol for its value; why one cannot be traced."""
    forces = [part for force in given.forces for part in (force.force, force.moment) if callable(part)]
    for law in (*([] if given.effort is None else [given.effort]), *forces):
        motion = symbols(system)
        value = motion.state.t.graph.parameter("value of an input")
        try:
            with preserved(law):
                traced = _in_symbols(partial(law, value) if law is given.effort else law, motion)
        except Exception as error:  # a law may fail with symbols in any way
            yield f"{type(error).__name__}: {error}"
        else:
            yield _digest(system, Function("law", [], traced))


def needs_poses(load) -> bool:
    """Whether a law of a load takes the kinematics, and may depend on poses of bodies."""
    return any(arguments(law) > 1 for law in BoundLoad(load).functions)


def symbols(system: System) -> Kinematics:
    """Kinematics in symbols, cached: laws are traced for every motion, kinematics once."""
    made = lambda: _symbolic(system)  # noqa: E731
    return cached(system, (_symbolic,), made)


def _symbolic(system: System) -> Kinematics:
    graph = Graph()
    q, v = graph.symbols("q", system.n_q), graph.symbols("v", system.n_v)
    return kinematics(system, State(graph.symbol("t"), q, v))


def traced_law(law, motion: Kinematics) -> Function | str:
    """Law as a function of symbols, or why it cannot be one."""
    try:
        with preserved(law) as kept:
            values = _in_symbols(law, motion)
    except Exception as error:  # a law may fail with symbols in any way, and not with numbers
        return f"{type(error).__name__}: {error}"
    if kept.changed:
        return "it keeps something from one call for the next"
    if not all(map(is_scalar, values)):
        return "it returns something else than numbers"
    if not any(isinstance(value, Expression) for value in values):
        return "it returns the same numbers whatever it is given"
    return Function("law", [], values)


def _in_symbols(law, motion: Kinematics) -> list:
    """Values of a law of the time and the motion for symbols."""
    return list(np.ravel(branches(lambda: as_function(law)(motion.state.t, motion))))


def _confirmed(law, traced: Function | str, motion: Kinematics, probe: Probe) -> Function | str:
    """Traced law, if it agrees with the law itself; a law that depends on the type of its argument does not."""
    if isinstance(traced, str):
        return traced
    system, make = motion.system, lambda: _agrees(law, traced, motion, probe)
    same = cached(system, (_agrees, _digest(system, traced)), make)
    return traced if same else "called with numbers it gives others than those that were traced"


def _digest(system: System, traced: Function) -> str:
    """Digest of the operations of a traced law: laws are traced for every motion, but their nodes are those of one graph."""
    ends = tuple(x.index if isinstance(x, Expression) else repr(float(x)) for x in traced.outputs)
    return cached(system, (_digest, ends), lambda: sha256(traced.text().encode()).hexdigest())


def _agrees(law, traced: Function, motion: Kinematics, probe: Probe) -> bool:
    """Whether a law and its trace agree at the probe times; times at which the law fails do not count.

    A law of poses is also compared at another state: where it vanishes at the reference, only round-off could be compared.
    """
    system, pairs = motion.system, []
    states = [replace(system.reference, t=float(t)) for t in PROBES * system.scale.time]
    if arguments(law) > 1:
        step = TRIAL_DISTANCE * system.scale.coordinates * np.random.default_rng(0).uniform(-1.0, 1.0, system.n_v)
        q, v = retract(system, system.reference.q, step), step / system.scale.time
        states.append(replace(states[1], q=q, v=v))
    try:
        numbers = numbers_of(traced.outputs, [motion.state.t, *motion.state.q, *motion.state.v])
    except TypeError:  # calls are not compared
        return True
    for state in states:
        try:
            pairs.append(_values(law, numbers, state, probe))
        except Exception:  # the motion reports failures
            continue
    if any(np.shape(called) != np.shape(found) for called, found in pairs):
        return False
    sizes = [max(np.abs(called).max(initial=0.0), np.abs(found).max(initial=0.0)) for called, found in pairs]
    floor = PROBE_ROUNDOFF * max(filter(np.isfinite, sizes), default=0.0)
    return not any(
        (np.abs(called - found) > SAME_VALUE * size + floor).any()
        for (called, found), size in zip(pairs, sizes, strict=True)
    )


def _values(law, numbers: Callable, state: State, probe: Probe) -> tuple[np.ndarray, np.ndarray]:
    """Values of a law at a state, and those of its trace."""
    with preserved(law):
        here = probe(state) if arguments(law) > 1 else None
        called = np.ravel(np.asarray(as_function(law)(state.t, here), dtype=float))
    return called, numbers([state.t, *state.q.tolist(), *state.v.tolist()])
