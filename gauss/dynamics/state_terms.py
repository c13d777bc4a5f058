"""Terms of the equations of motion in one state, over symbols: M(q), C(q, v), h(q, v), g(q), frames, Jacobians, momentum.

M by composite inertias, I_λ^c += X_iᵀ I_i^c X_i and M_ij = S_jᵀ X … I_i^c S_i (Featherstone, Rigid Body Dynamics
Algorithms, 2008, sec. 6.2); h by inverse dynamics at q̈ = 0; C by composite bodies (:mod:`gauss.dynamics.composite_bodies`).
Spatial vectors are (angular, linear). Where joints close loops, these are the terms of the spanning tree.
"""

from functools import cached_property

import numpy as np

from gauss import rotations
from gauss.codegen import Scalar, forward
from gauss.dynamics import energies
from gauss.dynamics.composite_bodies import CompositeBodies, composite_inertias, first_moments
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.link_frames import ground_share
from gauss.dynamics.mechanism import loop_constraints
from gauss.dynamics.rnea import KinematicTree, apply, force_to_inner
from gauss.rotations import cross
from gauss.system import PlacedFrame, State, System, coordinate_rates, whole

REFERENCES = ("local_world_aligned", "world", "local")


class StateTerms:
    """Terms of one system in one state; each is traced when it is first asked for.

    ``q``, ``v`` (n_q,), (n_v,): coordinates, symbols; rates, symbols or zeros.
    """

    def __init__(self, system: System, q, v, t: Scalar = 0.0):
        self.system, self.q, self.v, self.t = system, q, v, t

    @cached_property
    def tree(self) -> KinematicTree:
        """Spanning tree."""
        return KinematicTree(whole(self.system), self.q, self.v)

    @cached_property
    def still(self) -> KinematicTree:
        """Spanning tree at rest."""
        return KinematicTree(whole(self.system), self.q, np.zeros(self.system.n_v))

    @cached_property
    def composites(self) -> dict:
        """Inertia of each link with all links that it carries, in its link frame."""
        return composite_inertias(self.still)

    @property
    def mass_matrix(self) -> np.ndarray:
        """M (n_v, n_v)."""
        return self.tree_mass_matrix

    @property
    def coriolis_matrix(self) -> np.ndarray:
        """C (n_v, n_v) with Ṁ = C + Cᵀ."""
        return self.tree_coriolis_matrix

    @property
    def bias_forces(self) -> np.ndarray:
        """C v + g (n_v,)."""
        return self.tree_bias_forces

    @property
    def gravity_forces(self) -> np.ndarray:
        """Bias forces at rest (n_v,)."""
        return self.tree_gravity_forces

    @property
    def momentum_matrix(self) -> np.ndarray:
        """Centroidal momentum matrix (6, n_v)."""
        return self.tree_momentum_matrix

    @cached_property
    def tree_mass_matrix(self) -> np.ndarray:
        """M (n_v, n_v); zero rows and columns for joints that close loops."""
        tree, n = self.still, self.system.n_v
        M, to = np.zeros((n, n), dtype=object), {edge.outer: edge for edge in tree.edges}
        for edge in tree.edges:
            place = tree.subsystem.joints[edge.constraint].v
            S = tree.joint_kinematics[edge.outer].S
            for column, along in zip(range(place.start, place.stop), S.T, strict=True):
                force, here = apply(self.composites[edge.outer], along), edge
                while True:
                    rows = tree.subsystem.joints[here.constraint].v
                    M[rows, column] = M[column, rows] = tree.joint_kinematics[here.outer].S.T @ force
                    if here.inner < 0:
                        break
                    force = force_to_inner(tree.links[here.outer], tree.joint_kinematics[here.outer], force)
                    here = to[here.inner]
        return np.tril(M) + np.tril(M, -1).T

    @cached_property
    def tree_bias_forces(self) -> np.ndarray:
        """C v + g (n_v,)."""
        return self.tree.inverse_dynamics(np.zeros(self.system.n_v))

    @cached_property
    def tree_gravity_forces(self) -> np.ndarray:
        """Bias forces at rest (n_v,)."""
        return self.still.inverse_dynamics(np.zeros(self.system.n_v))

    @cached_property
    def tree_coriolis_matrix(self) -> np.ndarray:
        """C (n_v, n_v) with Ṁ = C + Cᵀ."""
        return CompositeBodies(self.tree, self.v, self.rate).coriolis_matrix()

    def frame_pose(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) to world and origin (3,) of a body frame or named frame."""
        placed = self.system.frame(frame)
        (R, p), (turn, offset) = self.still.poses[placed.body], self.in_link_frame(placed)
        return R @ turn, p + R @ offset

    def in_link_frame(self, placed: PlacedFrame) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and origin (3,) of a frame in the link frame of its body: constants."""
        link = self.still.links[placed.body]
        return rotations.clean(link.R_central.T @ placed.R), link.R_central.T @ (placed.p - link.p_central)

    def allowed_acceleration(self, acceleration) -> np.ndarray:
        """Accelerations (n_v,) of all joints that the constraints allow."""
        return acceleration

    @cached_property
    def loop_constraints(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual c (r,), Jacobian J (r, n_v) and bias γ (r,) of the loop constraints, J q̈ = γ."""
        return loop_constraints(self.system, self.q, self.v, self.t)

    def along(self, tau) -> np.ndarray:
        """Generalised forces along the coordinates of these terms, of such forces (n_v,) along all."""
        return tau

    def jacobian(self, frame: str, reference: str) -> np.ndarray:
        """Jacobian J (6, n_v): angular and linear velocity of a frame, J v; see ``REFERENCES``."""
        R, point = self.frame_pose(frame)
        return self._jacobian(self.system.frame(frame).body, R, np.zeros(3) if reference == "world" else point, reference)

    def jacobian_of(self, body: int, point) -> np.ndarray:
        """Jacobian J (6, n_v) of a body at a point of the world, in world axes."""
        return self._jacobian(body, np.eye(3), point, "local_world_aligned")

    @cached_property
    def velocities(self) -> dict[int, np.ndarray]:
        """Velocity (6,) of every link, in its frame."""
        return self.tree.carried(self.v)

    @cached_property
    def biases(self) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link where the accelerations of all joints are zero, in its frame."""
        return self.tree.biases()

    def _jacobian(self, body: int, R, point, reference: str) -> np.ndarray:
        tree, J = self.still, np.zeros((6, self.system.n_v), dtype=object)
        to = {edge.outer: edge for edge in tree.edges}
        turn = R.T if reference == "local" else np.eye(3)
        while body >= 0:
            place, (R_link, origin) = tree.subsystem.joints[to[body].constraint].v, tree.poses[body]
            S = tree.joint_kinematics[body].S
            for column, along in zip(range(place.start, place.stop), S.T, strict=True):
                angular = R_link @ along[:3]
                linear = R_link @ along[3:] + cross(angular, point - origin)
                J[:, column] = np.concatenate([turn @ angular, turn @ linear])
            body = to[body].inner
        return J

    def jacobian_rate(self, frame: str, reference: str) -> np.ndarray:
        """Time derivative of the Jacobian (6, n_v) at rates v."""
        return self.rate(self.jacobian(frame, reference))

    def rate(self, terms) -> np.ndarray:
        """Time derivative of functions of the coordinates at rates v."""
        return forward(terms, self.q, coordinate_rates(self.system, self.q, self.v))

    @cached_property
    def centers(self) -> dict[int, np.ndarray]:
        """Centre of mass (3,) of each body in world."""
        tree = self.still
        local = {body: -link.R_central.T @ link.p_central for body, link in tree.links.items()}
        return {body: p + R @ local[body] for body, (R, p) in tree.poses.items() if body >= 0}

    @cached_property
    def mass_shares(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Share of all mass, an origin (3,) and the first moments of the share about it (3,), over all mass, in world.

        Those of what the ground carries at each of its joints, and of what is regrouped to the ground.
        """
        tree, total, moments = self.still, self.system.Phi[3::6].sum(), first_moments(self.still)
        mass, first = ground_share(tree.subsystem, tree.links)
        found = [(mass / total, np.zeros(3), first / total)]
        for body in (edge.outer for edge in tree.edges if edge.inner < 0):
            (R, p), (mass, first) = tree.poses[body], moments[body]
            found.append((mass / total, p, R @ (first / total)))
        return found

    @cached_property
    def center_of_mass(self) -> np.ndarray:
        """Centre of mass of all bodies (3,) in world."""
        return sum((share * p + first for share, p, first in self.mass_shares), np.zeros(3))

    def from_center_of_mass(self, point) -> np.ndarray:
        """Vector (3,) from the centre of mass to a point; exact where the point is the origin of a share."""
        return sum((share * (point - p) - first for share, p, first in self.mass_shares), np.zeros(3))

    @cached_property
    def tree_momentum_matrix(self) -> np.ndarray:
        """Centroidal momentum matrix (6, n_v): moment of momentum about the centre of mass, and momentum, world axes."""
        tree, A = self.still, np.zeros((6, self.system.n_v), dtype=object)
        for edge in tree.edges:
            place, (R, p) = tree.subsystem.joints[edge.constraint].v, tree.poses[edge.outer]
            S, lever = tree.joint_kinematics[edge.outer].S, p - self.center_of_mass
            for column, along in zip(range(place.start, place.stop), S.T, strict=True):
                moment, force = np.split(apply(self.composites[edge.outer], along), 2)
                force = R @ force
                A[:, column] = np.concatenate([R @ moment + cross(lever, force), force])
        return A

    @cached_property
    def momentum(self) -> np.ndarray:
        """Moment of momentum about the centre of mass, and momentum (6,), world axes."""
        tree, carried, total = self.still, self.still.carried(self.v), np.zeros(6)
        own = {body: apply(tree.links[body].inertia, carried[body]) for body in tree.joint_kinematics}
        gathered = tree.gathered(own)
        for edge in (edge for edge in tree.edges if edge.inner < 0):
            R, p = tree.poses[edge.outer]
            force = R @ gathered[edge.outer][3:]
            moment = R @ gathered[edge.outer][:3] + cross(self.from_center_of_mass(p), force)
            total = total + np.concatenate([moment, force])
        return total

    @cached_property
    def kinetic_energy(self) -> Scalar:
        """½ vᵀ M v."""
        return self.tree.kinetic_energy(self.v)

    @cached_property
    def potential_energy(self) -> Scalar:
        """Potential energy of gravity and springs."""
        tree, bodies, state = (
            self.still,
            range(self.system.structure.n_bodies),
            State(self.t, self.q, np.zeros(self.system.n_v)),
        )
        R = [tree.poses[body][0] @ tree.links[body].R_central.T for body in bodies]
        none = [np.zeros(3)] * len(bodies)
        x = [self.centers[body] for body in bodies]
        return energies.potential_energy(Kinematics.of_bodies(self.system, state, R, x, none, none))
