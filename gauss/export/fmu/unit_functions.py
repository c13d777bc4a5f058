"""The functions of a unit: rates and outputs of a state under inputs, and its projection onto the constraints."""

import numpy as np

from gauss.codegen import Function, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.outputs import FORCES, measured
from gauss.dynamics.plan import EXPORTS
from gauss.dynamics.rules import Question
from gauss.errors import SimulationError
from gauss.export.exported_function import ExportedFunction, Shape, without_calls
from gauss.system import State, System, coordinate_rates, refuse_changed


def unit_functions(system: System) -> list[ExportedFunction]:
    """Functions "rates", (q, v, u, t) → (rate, output), and "project", (q, v, t) → state.

    Raises
    ------
    SimulationError
        If an element, or an output of forces, has no smooth function, by its name.
    """
    name = system.scene.name
    if not system.n_v:
        raise SimulationError(f"scene {name!r} cannot be exported: nothing in it can move.")
    refuse_changed(system)
    forces = [output.name for output in system.scene.outputs.values() if output.kind in FORCES]
    if forces:
        raise SimulationError(f"scene {name!r} cannot be exported: outputs of forces, {', '.join(map(repr, forces))}.")
    EXPORTS.plan(Question(system, Laws(system)))
    return [_rates(system), _projection(system)]


def _rates(system: System) -> ExportedFunction:
    given, n_x = tuple(system.scene.inputs), system.n_q + system.n_v
    loads = [*Laws(system).traced, *input_loads(system)]
    sizes = sum(output.size(system.scene) for output in system.scene.outputs.values())

    def rates(q, v, t):
        for one in given:  # in the order of the scene, whether the rates depend on them or not
            t[0].graph.parameter(one)
        acceleration = LoadedMechanism(system, loads, t[0], q, v, np.zeros(system.n_v)).motion()[0]
        motion = kinematics(system, State(t[0], q, v))
        outputs = [np.ravel(measured(one, motion, acceleration)) for one in system.scene.outputs.values()]
        return np.concatenate([coordinate_rates(system, q, v), acceleration, *outputs])

    found = write(rates, system.n_q, system.n_v, 1, name="rates")
    state, (t, *u) = np.split(np.array(found.inputs, dtype=object), [-1 - len(given)])
    inputs = {"q": (system.n_q,), "v": (system.n_v,), "u": (len(given),), "t": ()}
    function = without_calls(Function("rates", [*state, *u, t], found.outputs))
    return ExportedFunction("rates", function, inputs, {"rate": (n_x,), "output": (sizes,)})


def _projection(system: System) -> ExportedFunction:
    step = MotionStep(system, "rk4")

    def project(q, v, t):
        q = np.array(q, dtype=object)
        for place in system.quaternions.values():
            q[place] = q[place] / sum(x * x for x in q[place]) ** 0.5
        return np.concatenate(step.projected(State(t[0], q, v)) if system.closes else [q, v])

    found = write(project, system.n_q, system.n_v, 1, name="project")
    inputs: dict[str, Shape] = {"q": (system.n_q,), "v": (system.n_v,), "t": ()}
    shapes: dict[str, Shape] = {"state": (system.n_q + system.n_v,)}
    return ExportedFunction("project", without_calls(Function("project", found.inputs, found.outputs)), inputs, shapes)
