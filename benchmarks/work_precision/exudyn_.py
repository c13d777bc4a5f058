"""Scenes in Exudyn: rigid bodies and joints as constraints, generalised-α."""

import exudyn as exu
import numpy as np
from exudyn.utilities import RigidBodyInertia

from benchmarks.work_precision.scenes import NotBuiltError
from gauss.dynamics.kinematics import kinematics
from gauss.scene import Drive, Spring
from gauss.system import System

GROUND = -1


class ExudynModel:
    """A system in Exudyn; body frames are principal and central.

    NotBuiltError if it has something that is not built here.
    """

    def __init__(self, system: System):
        if system.scene.couplings or system.relations.placed:
            raise NotBuiltError("relations and couplings are not built in Exudyn here")
        self.system, motion = system, kinematics(system, system.initial_state())
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        bodies = {GROUND: self.mbs.CreateGround()}
        velocities = np.array(motion.quasi_velocities(), dtype=float).reshape(-1, 2, 3)
        for i in range(system.structure.n_bodies):
            mass, moments = system.Phi[6 * i + 3], system.Phi[6 * i : 6 * i + 3]
            R, (omega, velocity) = np.array(motion.R[i], dtype=float), velocities[i]
            bodies[i] = self.mbs.CreateRigidBody(
                inertia=RigidBodyInertia(mass=mass, inertiaTensor=np.diag(moments)),
                nodeType=exu.NodeType.RotationRotationVector,
                referencePosition=np.array(motion.x[i], dtype=float),
                referenceRotationMatrix=R,
                initialVelocity=velocity,
                initialAngularVelocity=R @ omega,
                gravity=list(system.scene.gravity),
            )
        self.bodies = [bodies[i] for i in range(system.structure.n_bodies)]
        for joint in system.joints:
            self._join(joint, bodies, motion)
        for bound in system.loads:
            self._load(bound.load, bodies, motion)
        self.mbs.Assemble()

    def _join(self, joint, bodies, motion):
        """Constraint of a joint, at its point and along its axis in the world."""
        if joint.parent >= 0:
            R, x = np.array(motion.R[joint.parent], dtype=float), np.array(motion.x[joint.parent], dtype=float)
        else:
            R, x = np.eye(3), np.zeros(3)
        place = {"bodyNumbers": [bodies[joint.parent], bodies[joint.child]], "useGlobalFrame": True}
        at, axes = x + R @ joint.p_parent, R @ joint.R_parent
        kind = joint.pair.kind
        if kind == "revolute":
            self.mbs.CreateRevoluteJoint(position=at, axis=axes[:, 2], **place)
        elif kind == "prismatic":
            self.mbs.CreatePrismaticJoint(position=at, axis=axes[:, 2], **place)
        elif kind == "ball":
            self.mbs.CreateSphericalJoint(position=at, **place)
        elif kind == "fixed":
            self.mbs.CreateGenericJoint(position=at, constrainedAxes=[1] * 6, **place)
        elif kind != "free":
            raise NotBuiltError(f"pair {kind!r} is not built in Exudyn here")

    def _load(self, load, bodies, motion):
        scene, system = self.system.scene, self.system
        if isinstance(load, Spring):
            places, numbers = [], []
            for body, at in ((load.body, load.at), (load.other, load.other_at)):
                index = system.structure.bodies.index(body) if body != "ground" else GROUND
                numbers.append(bodies[index])
                if index == GROUND:
                    places.append(np.array(at, dtype=float))
                else:
                    R, x = np.array(motion.R[index], dtype=float), np.array(motion.x[index], dtype=float)
                    places.append(R.T @ (motion.position(body) + motion.rotation(body) @ np.array(at) - x))
            numbers = [
                bodies[system.structure.bodies.index(b) if b != "ground" else GROUND] for b in (load.body, load.other)
            ]
            self.mbs.CreateSpringDamper(
                bodyNumbers=numbers,
                localPosition0=places[0],
                localPosition1=places[1],
                referenceLength=load.length,
                stiffness=load.stiffness,
                damping=load.damping,
            )
        elif isinstance(load, Drive) and not callable(load.effort) and scene.joints[load.joint].parent == "ground":
            joint = system.joint(load.joint)
            torque = np.ravel(load.effort)[0] * joint.R_parent[:, 2]
            self.mbs.CreateTorque(bodyNumber=bodies[joint.child], loadVector=list(torque))
        else:
            raise NotBuiltError(f"load {load.name!r} is not built in Exudyn here")

    def centres(self, method: str, step: float, duration: float) -> np.ndarray:
        """Centres of mass (n, 3) at the end."""
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = round(duration / step)
        settings.timeIntegration.endTime = duration
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.8
        settings.linearSolverType = exu.LinearSolverType.EigenDense
        settings.linearSolverSettings.ignoreSingularJacobian = True  # planar loops have redundant spatial constraints
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.solutionWritePeriod = duration
        done = self.mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha, updateInitialValues=False)
        if not done:
            raise ArithmeticError("Exudyn: Newton's method did not converge")
        output = exu.OutputVariableType.Position
        return np.array([self.mbs.GetObjectOutputBody(body, output, [0, 0, 0]) for body in self.bodies])


METHODS = ("generalised-α",)
