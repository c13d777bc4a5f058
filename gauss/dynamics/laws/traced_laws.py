"""Laws of loads in compiled dynamics: those that can be written down are, the others are called."""

import numpy as np

from gauss.codegen import Expression, Function, Graph, branches, substitute
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.stateful_laws import preserved
from gauss.scene.values import arguments, as_function, is_scalar
from gauss.system import State, System

PROBES = np.array([0.0, 0.0123, 0.137, 0.731, 1.93, 6.11, 23.7, 317.0])  # in the time of the scene: when laws are compared
AGREEMENT = 1e-6  # relative: functions of a law may be rounded in other ways when they are traced
FIELDS = ("effort", "force", "moment")  # where a load keeps laws


class Laws:
    """Loads of a system, told apart by whether their laws can be traced.

    A law that returns plain numbers when it is traced does not depend on what it is given, or hides how: it is called.

    Parameters
    ----------
    system : System
        What the loads act on.
    trace : bool
        False: no law is traced, all are called.

    Attributes
    ----------
    traced, called : list of BoundLoad
        Loads that become part of the machine code, and loads whose laws are called as Python functions.
    reasons : dict
        Why the law of a load is called, {name of the load: reason}.
    key : str
        Tells one set of traced laws from another: a law may have changed since it was traced.
    motion : Kinematics or None
        The system in symbols, where there are laws.
    functions : list of (str, Function)
        Traced laws over these symbols, each with the name of its load.
    """

    def __init__(self, system: System, trace: bool = True):
        self.system, self.trace = system, trace
        self.traced, self.called, self.reasons, self.key = [], [], {}, ""
        self.functions: list[tuple[str, Function]] = []
        motion = None
        for number, bound in enumerate(system.loads):
            laws = [law for law in (getattr(bound.load, field, None) for field in FIELDS) if callable(law)]
            motion = motion or (symbols(system) if laws and trace else None)
            found = [_confirmed(law, traced_law(law, motion), motion) if trace else "it may change" for law in laws]
            reason = next((outcome for outcome in found if isinstance(outcome, str)), None)
            if reason is None:
                self.traced.append(bound)
                self.key += "".join(f"load {number}: {outcome.text()}; " for outcome in found)
                self.functions += [(bound.load.name, function) for function in found]
            else:
                self.called.append(bound)
                self.reasons[bound.load.name] = reason
        self.motion = motion

    @property
    def outputs(self) -> list[Expression]:
        """What the traced laws give, in one graph."""
        return [entry for _, function in self.functions for entry in function.outputs if isinstance(entry, Expression)]


def asks_where(load) -> bool:
    """Whether a law of a load is called with the motion, so that it may ask where bodies are."""
    laws = [law for law in (getattr(load, field, None) for field in FIELDS) if callable(law)]
    return any(arguments(law) > 1 for law in laws)


def symbols(system: System) -> Kinematics:
    """Motion in symbols, kept from run to run: laws are traced anew each time, where bodies are is not."""
    made = lambda: _symbolic(system)  # noqa: E731
    return made() if system.dynamics is None else system.dynamics.on_demand((_symbolic,), made)


def _symbolic(system: System) -> Kinematics:
    graph = Graph()
    q, v = graph.symbols("q", system.n_q), graph.symbols("v", system.n_v)
    return kinematics(system, State(graph.symbol("t"), q, v))


def traced_law(law, motion: Kinematics) -> Function | str:
    """Law as a function of symbols, or why it cannot be one."""
    try:
        with preserved(law) as kept:
            values = list(np.ravel(branches(lambda: as_function(law)(motion.state.t, motion))))
    except Exception as error:  # a law may fail in any way when it is given symbols; called with numbers it may not
        return f"{type(error).__name__}: {error}"
    if kept.changed:
        return "it keeps something from one call for the next"
    if not all(map(is_scalar, values)):
        return "it returns something else than numbers"
    if not any(isinstance(value, Expression) for value in values):
        return "it returns the same numbers whatever it is given"
    return Function("law", [], values)


def _confirmed(law, traced: Function | str, motion: Kinematics) -> Function | str:
    """Traced law, unless it gives other numbers than the law itself, as one does that asks for the type of its argument."""
    if isinstance(traced, str):
        return traced
    system, make = motion.system, lambda: _agrees(law, traced, motion)
    same = make() if system.dynamics is None else system.dynamics.on_demand((_agrees, traced.text()), make)
    return traced if same else "called with numbers it gives others than those that were traced"


def _agrees(law, traced: Function, motion: Kinematics) -> bool:
    """Whether a law gives at some instants what was traced; instants at which it fails do not count."""
    system, state = motion.system, motion.system.reference
    symbols = [motion.state.t, *motion.state.q, *motion.state.v]
    for t in PROBES * system.scale.time:
        try:
            with preserved(law):
                here = kinematics(system, State(float(t), state.q, state.v)) if arguments(law) > 1 else None
                called = np.ravel(np.asarray(as_function(law)(float(t), here), dtype=float))
            folded = substitute(traced.outputs, symbols, [float(t), *state.q, *state.v])
            found = np.array([one.value if isinstance(one, Expression) else one for one in folded], dtype=float)
        except Exception:  # a law may fail in any way; where it matters, the motion says so
            continue
        size = max(np.abs(called).max(initial=0.0), np.abs(found).max(initial=0.0))
        if np.shape(called) != np.shape(found) or (np.abs(called - found) > AGREEMENT * size).any():
            return False
    return True
