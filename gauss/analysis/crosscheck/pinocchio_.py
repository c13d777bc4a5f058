"""Pinocchio model of a system, built joint by joint from its constant frames."""

from dataclasses import dataclass

import numpy as np

from gauss.analysis.crosscheck.pinocchio_joints import JointMap, backward, forward
from gauss.backends.structure import GROUND, Edge
from gauss.errors import extra
from gauss.system import PlacedJoint, State, System

with extra():
    import pinocchio as pin


@dataclass(frozen=True)
class BodyPlacement:
    """Placement of a body of gauss in Pinocchio: its joint, and its principal central frame in the frame of the joint."""

    joint: int
    central: pin.SE3


@dataclass(frozen=True)
class TreeJoint:
    """Joint of the tree: the joint in gauss, its index in Pinocchio, and the map from one to the other."""

    joint: PlacedJoint
    index: int
    map: JointMap


@dataclass(frozen=True)
class Configuration:
    """A state in the coordinates of Pinocchio: v_pin = T v, a_pin = T a + γ."""

    q: np.ndarray  # (nq,) configuration
    # (nv, n_v) rates of Pinocchio from rates of gauss; zero rows for fixed joints, zero columns for joints that close loops
    T: np.ndarray
    v: np.ndarray  # v, bias (nv,): rates and γ
    bias: np.ndarray


@dataclass(frozen=True)
class Twin:
    """A system and its Pinocchio model."""

    system: System  # the original
    model: pin.Model  # the spanning tree; fixed joints are hinges kept at zero, so that their reactions are reported
    reduced: pin.Model  # the same with the fixed joints locked, for the articulated-body algorithm
    tree_joints: tuple[TreeJoint, ...]  # joints of the tree, in the order of Pinocchio
    placements: dict[int, BodyPlacement]  # placement of every body, by index; −1 is the ground
    kept: tuple[int, ...]  # index in ``model`` of every joint of ``reduced``

    @property
    def kept_q(self) -> np.ndarray:
        """Entries of q that the reduced model has, too."""
        return _entries(self.model.idx_qs, self.model.nqs, self.kept)

    @property
    def kept_v(self) -> np.ndarray:
        """Entries of v that the reduced model has, too."""
        return _entries(self.model.idx_vs, self.model.nvs, self.kept)

    def configuration(self, state: State) -> Configuration:
        """State in the coordinates of Pinocchio."""
        model = self.model
        q, bias, T = np.zeros(model.nq), np.zeros(model.nv), np.zeros((model.nv, self.system.n_v))
        for tree_joint in self.tree_joints:
            joint, joint_map = tree_joint.joint, tree_joint.map
            here, rates = state.q[joint.q], state.v[joint.v]
            at_q, at_v = model.idx_qs[tree_joint.index], model.idx_vs[tree_joint.index]
            rows = slice(at_v, at_v + model.nvs[tree_joint.index])
            q[at_q : at_q + model.nqs[tree_joint.index]] = joint_map.configuration(here)
            T[rows, joint.v] = joint_map.T(here)
            bias[rows] = joint_map.bias(here, rates)
        return Configuration(q, T, T @ state.v, bias)

    def parent_side(self, joint: PlacedJoint) -> BodyPlacement:
        """Joint frame as it is fixed in the parent."""
        return self._side(joint.parent, joint.R_parent, joint.p_parent)

    def child_side(self, joint: PlacedJoint) -> BodyPlacement:
        """Joint frame as it is fixed in the child."""
        return self._side(joint.child, joint.R_child, joint.p_child)

    def _side(self, body: int, R: np.ndarray, p: np.ndarray) -> BodyPlacement:
        placement = self.placements[body]
        return BodyPlacement(placement.joint, placement.central * pin.SE3(R, p))


def twin(system: System) -> Twin:
    """Pinocchio model of a system; GaussError if Pinocchio has no counterpart of some joint."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array(system.scene.gravity), np.zeros(3))
    placements, tree_joints = {GROUND: BodyPlacement(0, pin.SE3.Identity())}, []
    for edge in _depth_first(system.structure.tree):
        tree_joint = _add_joint(model, placements, system.joints[edge.constraint], edge.outer)
        tree_joints.append(tree_joint)
        Phi = system.Phi[6 * edge.outer : 6 * edge.outer + 6]
        inertia = pin.Inertia(Phi[3], np.zeros(3), np.diag(Phi[:3]))
        model.appendBodyToJoint(tree_joint.index, inertia, placements[edge.outer].central)
    fixed = [tree_joint.index for tree_joint in tree_joints if tree_joint.joint.pair.n_v == 0]
    reduced = pin.buildReducedModel(model, fixed, pin.neutral(model))
    kept = tuple(i for i in range(model.njoints) if i not in set(fixed))
    return Twin(system, model, reduced, tuple(tree_joints), placements, kept)


def _add_joint(model: pin.Model, placements: dict, joint: PlacedJoint, outer: int) -> TreeJoint:
    frames = {joint.parent: pin.SE3(joint.R_parent, joint.p_parent), joint.child: pin.SE3(joint.R_child, joint.p_child)}
    inner = joint.parent if outer == joint.child else joint.child
    joint_map = forward(joint) if outer == joint.child else backward(joint)
    placement = placements[inner]
    # the number keeps the name apart from Pinocchio's own "universe"
    name = f"{model.njoints} {joint.name}"
    index = model.addJoint(placement.joint, joint_map.model, placement.central * frames[inner], name)
    model.addJointFrame(index)  # buildReducedModel reads it and crashes without (Pinocchio issue 2518)
    placements[outer] = BodyPlacement(index, frames[outer].inverse())
    return TreeJoint(joint, index, joint_map)


def _depth_first(tree: tuple[Edge, ...]) -> list[Edge]:
    """Edges with every subtree in one piece: crba is wrong for models whose joints come in another order."""
    outward: dict[int, list[Edge]] = {}
    for edge in tree:
        outward.setdefault(edge.inner, []).append(edge)
    order, waiting = [], outward.get(GROUND, [])[::-1]
    while waiting:
        edge = waiting.pop()
        order.append(edge)
        waiting += outward.get(edge.outer, [])[::-1]
    return order


def _entries(starts, sizes, joints) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=int), *(np.arange(starts[i], starts[i] + sizes[i]) for i in joints)])
