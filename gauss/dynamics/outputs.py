"""Outputs of a scene in one state, in machine code: values of sensors, and forces of joints and contacts."""

import numpy as np

from gauss.codegen import Function, write
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.sample_multipliers import are_unique, multipliers_of, sample_multipliers
from gauss.dynamics.sensor_values import INERTIAL, measured
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.scene import Output, Scene
from gauss.system import System, sides

OF_JOINTS = {"joint_moment": slice(0, 3), "joint_force": slice(3, 6)}  # rows of a joint, with the forces −λ
FORCES = (*OF_JOINTS, "contact_force")


def shape_of(output: Output, system: System) -> tuple[int, ...]:
    """Shape of the values of an output; () for a number."""
    size = output.size(system.scene)
    return (3, 3) if output.kind == "rotation" else () if size == 1 else (size,)


def split(vector: np.ndarray, scene: Scene) -> dict[str, np.ndarray]:
    """Outputs (…, m) by name in a vector (…, n) of the values of all outputs."""
    found, place = {}, 0
    for name, output in scene.outputs.items():
        size = output.size(scene)
        found[name], place = vector[..., place : place + size], place + size
    return found


def output_function(program: Program, scene: Scene, of_step: bool = False) -> Function:
    """Function of a point → values of all outputs.

    SimulationError if forces of an output are not unique, or not known in this motion.

    ``program``: the system, with inputs where the scene has some. ``of_step``: whether the accelerations are those that the
    point holds, of a step of contacts, instead of those of its state.
    """
    outputs = tuple(scene.outputs.values())
    asked = not of_step and any(output.kind in INERTIAL for output in outputs)
    joints, gaps = program.system.structure.constraints, [side.name for side in sides(scene)]
    loaded = any(output.kind in OF_JOINTS for output in outputs)
    for output in outputs:
        _refuse_unknown(output, program, of_step)

    def value(output: Output, motion: Kinematics, acceleration, multipliers, contacts):
        if output.kind in OF_JOINTS:
            rows = next(constraint.rows for constraint in joints if constraint.name == output.of)
            return -multipliers[rows][OF_JOINTS[output.kind]]
        if output.kind == "contact_force":
            return contacts[[gaps.index(side) for side in scene.contacts[output.of].sides(scene)]]
        return measured(output, motion, acceleration)

    def values(x):
        point = program.layout.point(x)
        rates = program.evaluate(point.state) if asked else point.rates
        state, motion = point.state, kinematics(program.system, point.state)
        known = multipliers_of(program.system, program.loads, state.q, state.v, [state.t])[0] if loaded else ()
        return tuple(value(output, motion, rates.acceleration, known, point.method_state) for output in outputs)

    return write(values, program.layout.size, name="outputs")


def _refuse_unknown(output: Output, program: Program, of_step: bool):
    """Raise a SimulationError for forces that are not unique, or that a motion of this kind does not know."""
    if output.kind in OF_JOINTS:
        if of_step:
            raise SimulationError(f"output {output.name!r}: beside contacts, forces of joints come from gauss.reactions.")
        if program.laws.called:
            raise SimulationError(f"output {output.name!r}: beside opaque laws, forces of joints come from gauss.reactions.")
        if not are_unique(program.system):
            raise SimulationError(f"output {output.name!r}: redundant constraints leave the force of {output.of!r} open.")
    elif output.kind == "contact_force" and not of_step:
        raise SimulationError(f"output {output.name!r}: steps of integrator='time_stepping' alone know forces of contacts.")


def joint_forces(output: Output, system: System, t, q, v) -> np.ndarray:
    """Values (k, 3) of an output that is a force or moment of a joint, at k states.

    SimulationError if they are not certain.
    """
    found = sample_multipliers(system, t, q, v)
    if found is None or not found[1].all():
        raise SimulationError(f"output {output.name!r}: the forces of {output.of!r} are not certain; use gauss.reactions.")
    rows = next(constraint.rows for constraint in system.structure.constraints if constraint.name == output.of)
    return -found[0][:, rows][:, OF_JOINTS[output.kind]]
