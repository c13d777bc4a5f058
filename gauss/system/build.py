"""Scene → System: indices of bodies and coordinates, constant frames, sparsity pattern of the constraint rows."""

from dataclasses import replace

import numpy as np

from gauss.backends.structure import ConstraintRows, Edge, Structure
from gauss.errors import SceneError
from gauss.scene import GROUND, Drive, Force, Joint, OneSidedConstraint, Scene, Slipping
from gauss.scene.values import as_function, rotation_matrix
from gauss.system import frames
from gauss.system.contact_mode import sides
from gauss.system.frozen_functions import written_laws
from gauss.system.placed_elements import BoundLoad, PlacedFrame, PlacedJoint
from gauss.system.relations import place_relations
from gauss.system.system import Dynamics, System


def build(scene: Scene, dynamics: Dynamics | None = None) -> System:
    """System of a scene.

    Raises
    ------
    SceneError
        If no chain of joints leads to a body, or frames given twice disagree.
    """
    edges = spanning_tree(scene)
    index = {name: i for i, name in enumerate(scene.bodies)} | {GROUND: -1}
    joints = _place_joints(scene, index)
    constraints = _constraints(scene, joints)
    place = {constraint.name: i for i, constraint in enumerate(constraints)}
    structure = Structure(
        bodies=tuple(scene.bodies),
        coordinates=tuple(f"{j.name}.{rate}" if rate else j.name for j in joints for rate in j.pair.rates),
        constraints=constraints,
        tree=tuple(Edge(place[joint], index[outer], index[inner]) for joint, outer, inner in edges),
    )
    system = System(
        scene=scene,
        structure=structure,
        Phi=np.concatenate([[*body.principal()[0], *[body.mass] * 3] for body in scene.bodies.values()]),
        joints=joints,
        frames=_frames(scene, index),
        loads=tuple(_bind(load) for load in scene.loads.values()),
        dynamics=dynamics,
    )
    system = _with_relations(system)
    _check_inertia(system)
    if scene.set_valued:
        system = replace(system, set_valued=place_relations(system, scene.set_valued.values()))
    _check_gap_functions(system)
    if system.is_plain:
        return system
    return replace(system, written=written) if (written := written_laws(system)) else system


def _check_gap_functions(system: System):
    """Trace the gap functions of the user; those of shapes and joints are traced when they are asked for."""
    if not system.scene.contacts:
        return
    own = [side for side in sides(system.scene) if isinstance(side.whole, OneSidedConstraint)]
    if own:
        place_relations(system, own)


def _with_relations(system: System) -> System:
    """System with the relations of its scene, and their rows after those of joints and couplings."""
    if not system.scene.relations:
        return system
    relations = place_relations(system, system.scene.relations.values())
    constraints, row = list(system.structure.constraints), system.structure.n_rows
    for relation in relations.placed:
        columns = tuple(system.joints[j].v for j in relation.joints)
        constraints.append(ConstraintRows(relation.name, slice(row, row + relation.size), relation.bodies, columns))
        row += relation.size
    structure = replace(system.structure, constraints=tuple(constraints))
    return replace(system, structure=structure, relations=relations)


def _place_joints(scene: Scene, index) -> tuple[PlacedJoint, ...]:
    joints, q, v = [], 0, 0
    for joint in scene.joints.values():
        pair = joint.pair
        on_parent, on_child = frames.joint_frames(scene, joint)
        places = slice(q, q + pair.n_q), slice(v, v + pair.n_v)
        joints.append(PlacedJoint(joint.name, pair, index[joint.parent], index[joint.child], *on_parent, *on_child, *places))
        q, v = places[0].stop, places[1].stop
    return tuple(joints)


def _constraints(scene: Scene, joints) -> tuple[ConstraintRows, ...]:
    constraints, row = [], 0
    for joint in joints:
        bodies = tuple(body for body in (joint.parent, joint.child) if body >= 0)
        constraints.append(ConstraintRows(joint.name, slice(row, row + 6), bodies, (joint.v,)))
        row += 6
    rates = {joint.name: joint.v for joint in joints}
    for coupling in scene.couplings.values():
        columns = rates[coupling.driven], rates[coupling.driver]
        constraints.append(ConstraintRows(coupling.name, slice(row, row + 1), (), columns))
        row += 1
    return tuple(constraints)


def _frames(scene: Scene, index) -> dict[str, PlacedFrame]:
    placed = {GROUND: PlacedFrame(-1, *frames.IDENTITY)}
    for name in scene.bodies:
        placed[name] = PlacedFrame(index[name], *frames.invert(frames.central(scene, name)))
    for frame in scene.frames.values():
        pose = rotation_matrix(frame.rotation), np.array(frame.position)
        in_central = frames.compose(frames.invert(frames.central(scene, frame.body)), pose)
        placed[frame.name] = PlacedFrame(index[frame.body], *in_central)
    return placed


def _bind(load) -> BoundLoad:
    if isinstance(load, Drive | Slipping):
        return BoundLoad(load, (as_function(load.effort),))
    return BoundLoad(load, (as_function(load.force), as_function(load.moment)) if isinstance(load, Force) else ())


def _check_inertia(system: System):
    """Refuse a movable leaf of the tree without inertia; other singular inertias are found by the solvers."""
    structure = system.structure
    massless = [edge for edge in structure.tree if not system.Phi[6 * edge.outer : 6 * edge.outer + 6].any()]
    if not massless:
        return
    inner = {edge.inner for edge in structure.tree}
    bound, tied = _constrained(structure)
    for edge in massless:
        v, pair = system.joints[edge.constraint].v, system.joints[edge.constraint].pair
        if pair.n_v and edge.outer not in inner and edge.outer not in bound and v.start not in tied:
            body, joint = structure.bodies[edge.outer], structure.constraints[edge.constraint].name
            raise SceneError(
                f"body {body!r} has no mass, yet joint {joint!r} lets it move and nothing hangs on it: "
                "its acceleration is undetermined. Give it a mass > 0."
            )


def _constrained(structure: Structure) -> tuple[set[int], set[int]]:
    """Bodies of loops and relations, and first entries of v of the joints of couplings and relations."""
    closures = [structure.constraints[i] for i in structure.closures]
    bodies = {body for constraint in closures for body in constraint.bodies}
    return bodies, {places.start for constraint in closures for places in constraint.columns}


def _require_in_tree(joint: Joint, outer: str):
    """Refuse a joint between two frames that need not meet at the reference configuration."""
    if joint.child_frame is not None:
        words = f"child_frame is for loops, and no other chain of joints leads to {outer!r}"
        raise SceneError(f"joint {joint.name!r}: {words}.")


def spanning_tree(scene: Scene) -> list[tuple[str, str, str]]:
    """Tree edges (joint, outer body, inner body), inner bodies first.

    Joints are taken in the order in which the scene names them: of the joints of a loop the last one is cut.

    SceneError if no chain of joints leads from the ground to some body.
    """
    reached, edges = {GROUND}, []
    waiting = sorted(scene.joints.values(), key=lambda joint: joint.child_frame is not None)  # these close loops
    while waiting:
        later = []
        for joint in waiting:
            ends = joint.parent in reached, joint.child in reached
            if all(ends):
                continue
            if any(ends):
                inner, outer = (joint.parent, joint.child) if ends[0] else (joint.child, joint.parent)
                _require_in_tree(joint, outer)
                reached.add(outer)
                edges.append((joint.name, outer, inner))
            else:
                later.append(joint)
        if len(later) == len(waiting):
            break
        waiting = later
    lost = [name for name in scene.bodies if name not in reached]
    if lost:
        raise SceneError(
            f"no chain of joints leads from the ground to {', '.join(map(repr, lost))}; "
            f"add one, e.g. scene.free('{lost[0]} floats', 'ground', {lost[0]!r}) for a body that moves freely."
        )
    if not scene.bodies:
        raise SceneError(f"scene {scene.name!r} has no bodies; add one with scene.body(...).")
    return edges
