"""Spanning tree of the bodies of a scene, and the joints outside it, which close loops."""

from gauss.errors import SceneError
from gauss.scene import GROUND, Scene


def spanning_tree(scene: Scene) -> tuple[list[tuple[str, str, str]], list[str]]:
    """Tree edges (joint, outer body, inner body), inner bodies first, and the joints that close loops.

    Joints are taken in the order in which the scene names them: of the joints of a loop the last one is cut.

    Raises
    ------
    SceneError
        If no chain of joints leads from the ground to some body.
    """
    reached, edges, loops = {GROUND}, [], []
    waiting = list(scene.joints.values())
    while waiting:
        later = []
        for joint in waiting:
            ends = joint.parent in reached, joint.child in reached
            if all(ends):
                loops.append(joint.name)
            elif any(ends):
                inner, outer = (joint.parent, joint.child) if ends[0] else (joint.child, joint.parent)
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
    return edges, loops
