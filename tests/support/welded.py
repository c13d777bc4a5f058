"""Pinocchio's constraint dynamics of the same mechanism, every loop closed by a weld."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

import gauss
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.scene import GROUND, Joint

PROXIMAL = (1e-15, 1e-8, 200)  # absolute accuracy, μ, iterations: tight, so that its own error is rounding


def split(scene, system):
    """The scene with a loop cut inside a body: its parts, of equal shares of its mass, are welded together.

    Every joint stays a joint of the tree, so a weld, which is the only constraint of six rows that Pinocchio knows, closes
    the loop without changing the mechanics.
    """
    closing = [system.joints[i].name for i in system.structure.closures]
    parts = {body: [body] for body in scene.bodies}
    joints = {}
    for name, joint in scene.joints.items():
        if name in closing:
            side = "parent" if joint.child == GROUND else "child"
            body = getattr(joint, side)
            copy = f"{body} at {name}"
            parts[body].append(copy)
            joint = replace(joint, **{side: copy})
        joints[name] = joint
    bodies = {}
    for body, names in parts.items():
        whole = scene.bodies[body]
        for name in names:
            share = tuple(x / len(names) for x in np.ravel(whole.inertia))
            bodies[name] = replace(whole, name=name, mass=whole.mass / len(names), inertia=share)
    welds = {f"weld of {c}": Joint(f"weld of {c}", "fixed", b, c) for b, names in parts.items() for c in names[1:]}
    return replace(scene, bodies=bodies, joints=joints | welds)


class Welded:
    """Mechanism with loops for Pinocchio, joints added depth-first, no Baumgarte terms.

    Parameters
    ----------
    scene : Scene
        A scene with loops, and no loads.
    """

    def __init__(self, scene):
        self.system = gauss.compile_scene(scene)
        self.opened = gauss.compile_scene(split(scene, self.system))
        assert self.opened.coordinates == self.system.coordinates
        self.twin = twin(self.opened)
        self.welds, self.datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for joint in (self.opened.joints[i] for i in self.opened.structure.closures):
            one, two = self.twin.parent_side(joint), self.twin.child_side(joint)
            weld = (pin.ContactType.CONTACT_6D, self.twin.model, one.joint, one.central, two.joint, two.central)
            self.welds.append(pin.RigidConstraintModel(*weld, pin.ReferenceFrame.LOCAL))
        for weld in self.welds:
            self.datas.append(weld.createData())
        self.settings = pin.ProximalSettings(*PROXIMAL)

    def at(self, state):
        """State in Pinocchio's coordinates."""
        return self.twin.configuration(self.opened.state(state.q, state.v))

    def dynamics(self, state) -> tuple[pin.Data, np.ndarray]:
        """Data of constraintDynamics in a state without loads, and the accelerations of the joints."""
        at, model, data = self.at(state), self.twin.model, self.twin.model.createData()
        pin.initConstraintDynamics(model, data, self.welds, self.datas)
        a = pin.constraintDynamics(model, data, at.q, at.v, np.zeros(model.nv), self.welds, self.datas, self.settings)
        return data, np.linalg.lstsq(at.T, a - at.bias, rcond=None)[0]

    def derivatives(self, state) -> list[np.ndarray]:
        """∂q̈/∂(q, v, load) in the rates of gauss, for joints without a bias; off the loops as Pinocchio chooses."""
        data, _ = self.dynamics(state)
        pin.computeConstraintDynamicsDerivatives(self.twin.model, data, self.welds, self.datas, self.settings)
        T = self.at(state).T
        back = np.linalg.inv(T)
        return [back @ data.ddq_dq @ T, back @ data.ddq_dv @ T, back @ data.ddq_dtau @ back.T]
