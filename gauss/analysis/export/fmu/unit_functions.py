"""The functions of a unit: rates and outputs of a state under inputs, and its projection onto the constraints.

Both are functions of the parameters of the unit as well, which follow the inputs in one vector u.
"""

import numpy as np

from gauss.analysis.export.exported_function import ExportedFunction, Shape, without_calls
from gauss.analysis.export.fmu.unit_parameters import UnitParameters
from gauss.codegen import Function, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.outputs import FORCES
from gauss.dynamics.plan import EXPORTS
from gauss.dynamics.rules import Question
from gauss.dynamics.sensor_values import measured
from gauss.errors import SimulationError
from gauss.system import State, coordinate_rates, refuse_changed


def unit_functions(tuned: UnitParameters) -> list[ExportedFunction]:
    """Functions "rates", (q, v, u, t) → (rate, output), and "project", (q, v, u, t) → state.

    SimulationError if an element, or an output of forces, has no smooth function, by its name.
    """
    system = tuned.pattern
    name = system.scene.name
    if not system.n_v:
        raise SimulationError(f"scene {name!r} cannot be exported: nothing in it can move.")
    refuse_changed(system)
    forces = [output.name for output in system.scene.outputs.values() if output.kind in FORCES]
    if forces:
        raise SimulationError(f"scene {name!r} cannot be exported: outputs of forces, {', '.join(map(repr, forces))}.")
    EXPORTS.plan(Question(system, Laws(system)))
    return [_rates(tuned), _projection(tuned)]


def _rates(tuned: UnitParameters) -> ExportedFunction:
    system, scene = tuned.system, tuned.pattern.scene
    own = system.loads if tuned.symbols else Laws(system).traced
    loads, n_x = [*own, *input_loads(system)], system.n_q + system.n_v
    sizes = sum(output.size(scene) for output in scene.outputs.values())

    def rates(q, v, t):
        acceleration = LoadedMechanism(system, loads, t, q, v, np.zeros(system.n_v)).accelerations(tuned.pattern)
        motion = kinematics(system, State(t, q, v))
        outputs = [np.ravel(measured(one, motion, acceleration)) for one in scene.outputs.values()]
        return np.concatenate([coordinate_rates(system, q, v), acceleration, *outputs])

    return _exported(tuned, "rates", rates, {"rate": (n_x,), "output": (sizes,)})


def _projection(tuned: UnitParameters) -> ExportedFunction:
    system, step = tuned.system, MotionStep(tuned.pattern, "rk4")
    step.system, step.pattern = system, tuned.pattern  # its projection is that of the numbers that stay open

    def project(q, v, t):
        q = np.array(q, dtype=object)
        for place in system.quaternions.values():
            q[place] = q[place] / sum(x * x for x in q[place]) ** 0.5
        return np.concatenate(step.projected(State(t, q, v)) if system.closes else [q, v])

    return _exported(tuned, "project", project, {"state": (system.n_q + system.n_v,)})


def _exported(tuned: UnitParameters, name: str, function, shapes: dict[str, Shape]) -> ExportedFunction:
    """Function (q, v, u, t) of a function (q, v, t) with parameters of traced code."""
    pattern = tuned.pattern
    inputs = tuple(pattern.scene.inputs)

    def traced(q, v, t):
        for one in (*inputs, *tuned.symbols):  # in this order, whether the results depend on them or not
            t[0].graph.parameter(one)
        return function(q, v, t[0])

    found = write(traced, pattern.n_q, pattern.n_v, 1, name=name)
    places = np.cumsum([pattern.n_q + pattern.n_v, 1, len(inputs)])
    state, (t,), u, symbols = np.split(np.array(found.inputs, dtype=object), places)
    whole = without_calls(Function(name, [*state, *u, *symbols, t], found.outputs))
    sizes: dict[str, Shape] = {"q": (pattern.n_q,), "v": (pattern.n_v,), "u": (u.size + len(tuned.values),), "t": ()}
    if tuned.symbols:
        outer = lambda q, v, u, p, t: whole.inlined(q, v, u, tuned.of(p), t)  # noqa: E731
        whole = write(outer, pattern.n_q, pattern.n_v, u.size, len(tuned.values), 1, name=name)
    return ExportedFunction(name, whole, sizes, shapes)
