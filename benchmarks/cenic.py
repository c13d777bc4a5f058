"""Drake's CENIC, error-controlled steps of compliant contacts with regularised friction: the ball that slides, then rolls.

The stiffness is that of its least errors over all accuracies; the speed of stiction does not change them.
"""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

STIFFNESS, DISSIPATION = 1e7, 10.0  # of the contacts [N/m, s/m]
STICTION = 1e-6  # speed of stiction [m/s]
LONGEST = 0.1  # step [s]


def is_installed() -> bool:
    """Whether Drake is there, and has this integrator."""
    return find_spec("pydrake") is not None and find_spec("pydrake.multibody.cenic") is not None


def rolling(friction: float, radius: float, speed: float, times: np.ndarray) -> Callable[[float], np.ndarray]:
    """Positions (k,) [m] at some times of a ball of 1 kg on a floor, as a function of the accuracy.

    Parameters
    ----------
    friction, radius, speed : float
        Coefficient of friction, radius [m], and speed without rotation at the start [m/s].
    times : ndarray, shape (k,)
        Times; the first is 0 [s].
    """
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    ball = plant.AddRigidBody("ball", SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(radius)))
    rough = ProximityProperties()
    AddContactMaterial(DISSIPATION, STIFFNESS, CoulombFriction(friction, friction), rough)
    for body, shape in ((ball, Sphere(radius)), (plant.world_body(), HalfSpace())):
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, body.name(), rough)
    plant.Finalize()
    plant.set_stiction_tolerance(STICTION)
    diagram = builder.Build()
    depth = 9.81 / STIFFNESS  # of the ball at rest [m]

    def motion(accuracy: float) -> np.ndarray:
        simulator = Simulator(diagram)
        chosen = {"accuracy": accuracy, "use_error_control": True, "max_step_size": LONGEST}
        ApplySimulatorConfig(SimulatorConfig(integration_scheme="cenic", **chosen), simulator)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(context, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, radius - depth])
        plant.SetVelocities(context, [0.0, 0.0, 0.0, speed, 0.0, 0.0])
        found = np.zeros(times.size)
        for k, t in enumerate(times[1:], start=1):
            simulator.AdvanceTo(t)
            found[k] = plant.GetPositions(context)[4]
        return found

    return motion
