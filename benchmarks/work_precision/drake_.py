"""Trees in Drake: a MultibodyPlant in continuous time, built body by body, and its integrators with error control."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    LinearSpringDamper,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)
from pydrake.symbolic import Variable
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import SymbolicVectorSystem

from benchmarks.work_precision.scenes import NotBuiltError
from gauss.dynamics.kinematics import kinematics
from gauss.scene import Drive, Spring
from gauss.system import System

PAIRS = ("revolute", "prismatic", "ball", "fixed")
Z = np.array([0.0, 0.0, 1.0])


class DrakeModel:
    """A system in Drake; body frames are principal and central.

    NotBuiltError if it is no tree, or has something that is not built here.
    """

    def __init__(self, system: System):
        if system.has_closures:
            raise NotBuiltError("Drake has no constraints in continuous time")
        self.system, self.motion = system, kinematics(system, system.initial_state())
        builder = DiagramBuilder()
        self.plant = plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
        plant.mutable_gravity_field().set_gravity_vector(np.array(system.scene.gravity, dtype=float))
        self.bodies = {-1: plant.world_body()}
        for i, name in enumerate(system.structure.bodies):
            mass, inertia = system.Phi[6 * i + 3], RotationalInertia(*system.Phi[6 * i : 6 * i + 3])
            given = SpatialInertia.MakeFromCentralInertia(mass, np.zeros(3), inertia)
            self.bodies[i] = plant.AddRigidBody(name, given)
        joints = [(joint, self._join(joint)) for joint in system.joints]
        drives = [bound.load for bound in system.loads if not isinstance(bound.load, Spring)]
        for bound in system.loads:
            if isinstance(bound.load, Spring):
                self._stretch(bound.load)
        driven = [plant.AddJointActuator(load.name, self._driven(load, joints)) for load in drives]
        plant.Finalize()
        if driven:
            self._follow(builder, drives)
        self.diagram = builder.Build()
        self.start = self.diagram.CreateDefaultContext()
        for joint, twin in joints:
            self._place(joint, twin, plant.GetMyMutableContextFromRoot(self.start))

    def _join(self, joint):
        """Joint of Drake, whose axis is the third of its frames, as in gauss."""
        if joint.pair.kind not in PAIRS:
            raise NotBuiltError(f"pair {joint.pair.kind!r} is not built in Drake here")
        sides = (joint.parent, joint.R_parent, joint.p_parent), (joint.child, joint.R_child, joint.p_child)
        frames = [
            self.plant.AddFrame(FixedOffsetFrame(f"{joint.name} on {i}", self.bodies[i].body_frame(), _pose(R, p)))
            for i, R, p in sides
        ]
        made = {
            "revolute": lambda: RevoluteJoint(joint.name, *frames, Z),
            "prismatic": lambda: PrismaticJoint(joint.name, *frames, Z),
            "ball": lambda: BallRpyJoint(joint.name, *frames),
            "fixed": lambda: WeldJoint(joint.name, *frames, RigidTransform()),
        }
        return self.plant.AddJoint(made[joint.pair.kind]())

    def _place(self, joint, twin, context):
        """Joint where gauss has it at the start, and as fast."""
        state, kind = self.system.initial_state(), joint.pair.kind
        if kind == "revolute":
            twin.set_angle(context, state.q[joint.q][0])
            twin.set_angular_rate(context, state.v[joint.v][0])
        elif kind == "prismatic":
            twin.set_translation(context, state.q[joint.q][0])
            twin.set_translation_rate(context, state.v[joint.v][0])
        elif kind == "ball":
            (R, omega), (R_child, omega_child) = self._turning(joint.parent), self._turning(joint.child)
            frame = R @ joint.R_parent
            relative = RotationMatrix.ProjectToRotationMatrix(frame.T @ R_child @ joint.R_child)
            twin.set_angles(context, RollPitchYaw(relative).vector())
            twin.set_angular_velocity(context, frame.T @ (omega_child - omega))

    def _turning(self, body: int):
        """Rotation matrix of a body, and its angular velocity in the world."""
        if body < 0:
            return np.eye(3), np.zeros(3)
        R = np.array(self.motion.R[body], dtype=float)
        return R, R @ np.array(self.motion.quasi_velocities(), dtype=float).reshape(-1, 2, 3)[body, 0]

    def _stretch(self, load: Spring):
        ends = []
        for name, at in ((load.body, load.at), (load.other, load.other_at)):
            i = self.system.structure.bodies.index(name) if name != "ground" else -1
            point = np.array(at, dtype=float)
            if i >= 0:
                R, x = np.array(self.motion.R[i], dtype=float), np.array(self.motion.x[i], dtype=float)
                point = R.T @ (self.motion.position(name) + self.motion.rotation(name) @ point - x)
            ends += [self.bodies[i], point]
        self.plant.AddForceElement(LinearSpringDamper(*ends, load.length, load.stiffness, load.damping))

    def _driven(self, load, joints):
        if not isinstance(load, Drive) or load.limit is not None or self.system.joint(load.joint).pair.n_v != 1:
            raise NotBuiltError(f"load {load.name!r} is not built in Drake here")
        return next(twin for joint, twin in joints if joint.name == load.joint)

    def _follow(self, builder, drives):
        """Efforts of drives as expressions of time and state, evaluated by Drake."""
        plant, t = self.plant, Variable("t")
        state = [Variable(name) for name in plant.GetStateNames()]
        told = _Told(plant, state)
        with np.errstate(invalid="ignore"):  # of expressions NumPy sees no numbers
            efforts = [load.effort(t, told) if callable(load.effort) else np.ravel(load.effort)[0] for load in drives]
        none = {"state": [Variable("none")], "dynamics": [0.0]}  # without a state Drake stops the process
        law = builder.AddSystem(SymbolicVectorSystem(time=t, input=state, output=efforts, **none))
        builder.Connect(plant.get_state_output_port(), law.get_input_port())
        builder.Connect(law.get_output_port(), plant.get_actuation_input_port())

    def centres(self, method: str, accuracy: float, duration: float) -> np.ndarray:
        """Centres of mass (n, 3) at the end."""
        simulator = Simulator(self.diagram, self.start.Clone())
        ResetIntegratorFromFlags(simulator, method, duration / 10)
        integrator = simulator.get_mutable_integrator()
        integrator.set_fixed_step_mode(False)
        integrator.request_initial_step_size_target(duration / 1000)  # runge_kutta5 hangs after a first step far too large
        integrator.set_target_accuracy(accuracy)
        simulator.AdvanceTo(duration)
        context = self.plant.GetMyContextFromRoot(simulator.get_context())
        bodies = (self.bodies[i] for i in range(self.system.structure.n_bodies))
        return np.array([self.plant.EvalBodyPoseInWorld(context, body).translation() for body in bodies])


class _Told:
    """What a law asks of a motion, in variables of Drake."""

    def __init__(self, plant, state):
        self.plant, self.state = plant, state

    def coordinate(self, joint: str):
        """Coordinate of a joint of one freedom."""
        return self.state[self.plant.GetJointByName(joint).position_start()]

    def rate(self, joint: str):
        """Rate of a joint of one freedom."""
        return self.state[self.plant.num_positions() + self.plant.GetJointByName(joint).velocity_start()]


def _pose(R, p) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(np.array(R, dtype=float)), np.array(p, dtype=float))
