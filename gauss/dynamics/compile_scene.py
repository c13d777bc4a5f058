"""Compilation of a scene: Scene → System with its dynamics."""

from gauss.codegen import gc_pause
from gauss.dynamics.system_dynamics import SystemDynamics
from gauss.errors import SceneError, named_arguments, require
from gauss.scene import Scene
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
        system = build(scene, SystemDynamics())
        if coordinates != "maximal":
            return system
        from gauss.dynamics.maximal_coordinates import floating

        return build(floating(scene, system), SystemDynamics())
