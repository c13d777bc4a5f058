"""Dynamics of single states with equal chains in the lanes of vector registers.

The mechanism is traced with parameters for the numbers in which its chains differ, so that zeros of one chain do not change
its operations; in the code the parameters are constants again.

Lanes are a choice of code generation, as the width of vectors and the tier are: the plan, its checks and its fallback stay
as they are, and accelerations agree to rounding. It depends on the code itself, hence no rule of
:mod:`gauss.dynamics.plan` makes it: :func:`in_chain_lanes` counts what lanes save. ``System.explain()`` lists the chains.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from gauss.backends.structure import GROUND
from gauss.codegen import Graph, write
from gauss.codegen.packed_function import PackedFunction
from gauss.dynamics.equal_chains import EqualChains, equal_chains
from gauss.dynamics.given_link_frames import GivenLinkFrames, with_given_frames
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import ParametrisedSystem, changed, count, numbers, with_numbers
from gauss.dynamics.traced_system import Program
from gauss.system import System

LEAST_SHARE = 0.3  # of the joints that are in equal chains: fewer save less than what follows
LEAST_SAVING = 0.1  # share of the instructions, counted too small: inputs are gathered, and chains may differ in more


def in_chain_lanes(system: System, laws: Laws, once: Callable, sizes: tuple[int, ...], name: str) -> PackedFunction | None:
    """Function of a state with equal chains computed together; None where there are none, or this saves too little.

    Mechanisms with relations, and with traced loads that call functions, are left to code of single operations.

    ``once``: dynamics (program, q, v, generalised forces, t) of one state.
    """
    kinds = chains_for_lanes(system)
    if not kinds:
        return None
    family, twins, values = _parametrised(system, laws, kinds)
    function = write(partial(once, Program(family.system, laws, family=family)), *sizes, name=name)
    if any(node.op == "call" for node in function.nodes):
        return None
    first = len(function.inputs) - len(function.parameters)
    place = {parameter: first + k for k, parameter in enumerate(function.parameters)}
    seeds = [[*_states(system, equal), *_used(own, place)] for equal, own in zip(kinds, twins, strict=True)]
    packed = PackedFunction(function, seeds, {place[parameter]: values[parameter] for parameter in place})
    return packed if packed.saving >= LEAST_SAVING else None


def chains_for_lanes(system: System) -> list[EqualChains]:
    """Equal chains of each kind that may be computed together; none if they are few of the joints or relations are there."""
    kinds = [] if system.relations.placed else equal_chains(system)
    return kinds if sum(len(equal.of_joint) for equal in kinds) >= LEAST_SHARE * len(system.joints) else []


def _used(twins: list[list[str]], place: dict[str, int]) -> Iterator[tuple[int, ...]]:
    """Places of equal parameters that the function uses."""
    return (tuple(place[one] for one in names) for names in twins if all(one in place for one in names))


def _states(system: System, equal: EqualChains) -> Iterator[tuple[int, ...]]:
    """Places of equal coordinates, rates and generalised forces among the inputs."""
    subsystem = equal.subsystem
    for joints in zip(*(chain.joints for chain in equal.chains), strict=True):
        placed = [subsystem.joints[joint] for joint in joints]
        yield from zip(*(subsystem.q[joint.q] for joint in placed), strict=True)
        for first in (system.n_q, system.n_q + system.n_v):
            yield from zip(*(first + subsystem.v[joint.v] for joint in placed), strict=True)


def _parametrised(system: System, laws: Laws, kinds: list[EqualChains]) -> tuple[ParametrisedSystem, list, dict[str, float]]:
    """System with parameters for the numbers in which chains differ, names of equal ones by kind, and their values."""
    found, _ = numbers(system)
    graph, entries = Graph(shared=True), found.astype(object)
    twins: list[list[list[str]]] = [[] for _ in kinds]
    for equal, own in zip(kinds, twins, strict=True):
        for places in _equal_numbers(system, equal):
            if len(set(found[places])) > 1:
                own.append([f"p[{place}]" for place in places])
                entries[places] = [graph.symbol(parameter) for parameter in own[-1]]
    varied = np.array([place for place, entry in enumerate(entries) if not isinstance(entry, float)], dtype=int)
    parametrised = changed(with_numbers(system, entries, system.mechanics), {"loads": tuple(laws.traced)})
    values = {f"p[{place}]": float(found[place]) for place in varied}
    return ParametrisedSystem(system, parametrised, varied), twins, values


def _equal_numbers(system: System, equal: EqualChains) -> Iterator[list[int]]:
    """Places of equal numbers, one of each chain, among those of :func:`gauss.dynamics.parameters.numbers`."""
    slots: dict[tuple, dict[int, int]] = defaultdict(dict)
    ranks, place = Counter[tuple](), 0
    for field, of_chain, size in _elements(system, equal):
        if of_chain is not None:
            rank = ranks[field, of_chain]  # of several things on a body
            ranks[field, of_chain] += 1
            for k in range(size):
                slots[field, of_chain[1], rank, k][of_chain[0]] = place + k
        place += size
    chains = range(len(equal.chains))
    return ([by_chain[k] for k in chains] for by_chain in slots.values() if len(by_chain) == len(chains))


def _elements(system: System, equal: EqualChains) -> Iterator[tuple[str, tuple[int, int] | None, int]]:
    """Field, chain and place there, and size of each element of a system with numbers; None of what is common."""
    subsystem, of_body, of_joint = equal.subsystem, equal.of_body, equal.of_joint
    of_name = {subsystem.joints[joint].name: own for joint, own in of_joint.items()}
    of_carried = {body: of_body.get(frame.body) for body, frame in subsystem.carried.items()}
    yield "gravity", None, 3
    for body in range(system.Phi.size // 6):
        yield "Phi of system", of_carried.get(body), 6
    for joint in system.joints:
        yield "joints of system", of_name.get(joint.name), count(joint)
    for frame in system.frames.values():
        yield "frames", of_carried.get(frame.body), count(frame)
    yield "loads", None, count([bound.load for bound in system.loads])
    own: dict[str, dict] = {"Phi": of_body, "joints": of_joint, "carried": of_carried, "links": of_body, "sides": of_joint}
    for one in system.subsystems:
        for field, key, size in _elements_of(with_given_frames(one)):
            yield field, own.get(field, {}).get(key) if one is subsystem else None, size


def _elements_of(subsystem: GivenLinkFrames) -> Iterator[tuple[str, int, int]]:
    """Field, body or joint, and size of each element of a subsystem with numbers, in their order."""
    for body in range(subsystem.n_bodies):
        yield "Phi", body, 6
    yield "gravity", GROUND, 3
    for index, joint in enumerate(subsystem.joints):
        yield "joints", index, count(joint)
    for field in ("carried", "links", "sides"):
        for key, thing in getattr(subsystem, field).items():
            yield field, key, count(thing)
