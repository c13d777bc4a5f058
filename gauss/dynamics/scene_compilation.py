"""Compilation of a scene: Scene → System with its dynamics, in tree coordinates or in maximal ones."""

from copy import copy
from dataclasses import replace

from gauss.arguments import named_arguments
from gauss.codegen import gc_pause
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.system_dynamics import SystemDynamics
from gauss.errors import SceneError, require
from gauss.rotations import to_quaternion
from gauss.scene import GROUND, Joint, Scene, Start
from gauss.system import System, build

COORDINATES = ("auto", "tree", "maximal")


@named_arguments
def compile_scene(scene: Scene, coordinates: str = "auto") -> System:
    """System of a scene.

    Parameters
    ----------
    scene : Scene
        The scene; later changes of it do not reach the system. Laws of drives, forces and friction may give other values
        from one motion to the next, by what they close over, and the motions follow. Functions that were differentiated for
        the system, of prescribed motions, constraints and gaps, must stay what they were: where one has changed,
        using the system raises a SceneError that says to compile anew.
    coordinates : str
        "tree": the state holds the coordinates of all joints, poses follow from them along a spanning tree, and
        joints outside the tree close loops. "auto" chooses it. "maximal": every body floats by six coordinates of its own
        ("BODY floats.x", …), and every joint is a constraint: the same mechanics without a choice of where loops are cut,
        at a higher cost.

    Returns
    -------
    System
        Ready for ``initial_state``, ``accelerations``, :func:`gauss.assemble` and :func:`gauss.simulate`.

    Raises
    ------
    SceneError
        If the scene is not a mechanism; the message names what is missing.
    """
    require(scene, (Scene,), "compile_scene")
    if coordinates not in COORDINATES:
        raise SceneError(f"coordinates: expected one of {', '.join(COORDINATES)}, got {coordinates!r}.")
    with gc_pause():
        scene = _as_it_is(scene)
        system = build(scene, SystemDynamics())
        if coordinates != "maximal":
            return system
        return build(floating(scene, system), SystemDynamics())


def _as_it_is(scene: Scene) -> Scene:
    """Scene with collections of its own: elements do not change, and those of later do not reach a system."""
    made = copy(scene)
    vars(made).update({name: value.copy() for name, value in vars(scene).items() if isinstance(value, dict)})
    return made


def floating(scene: Scene, tree: System) -> Scene:
    """Scene with a free joint "BODY floats" for every body, in which its own joints are loop joints.

    SceneError if a body has no inertia about some axis: floating, it could not be accelerated.

    Parameters
    ----------
    scene : Scene
        The scene; it is not changed.
    tree : System
        The same scene in tree coordinates, with the start.
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
