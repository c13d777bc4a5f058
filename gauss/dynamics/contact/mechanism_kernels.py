"""Machine code of a system without its contacts, for a step with contacts: poses and Jacobians of bodies, M, τ − h, stops.

    M v̇ + h = τ + Kᵀ f,   K = J_first − J_second from points and normals of the contacts

The mass matrix is that of the spanning tree by composite inertias, τ − h follows from the recursive Newton–Euler algorithm
(Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 5.3 and 6.2), both of :mod:`gauss.dynamics.state_terms`. Rates of
bodies at q̈ = 0 are the biases of their accelerations. Stops, ropes and dry friction of joints are rows of the same step.
"""

from collections.abc import Callable
from copy import copy
from typing import NamedTuple

import numpy as np

from gauss.codegen import CallingKernel, Kernel, as_number, forward, jacobian, write
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_forces import LoadForces, generalised_forces
from gauss.dynamics.load_receiver import LoadReceiver, received
from gauss.dynamics.loads import Applied
from gauss.dynamics.loop_joints import LoopJoint
from gauss.dynamics.mechanism import loop_constraints
from gauss.dynamics.programs import called_loads
from gauss.dynamics.state_terms import StateTerms
from gauss.dynamics.store import cached_on_disk
from gauss.rotations import cross
from gauss.scene import ClosedGap, Contact, LinearCoupling
from gauss.system import State, System, coordinate_rates, retract, sides
from gauss.system.relations import place_residuals

GROUND_BODY = np.concatenate([np.eye(3).ravel(), np.zeros(15)])
BODY = 24  # rotation (9), centre (3), angular velocity, velocity of the centre (6), rates of both where q̈ = 0 (6)


class SparseArrays:
    """Arrays of traced entries, of which constants are kept apart and the others are outputs of a kernel.

    Parameters
    ----------
    arrays : sequence of ndarray
        Numbers and expressions.

    Attributes
    ----------
    outputs : list of Expression
        Entries that are no constants.
    """

    def __init__(self, arrays):
        entries = np.concatenate([np.ravel(np.asarray(array, dtype=object)) for array in arrays])
        numbers = [as_number(entry) for entry in entries]
        self.flat = np.array([0.0 if number is None else number for number in numbers])
        self.entries = np.array([k for k, number in enumerate(numbers) if number is None], dtype=int)
        self.outputs = [entries[k] for k in self.entries]
        ends = np.cumsum([np.size(array) for array in arrays]).tolist()
        shapes = [np.shape(array) for array in arrays]
        self.parts = [(slice(a, b), shape) for a, b, shape in zip([0, *ends], ends, shapes, strict=False)]

    def __getstate__(self) -> dict:
        return {name: vars(self)[name] for name in ("flat", "entries", "parts")}

    def chosen(self, rows: list[np.ndarray | None]) -> "SparseArrays":
        """The same outputs in arrays of some rows alone; None for all of them. The others go to an entry of their own.

        Parameters
        ----------
        rows : list of ndarray of int, or None
            Rows of each array.
        """
        numbers = [np.arange(part.start, part.stop).reshape(shape) for part, shape in self.parts]
        kept = [one if which is None else one[which] for one, which in zip(numbers, rows, strict=True)]
        old = np.concatenate([one.ravel() for one in kept])
        place = np.full(self.flat.size, old.size)
        place[old] = np.arange(old.size)
        made, ends = copy(self), np.cumsum([one.size for one in kept]).tolist()
        made.flat, made.entries = np.append(self.flat[old], 0.0), place[self.entries]
        shapes = [one.shape for one in kept]
        made.parts = [(slice(a, b), shape) for a, b, shape in zip([0, *ends], ends, shapes, strict=False)]
        return made

    def filled(self, values: np.ndarray) -> list[np.ndarray]:
        """Arrays with the values of the outputs."""
        flat = self.flat.copy()
        flat[self.entries] = values
        return [flat[part].reshape(shape) for part, shape in self.parts]


class MechanismTerms(NamedTuple):
    """Terms of one state."""

    M: np.ndarray  # (n_v, n_v) mass matrix
    tau: np.ndarray  # (n_v,) generalised forces less the bias forces, τ − h
    power: np.ndarray  # (3,) of drives, of forces on bodies, and of dissipation [W]
    bodies: np.ndarray  # (24, k + 1) poses, velocities, their rates with q̈ = 0 of bodies that carry shapes; the ground last
    J: np.ndarray  # (k + 1, 6, n_v) their Jacobians, (angular velocity, velocity of the centre of mass) in world axes
    gap: np.ndarray  # (g,) gap functions of unilateral constraints that are no contacts of shapes
    rate: np.ndarray  # (r,) rates of these and of set-valued elements
    K: np.ndarray  # (r, n_v) their Jacobian
    bias: np.ndarray  # (r,) their derivatives with q̈ = 0
    G: np.ndarray  # G (l, n_v), gamma (l,): loop constraints G q̈ = γ
    gamma: np.ndarray
    B: np.ndarray  # (n_v, n_v) rates v = B v of all joints by those of the spanning tree
    beta: np.ndarray  # (n_v,) accelerations of the others where those of the tree are zero


class TracedMechanism:
    """Terms of one system, traced.

    Parameters
    ----------
    system : System
        The system, with its contacts.
    smooth : System
        The same without unilateral and set-valued elements.
    carriers : tuple of int
        Bodies that carry shapes.
    inputs : bool
        Whether the inputs of the scene are the last arguments of forces; otherwise they are zero.
    """

    def __init__(self, system: System, smooth: System, carriers: tuple[int, ...], inputs: bool = False):
        self.system, self.smooth, self.carriers = system, smooth, carriers
        self.laws = Laws(smooth)
        self.called = called_loads(smooth) if self.laws.called else None
        self.loads = [*self.laws.traced, *(input_loads(smooth) if inputs else ())]
        self.inputs = tuple(smooth.scene.inputs) if inputs else ()

    def terms_at(self, t, q, v) -> MechanismTerms:
        """Terms of a state in symbols."""
        terms = StateTerms(self.smooth, q, v, t)
        parts = [*(_body(terms, body) for body in self.carriers), GROUND_BODY]
        bodies = np.array(parts, dtype=object).reshape(len(parts), BODY).T
        J = [terms.jacobian_of(body, terms.centers[body]) for body in self.carriers] + [np.zeros((6, self.smooth.n_v))]
        tau, power = self._load_forces(terms, t, q, v)
        gap, rate, K, bias = self._rows(t, q, v)
        return MechanismTerms(
            terms.tree_mass_matrix,
            tau - terms.tree_bias_forces,
            np.array(power, dtype=object),
            bodies,
            np.array(J, dtype=object).reshape(len(J), 6, self.smooth.n_v),
            gap,
            rate,
            K,
            bias,
            *self._loops(t, q, v),
            *self._dependent(terms),
        )

    def order_inputs(self, t):
        """Let the inputs of the scene be the last ones of a function that is traced, in the order of the scene."""
        for name in self.inputs:
            t[0].graph.parameter(name)

    def forces_at(self, t, q, v):
        """Generalised forces less the bias forces, and power, of a state in symbols."""
        self.order_inputs(t)
        terms = StateTerms(self.smooth, q, v, t[0])
        tau, power = self._load_forces(terms, t[0], q, v)
        return tau - terms.tree_bias_forces, power

    def _load_forces(self, terms: StateTerms, t, q, v):
        """Generalised forces and power of the loads."""
        motion = Kinematics(self.smooth, State(t, q, v))
        applied = Applied(motion, self.loads)
        forces, power = generalised_forces(motion, applied), np.array([applied.driven, applied.loaded, applied.dissipated])
        if self.called is None:
            return forces, power
        found = self.called([t], q, v)
        return forces + found[: self.smooth.n_v], power + found[self.smooth.n_v :]

    def _rows(self, t, q, v):
        """Gap functions, rates, Jacobian and biases of stops, ropes and set-valued elements."""
        scene, n_v = self.system.scene, self.smooth.n_v
        gaps = other_gaps(self.system)
        elements = [*gaps, *scene.set_valued.values()]
        if not elements:
            return np.zeros(0), np.zeros(0), np.zeros((0, n_v)), np.zeros(0)
        values = place_residuals(self.system, elements).values(Kinematics(self.system, State(t, q, v)))
        gap, rate = values[: len(gaps)], values[len(gaps) :]
        bias = forward(rate, [t, *q], [1.0, *coordinate_rates(self.system, q, v)])
        return gap, rate, jacobian(rate, v), bias

    def _loops(self, t, q, v):
        """Jacobian and bias of loop joints, couplings and relations; none where coordinates are made independent."""
        if is_coupled_tree(self.smooth):
            return np.zeros((0, self.smooth.n_v)), np.zeros(0)
        return loop_constraints(self.smooth, q, v, t)[1:]

    def _dependent(self, terms: StateTerms):
        """Rates of loop joints by those of the tree."""
        n_v, in_tree = self.smooth.n_v, {edge.constraint for edge in self.smooth.structure.tree}
        B, beta = np.eye(n_v, dtype=object), np.zeros(n_v, dtype=object)
        for index in sorted(set(range(len(self.smooth.joints))) - in_tree):
            loop_joint, place = LoopJoint(terms.tree, index, terms.q, terms.v), self.smooth.joints[index].v
            B[place] = jacobian(loop_joint.rates(terms.velocities, still=True), terms.v)
            beta[place] = loop_joint.rates(terms.biases, still=False)
        return B, beta


class MechanismKernels:
    """Machine code of one system; parameters as of :class:`TracedMechanism`."""

    receiver = None  # machine code calls no opaque laws

    def __init__(self, system: System, smooth: System, carriers: tuple[int, ...], inputs: bool = False):
        traced, n_q, n_v = TracedMechanism(system, smooth, carriers, inputs), smooth.n_q, smooth.n_v
        kind = CallingKernel if traced.laws.called else Kernel

        def begin(t, q, v):
            traced.order_inputs(t)
            self.layout = SparseArrays(traced.terms_at(t[0], q, v))
            return (self.layout.outputs,)

        self.begin = kind(write(begin, 1, n_q, n_v, name="mechanism"), batch=False)
        self.forces = kind(write(traced.forces_at, 1, n_q, n_v, name="forces"), batch=False)
        self.move = Kernel(write(lambda q, by: (retract(smooth, q, by),), n_q, n_v, name="move"), batch=False)

    def __getstate__(self) -> dict:
        return {name: vars(self)[name] for name in ("layout", "begin", "forces", "move")}

    def of_rows(self, rows: np.ndarray, gaps: int) -> "MechanismKernels":
        """The same code for some of the stops, ropes and set-valued elements.

        Parameters
        ----------
        rows : ndarray of int
            Their numbers.
        gaps : int
            How many of them are gap functions; these come first.
        """
        made = copy(self)
        chosen = {name: rows for name in ("rate", "K", "bias")} | {"gap": rows[:gaps]}
        made.layout = self.layout.chosen([chosen.get(name) for name in MechanismTerms._fields])
        return made

    def terms(self, t: float, q: np.ndarray, v: np.ndarray, inputs=()) -> MechanismTerms:
        """Terms of a state; M, poses, Jacobians and rows."""
        given = np.concatenate([[t], q, v, inputs])
        return MechanismTerms(*self.layout.filled(self.begin(given)))

    def addresses(self) -> dict[str, int]:
        """Addresses of the kernels by name."""
        return {name: getattr(self, name).address() for name in ("begin", "forces", "move")}


class CallingMechanismKernels:
    """Machine code of one system that calls opaque laws."""

    def __init__(self, kernels: MechanismKernels, receiver: LoadReceiver):
        self.kernels, self.receiver = kernels, receiver
        self.layout, self.move, self.addresses = kernels.layout, kernels.move, kernels.addresses
        self.terms, self.forces = received(kernels.terms, receiver), received(kernels.forces, receiver)


def _body(terms: StateTerms, body: int) -> np.ndarray:
    """Pose, velocities and their rates with q̈ = 0 (24,) of a body in its principal central axes."""
    tree, link = terms.tree, terms.tree.links[body]
    R, _ = tree.poses[body]
    arm = -link.R_central.T @ link.p_central
    (omega, velocity), (alpha, acceleration) = (np.split(part[body], 2) for part in (terms.velocities, terms.biases))
    centre = velocity + cross(omega, arm)
    pull = acceleration + cross(alpha, arm) + cross(omega, cross(omega, arm))
    parts = R @ omega, R @ centre, R @ alpha, R @ pull
    return np.concatenate([(R @ link.R_central.T).ravel(), terms.centers[body], *parts])


def is_coupled_tree(system: System) -> bool:
    """Whether constant sums of joint coordinates are the only constraints beside the joints of the tree."""
    in_tree = {edge.constraint for edge in system.structure.tree}
    linear = all(isinstance(relation, LinearCoupling) for relation in system.scene.relations.values())
    return linear and len(in_tree) == len(system.joints)


def other_gaps(system: System) -> list[ClosedGap]:
    """Gap functions of unilateral constraints that are no contacts of shapes."""
    return [side for side in sides(system.scene) if not isinstance(side.whole, Contact)]


def mechanism_kernels(
    system: System, smooth: System, carriers: tuple[int, ...], inputs: bool = False
) -> MechanismKernels | CallingMechanismKernels:
    """Machine code of a system, cached with it, and by its content on disk; opaque laws are called beside it."""
    laws = Laws(smooth)
    names = tuple(bound.load.name for bound in laws.called)  # a law traced before has other machine code
    make: Callable[[], MechanismKernels] = lambda: MechanismKernels(system, smooth, carriers, inputs)  # noqa: E731
    found = cached_on_disk(system, (MechanismKernels, carriers, inputs, laws.key, names), make)
    return CallingMechanismKernels(found, LoadReceiver(LoadForces(smooth, laws.called))) if laws.called else found
