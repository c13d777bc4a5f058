"""Pinocchio's constraint dynamics of a mechanism in one state: joints that close loops as contacts, and its derivatives.

Hinges and balls are contacts of points: in planar loops the other rows of a hinge are redundant.
"""

import numpy as np
import pinocchio as pin

from gauss.analysis.crosscheck.pinocchio_ import Configuration, Twin

CONTACTS = {
    "fixed": pin.ContactType.CONTACT_6D,
    "ball": pin.ContactType.CONTACT_3D,
    "revolute": pin.ContactType.CONTACT_3D,
}
PROXIMAL = (1e-12, 1e-8, 10)  # absolute accuracy, μ, iterations


class LoopContacts:
    """Constraint dynamics of a mechanism in one state without loads.

    Parameters
    ----------
    pair : Twin
        The mechanism in Pinocchio, its loops cut.
    at : Configuration
        The state there.
    """

    def __init__(self, pair: Twin, at: Configuration):
        self.model, self.data, self.at = pair.model, pair.model.createData(), at
        self.load = np.zeros(self.model.nv)
        self.contacts, self.states = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for joint in (pair.system.joints[index] for index in pair.system.structure.closures):
            one, other = pair.parent_side(joint), pair.child_side(joint)
            sides = one.joint, one.central, other.joint, other.central
            kind = CONTACTS[joint.pair.kind]
            self.contacts.append(pin.RigidConstraintModel(kind, self.model, *sides, pin.ReferenceFrame.LOCAL))
            self.states.append(self.contacts[-1].createData())
        pin.initConstraintDynamics(self.model, self.data, self.contacts, self.states)
        self.settings = pin.ProximalSettings(*PROXIMAL)

    def dynamics(self) -> np.ndarray:
        """Accelerations."""
        at, given = self.at, (self.load, self.contacts, self.states, self.settings)
        return pin.constraintDynamics(self.model, self.data, at.q, at.v, *given)

    def derivatives(self):
        """Accelerations, and their derivatives."""
        self.dynamics()
        pin.computeConstraintDynamicsDerivatives(self.model, self.data, self.contacts, self.states, self.settings)
