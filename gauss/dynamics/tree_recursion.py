"""Recursions along large trees, by kernels traced once for each kind of link.

Forward dynamics (articulated-body algorithm, three passes) and inverse dynamics (recursive Newton–Euler, three passes):
Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 7.3 and 5.3. Energies of the links, T = ½ Vᵀ I V and −m g · x, in
one outward pass.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.codegen import as_number, write
from gauss.codegen.kernels import LinkStep, TreeRecursion
from gauss.dynamics.aba import Elimination, add, eliminate, inertia_to_inner
from gauss.dynamics.link_frames import Link, link_frames
from gauss.dynamics.rnea import JointKinematics, apply, force_to_inner, gyroscopic, inertial, kinematics_of_joint, to_outer
from gauss.rotations import skew
from gauss.scene import Pair
from gauss.system import System, whole

OMEGA, INERTIA, FORCE, ACCELERATION, OWN = 0, 3, 24, 30, 36  # slots of the record of a link
TWIST, HEIGHT = 0, 32  # slots in the recursion of energies; after the height, the upward direction
MOST_KINDS = 24  # beyond, links are not distinguished by the zeros among their constants
UPPER = np.triu_indices(3)


class LinkKind(NamedTuple):
    """Properties that links with common code share."""

    name: str  # kind of the joint to its inner link
    subspace: tuple  # at the reference configuration: distinguishes screws of different pitch
    forward: bool  # whether the link is the child of that joint
    is_root: bool  # whether the inner link is the ground
    is_leaf: bool  # whether no link hangs on it
    is_first: bool  # of the links on one inner link, in the order of the inward pass
    zeros: tuple  # which of its constants are zero; empty where these are not distinguished


def forward_tree_recursion(system: System) -> TreeRecursion:
    """(q, v, effort, acceleration of the ground) → joint accelerations, by the articulated-body recursion."""
    return _recursion(system, "forward", _forward_steps, ("q", "v", "effort"))


def inverse_tree_recursion(system: System) -> TreeRecursion:
    """(q, v, joint accelerations, acceleration of the ground) → generalised forces, by the recursion of Newton and Euler."""
    return _recursion(system, "inverse", _inverse_steps, ("q", "v", "rates"))


def energy_recursion(system: System) -> TreeRecursion:
    """(q, v, acceleration of the ground) → kinetic and potential energy of every link [J].

    The potential energy of mass that is regrouped to the ground is left out: it is constant.
    """
    return _recursion(system, "energies", _energy_steps, ("q", "v"), 2)


def _recursion(system: System, name: str, steps: Callable, vectors, per_link: int = 0) -> TreeRecursion:
    """Recursion whose result has ``per_link`` numbers for every link; if 0, one for every rate."""
    subsystem = whole(system)
    edges, links = subsystem.tree, link_frames(subsystem)
    joints = [subsystem.joints[edge.constraint] for edge in edges]
    kinds = _kinds(edges, joints, links)
    names = sorted(set(kinds), key=kinds.index)
    parameters, built, record = _built(steps, joints, kinds, names, [link_numbers(links[edge.outer]) for edge in edges])
    place = {edge.outer: i for i, edge in enumerate(edges)} | {-1: -1}
    return TreeRecursion(
        name,
        {vector: system.n_q if vector == "q" else system.n_v for vector in vectors} | {"base": 6},
        per_link * len(joints) or system.n_v,
        _passes(built),
        np.array([names.index(kind) for kind in kinds]),
        np.array([place[edge.inner] for edge in edges]),
        _starts(joints, vectors, per_link),
        parameters,
        record,
        [(ACCELERATION + k, "base", k) for k in range(6)],
    )


def _passes(built: dict) -> list[tuple[dict, bool]]:
    """Step of every kind of link in each pass, and whether the pass runs inward."""
    passes = zip(*built.values(), strict=True)
    return [({kind: step for kind, (step, _) in enumerate(found)}, found[0][1]) for found in passes]


def _starts(joints, vectors, per_link: int) -> dict[str, np.ndarray]:
    """First entry of every joint in each vector and in the result."""
    rates = np.array([joint.v.start for joint in joints])
    found = {vector: np.array([joint.q.start for joint in joints]) if vector == "q" else rates for vector in vectors}
    return found | {"result": per_link * np.arange(len(joints)) if per_link else rates}


def _built(steps: Callable, joints, kinds: list[LinkKind], names: list[LinkKind], constants) -> tuple[list, dict, int]:
    """Parameters of every link, traced steps of every kind, and the size of the record."""
    built, record = {}, OWN
    parameters: list = [None] * len(joints)
    for number, kind in enumerate(names):
        members = [i for i, other in enumerate(kinds) if other == kind]
        table = np.array([constants[i] for i in members])
        varying = np.flatnonzero((table != table[0]).any(axis=0))
        for i in members:
            parameters[i] = constants[i][varying]
        built[number], size = steps(_LinkCode(joints[members[0]].pair, kind, table[0], varying))
        record = max(record, size)
    return parameters, built, record


def _kinds(edges, joints, links) -> list[LinkKind]:
    """Kind of every link."""
    inner = {edge.inner for edge in edges}
    first: dict[int, int] = {}
    for edge in reversed(edges):
        first.setdefault(edge.inner, edge.outer)
    found = []
    for edge, joint in zip(edges, joints, strict=True):
        pair, forward = joint.pair, edge.outer == joint.child
        places = edge.inner < 0, edge.outer not in inner, first[edge.inner] == edge.outer
        zeros = tuple(np.concatenate([links[edge.outer].R.ravel(), links[edge.outer].p]) == 0)
        subspace = tuple(np.concatenate(pair.subspace(np.array(pair.reference))).ravel())
        found.append(LinkKind(pair.kind, subspace, forward, *places, zeros))
    return found if len(set(found)) <= MOST_KINDS else [kind._replace(zeros=()) for kind in found]


def link_numbers(link: Link) -> np.ndarray:
    """Numbers of a link in a row."""
    A, _, C = link.inertia
    return np.concatenate([link.R.ravel(), link.p, link.turn.ravel(), A[UPPER], link.first, [C[0, 0]]])


def link_of(numbers) -> Link:
    """Link of a row of numbers or expressions."""
    R, p, turn, A, first, (mass,) = np.split(numbers, np.cumsum([9, 3, 9, 6, 3]))
    return Link(R.reshape(3, 3), p, turn.reshape(3, 3), (symmetric(A), skew(first), mass * np.eye(3)), first)


def symmetric(upper) -> np.ndarray:
    """Symmetric matrix of the entries on and above its diagonal."""
    a, b, c, d, e, f = upper
    return np.array([[a, b, c], [b, d, e], [c, e, f]])


class _LinkCode:
    """Kind of link whose steps are traced.

    ``constants``: numbers of a link of this kind. ``varying``: which of them differ from link to link.
    """

    def __init__(self, pair: Pair, kind: LinkKind, constants: np.ndarray, varying: np.ndarray):
        self.pair, self.kind, self.constants, self.varying = pair, kind, constants, varying
        self.next_slot = OWN

    def step(self, function, reads: dict, writes: dict, adds=()) -> LinkStep:
        """Step whose function takes the link and a vector for each of ``reads``, and returns one for each of ``writes``."""
        sizes = [len(places) for places in reads.values()]

        def traced(parameters, *vectors):
            numbers = self.constants.astype(object)
            numbers[self.varying] = parameters
            return tuple(function(link_of(numbers), *vectors))

        code = write(traced, len(self.varying), *sizes, name="link")
        places = [("parameter", k) for k in range(len(self.varying))] + _flat(reads)
        outputs = _flat(writes)
        kept = [k for k, place in enumerate(outputs) if place is not None]
        code = type(code)(code.name, code.inputs, [code.outputs[k] for k in kept])
        added = frozenset(new for new, k in enumerate(kept) if outputs[k] in adds)
        return LinkStep(code, places, [outputs[k] for k in kept], added)

    def own(self, size: int) -> list:
        """Further slots of the record of the link."""
        self.next_slot += size
        return [("own", k) for k in range(self.next_slot - size, self.next_slot)]

    def vector(self, name: str) -> list:
        """Entries of the link in a vector."""
        return [(name, k) for k in range(len(self.pair.reference) if name == "q" else self.pair.n_v)]


def _flat(places: dict) -> list:
    return [place for part in places.values() for place in part]


def _slots(space: str, first: int, size: int) -> list:
    return [(space, k) for k in range(first, first + size)]


def _kinematics_step(link: _LinkCode) -> tuple[LinkStep, Callable, list]:
    """Outward step to angular velocity and joint kinematics, the function that reads these back, and their slots."""
    k = link.pair.n_v
    inner = _slots("inner", OMEGA, 3)

    def outward(constants, q, v, omega):
        kin, omega = kinematics_of_joint(
            link.pair, link.kind.forward, constants, q, v, np.zeros(3) if link.kind.is_root else omega
        )
        return omega, *(np.ravel(part) for part in kin)

    places = {"omega": _slots("own", OMEGA, 3), "kinematics": link.own(9 + 3 + 6 * k + 6)}
    step = link.step(outward, {"q": link.vector("q"), "v": link.vector("v"), "inner": inner}, places)
    known = [as_number(entry) for entry in step.function.outputs[3:]]

    def read(stored) -> JointKinematics:
        numbers = np.array([s if value is None else value for s, value in zip(stored, known, strict=True)], dtype=object)
        R, p, S, bias = np.split(numbers, np.cumsum([9, 3, 6 * k]))
        return JointKinematics(R.reshape(3, 3), p, S.reshape(6, k), bias)

    return step, read, places["kinematics"]


def _forward_steps(link: _LinkCode):
    """Steps of the three passes of forward dynamics, each with a flag for inward passes, and the size of the record."""
    first, read, stored = _kinematics_step(link)
    kind, k = link.kind, link.pair.n_v
    collected = [] if kind.is_leaf else _slots("own", INERTIA, 27)
    omega = _slots("own", OMEGA, 3)
    kept = {"U": link.own(6 * k), "D": link.own(k * k), "u": link.own(k)}
    onward = [None] * 27 if kind.is_root else _slots("inner", INERTIA, 27)

    def inward(constants, kin, omega, driven, collected):
        kin, inertia, force = read(kin), constants.inertia, gyroscopic(constants, omega)
        if len(collected):
            A, B, C, more = np.split(collected, [6, 15, 21])
            inertia, force = add(inertia, (symmetric(A), B.reshape(3, 3), symmetric(C))), force + more
        found = eliminate(kin, inertia)
        u, passed = found.force_inward(kin, force, kin.bias, driven)
        A, B, C = inertia_to_inner(constants, kin, found.projected)
        onward = A[UPPER], B.ravel(), C[UPPER], force_to_inner(constants, kin, passed)
        return found.U.ravel(), found.D_inverse.ravel(), u, *onward

    def outward(constants, kin, U, D_inverse, u, inner):
        kin = read(kin)
        eliminated = Elimination(U.reshape(6, k), D_inverse.reshape(k, k))
        carried = to_outer(constants, kin, inner) + kin.bias
        return eliminated.acceleration_outward(kin, u, carried)

    reads = {"kinematics": stored, "omega": omega, "driven": link.vector("effort"), "collected": collected}
    second = link.step(inward, reads, kept | {"onward": onward}, () if kind.is_first else onward)
    reads = {"kinematics": stored, **kept, "inner": _slots("inner", ACCELERATION, 6)}
    third = link.step(outward, reads, {"result": link.vector("result"), "own": _slots("own", ACCELERATION, 6)})
    return [(first, False), (second, True), (third, False)], link.next_slot


def _inverse_steps(link: _LinkCode):
    """Steps of the three passes of inverse dynamics."""
    first, read, stored = _kinematics_step(link)
    kind = link.kind
    own, inner = _slots("own", ACCELERATION, 6), _slots("inner", ACCELERATION, 6)

    def outward(constants, kin, rates, inner):
        kin = read(kin)
        return (to_outer(constants, kin, inner) + kin.bias + kin.S @ rates,)

    def inward(constants, kin, omega, acceleration, collected):
        kin, force = read(kin), inertial(constants, omega, acceleration)
        force = force + collected if len(collected) else force
        return kin.S.T @ force, force_to_inner(constants, kin, force)

    second = link.step(outward, {"kinematics": stored, "rates": link.vector("rates"), "inner": inner}, {"own": own})
    collected = [] if kind.is_leaf else _slots("own", FORCE, 6)
    onward = [None] * 6 if kind.is_root else _slots("inner", FORCE, 6)
    reads = {"kinematics": stored, "omega": _slots("own", OMEGA, 3), "acceleration": own, "collected": collected}
    third = link.step(inward, reads, {"result": link.vector("result"), "onward": onward}, () if kind.is_first else onward)
    return [(first, False), (second, False), (third, True)], link.next_slot


def _energy_steps(link: _LinkCode):
    """Step of an outward pass to the twist, the height times g, and the upward direction times g."""
    parts = {"twist": (TWIST, 6), "height": (HEIGHT, 1), "up": (HEIGHT + 1, 3)}

    def outward(constants, q, v, twist, height, up):
        kin, _ = kinematics_of_joint(link.pair, link.kind.forward, constants, q, v, np.zeros(3))
        twist = to_outer(constants, kin, np.zeros(6) if link.kind.is_root else twist) + kin.S @ v
        height, up = height + up @ (constants.p + constants.R @ kin.p), kin.R.T @ (constants.R.T @ up)
        mass = constants.inertia[2][0, 0]
        return twist, height, up, [0.5 * twist @ apply(constants.inertia, twist)], mass * height + up @ constants.first

    reads = {"q": link.vector("q"), "v": link.vector("v")} | {name: _slots("inner", *place) for name, place in parts.items()}
    writes = {name: _slots("own", *place) for name, place in parts.items()}
    step = link.step(outward, reads, writes | {"kinetic": [("result", 0)], "potential": [("result", 1)]})
    return [(step, False)], OWN
