"""Dynamics of large trees as sweeps: the same steps from link to link, traced once for each kind of link."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.codegen import as_number, write
from gauss.codegen.kernels import LinkStep, TreeRecursion
from gauss.dynamics.aba import Elimination, acceleration_outward, add, eliminate, force_inward, inertia_to_inner
from gauss.dynamics.link_frames import Link, link_frames
from gauss.dynamics.rnea import JointKinematics, force_to_inner, gyroscopic, inertial, kinematics_of_joint, to_outer
from gauss.rotations import skew
from gauss.scene import Pair
from gauss.system import System, whole

OMEGA, INERTIA, FORCE, ACCELERATION, OWN = 0, 3, 24, 30, 36  # slots of a record
MOST_KINDS = 24  # beyond, links are not told apart by the zeros among their constants
UPPER = np.triu_indices(3)


class LinkKind(NamedTuple):
    """What links have in common whose code is the same."""

    name: str
    subspace: tuple  # at the reference configuration: tells screws of different pitch apart
    forward: bool
    is_root: bool
    is_leaf: bool
    is_first: bool  # in the order of the inward pass, of the links on one inner link
    zeros: tuple


def forward_tree_recursion(system: System) -> TreeRecursion:
    """(q, v, effort, acceleration of the ground) → joint accelerations, by the articulated-body recursion."""
    return _sweep(system, "forward", _forward_steps, ("q", "v", "effort"))


def inverse_tree_recursion(system: System) -> TreeRecursion:
    """(q, v, joint accelerations, acceleration of the ground) → generalised forces, by the recursion of Newton and Euler."""
    return _sweep(system, "inverse", _inverse_steps, ("q", "v", "rates"))


def _sweep(system: System, name: str, steps: Callable, vectors) -> TreeRecursion:
    part = whole(system)
    edges, links = part.tree, link_frames(part)
    joints = [part.joints[edge.constraint] for edge in edges]
    kinds = _kinds(edges, joints, links)
    names = sorted(set(kinds), key=kinds.index)
    constants = [link_numbers(links[edge.outer]) for edge in edges]
    built, parameters, record = {}, [None] * len(edges), OWN
    for number, kind in enumerate(names):
        members = [i for i, other in enumerate(kinds) if other == kind]
        table = np.array([constants[i] for i in members])
        varying = np.flatnonzero((table != table[0]).any(axis=0))
        for i in members:
            parameters[i] = constants[i][varying]
        built[number], size = steps(_Traced(joints[members[0]].pair, kind, table[0], varying))
        record = max(record, size)
    place = {edge.outer: i for i, edge in enumerate(edges)} | {-1: -1}
    starts = {vector: np.array([j.q.start if vector == "q" else j.v.start for j in joints]) for vector in vectors}
    starts["result"] = np.array([joint.v.start for joint in joints])
    passes = list(zip(*built.values(), strict=True))
    return TreeRecursion(
        name,
        {vector: system.n_q if vector == "q" else system.n_v for vector in vectors} | {"base": 6},
        system.n_v,
        [({k: step for k, (step, _) in enumerate(found)}, found[0][1]) for found in passes],
        np.array([names.index(kind) for kind in kinds]),
        np.array([place[edge.inner] for edge in edges]),
        starts,
        parameters,
        record,
        [(ACCELERATION + k, "base", k) for k in range(6)],
    )


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
    return Link(R.reshape(3, 3), p, turn.reshape(3, 3), (symmetric(A), skew(first), mass * np.eye(3)), first, None, None)


def symmetric(upper) -> np.ndarray:
    """Symmetric matrix of the entries on and above its diagonal."""
    a, b, c, d, e, f = upper
    return np.array([[a, b, c], [b, d, e], [c, e, f]])


class _Traced:
    """A kind of link while its steps are written down.

    Parameters
    ----------
    pair : Pair
        Its joint.
    kind : LinkKind
        The kind.
    constants : ndarray
        Numbers of a link of this kind.
    varying : ndarray of int
        Which of them differ from link to link.
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
        places = [("parameter", k) for k in range(len(self.varying))] + [p for part in reads.values() for p in part]
        outputs = [p for part in writes.values() for p in part]
        kept = [k for k, place in enumerate(outputs) if place is not None]
        code = type(code)(code.name, code.inputs, [code.outputs[k] for k in kept])
        added = frozenset(new for new, k in enumerate(kept) if outputs[k] in adds)
        return LinkStep(code, places, [outputs[k] for k in kept], added)

    def own(self, size: int) -> list:
        """So many further slots of the link's record."""
        self.next_slot += size
        return [("own", k) for k in range(self.next_slot - size, self.next_slot)]

    def vector(self, name: str) -> list:
        """The link's part of a vector."""
        return [(name, k) for k in range(len(self.pair.reference) if name == "q" else self.pair.n_v)]


def _slots(space: str, first: int, size: int) -> list:
    return [(space, k) for k in range(first, first + size)]


def _passage_step(link: _Traced) -> tuple[LinkStep, Callable, list]:
    """Outward step to angular velocity and passage, the function that reads the passage back, and where it is kept."""
    k = link.pair.n_v
    inner = _slots("inner", OMEGA, 3)

    def outward(constants, q, v, omega):
        kin, omega = kinematics_of_joint(
            link.pair, link.kind.forward, constants, q, v, np.zeros(3) if link.kind.is_root else omega
        )
        return omega, *(np.ravel(part) for part in kin)

    places = {"omega": _slots("own", OMEGA, 3), "passage": link.own(9 + 3 + 6 * k + 6)}
    step = link.step(outward, {"q": link.vector("q"), "v": link.vector("v"), "inner": inner}, places)
    known = [as_number(entry) for entry in step.function.outputs[3:]]

    def read(stored) -> JointKinematics:
        numbers = np.array([s if value is None else value for s, value in zip(stored, known, strict=True)], dtype=object)
        R, p, S, bias = np.split(numbers, np.cumsum([9, 3, 6 * k]))
        return JointKinematics(R.reshape(3, 3), p, S.reshape(6, k), bias)

    return step, read, places["passage"]


def _forward_steps(link: _Traced):
    """Steps of the three passes of forward dynamics, each with whether its pass goes inward, and the size of the record."""
    first, read, stored = _passage_step(link)
    kind, k = link.kind, link.pair.n_v
    collected = [] if kind.is_leaf else _slots("own", INERTIA, 27)
    omega = _slots("own", OMEGA, 3)
    kept = {"U": link.own(6 * k), "D": link.own(k * k), "short": link.own(k)}
    onward = [None] * 27 if kind.is_root else _slots("inner", INERTIA, 27)

    def inward(constants, kin, omega, driven, collected):
        kin, inertia, force = read(kin), constants.inertia, gyroscopic(constants, omega)
        if len(collected):
            A, B, C, more = np.split(collected, [6, 15, 21])
            inertia, force = add(inertia, (symmetric(A), B.reshape(3, 3), symmetric(C))), force + more
        found = eliminate(kin, inertia)
        short, pull = force_inward(kin, found, force, kin.bias, driven)
        A, B, C = inertia_to_inner(constants, kin, found.projected)
        onward = A[UPPER], B.ravel(), C[UPPER], force_to_inner(constants, kin, pull)
        return found.U.ravel(), found.D_inverse.ravel(), short, *onward

    def outward(constants, kin, U, D_inverse, short, inner):
        kin = read(kin)
        eliminated = Elimination(U.reshape(6, k), D_inverse.reshape(k, k), None)
        carried = to_outer(constants, kin, inner) + kin.bias
        return acceleration_outward(kin, eliminated, short, carried)

    reads = {"passage": stored, "omega": omega, "driven": link.vector("effort"), "collected": collected}
    second = link.step(inward, reads, kept | {"onward": onward}, () if kind.is_first else onward)
    reads = {"passage": stored, **kept, "inner": _slots("inner", ACCELERATION, 6)}
    third = link.step(outward, reads, {"result": link.vector("result"), "own": _slots("own", ACCELERATION, 6)})
    return [(first, False), (second, True), (third, False)], link.next_slot


def _inverse_steps(link: _Traced):
    """Steps of the three passes of inverse dynamics."""
    first, read, stored = _passage_step(link)
    kind = link.kind
    own, inner = _slots("own", ACCELERATION, 6), _slots("inner", ACCELERATION, 6)

    def outward(constants, kin, rates, inner):
        kin = read(kin)
        return (to_outer(constants, kin, inner) + kin.bias + kin.S @ rates,)

    def inward(constants, kin, omega, acceleration, collected):
        kin, force = read(kin), inertial(constants, omega, acceleration)
        force = force + collected if len(collected) else force
        return kin.S.T @ force, force_to_inner(constants, kin, force)

    second = link.step(outward, {"passage": stored, "rates": link.vector("rates"), "inner": inner}, {"own": own})
    collected = [] if kind.is_leaf else _slots("own", FORCE, 6)
    onward = [None] * 6 if kind.is_root else _slots("inner", FORCE, 6)
    reads = {"passage": stored, "omega": _slots("own", OMEGA, 3), "acceleration": own, "collected": collected}
    third = link.step(inward, reads, {"result": link.vector("result"), "onward": onward}, () if kind.is_first else onward)
    return [(first, False), (second, False), (third, True)], link.next_slot
