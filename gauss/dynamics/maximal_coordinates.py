"""Maximal coordinates: every body floats freely, and every joint of the scene is a constraint."""

from dataclasses import replace

from gauss.dynamics.kinematics import kinematics
from gauss.errors import SceneError
from gauss.rotations import to_quaternion
from gauss.scene import GROUND, Joint, Scene, Start
from gauss.system import System


def floating(scene: Scene, tree: System) -> Scene:
    """Scene with a free joint "BODY floats" for every body, in which its own joints are loop joints.

    Parameters
    ----------
    scene : Scene
        The scene; it is not changed.
    tree : System
        The same scene in tree coordinates, with the start.

    Raises
    ------
    SceneError
        If a body has no inertia about some axis: floating, it could not be accelerated.
    """
    inertialess = [name for name, body in scene.bodies.items() if not (body.mass and body.principal()[0].all())]
    if inertialess:
        raise SceneError(
            f"{', '.join(map(repr, inertialess))} {'has' if len(inertialess) == 1 else 'have'} no inertia about some axis, "
            "which maximal coordinates need; give mass and three moments of inertia, or use coordinates='tree'."
        )
    motion = kinematics(tree, tree.initial_state())
    joints, starts = {}, {}
    for body in scene.bodies:
        R_reference, p_reference = motion.reference(body)
        name = f"{body} floats"
        joints[name] = Joint(name, "free", GROUND, body, at=tuple(p_reference))
        R = motion.rotation(body) @ R_reference.T
        position = (*(motion.position(body) - p_reference), *to_quaternion(R))
        starts[name] = Start(name, position, (*motion.velocity(body), *(R.T @ motion.angular_velocity(body))))
    for joint in tree.joints:
        if joint.pair.n_v:
            q, v = (tuple(map(float, values)) for values in (motion.state.q[joint.q], motion.state.v[joint.v]))
            starts[joint.name] = Start(joint.name, q if len(q) > 1 else q[0], v if len(v) > 1 else v[0])
    return replace(scene, joints=joints | scene.joints, starts=starts)
