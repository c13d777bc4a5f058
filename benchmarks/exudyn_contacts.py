"""Exudyn's penalty contacts with regularised friction: the ball that slides, then rolls, on a triangle as its floor.

Generalised-α; its explicit methods bear less stiff contacts at the same step. Stiffness over the step, speed of the
regularisation and Newton's tolerance are those of the least errors over all steps: with Exudyn's own tolerance Newton's
method fails in contacts as stiff as these.
"""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from scipy.interpolate import CubicHermiteSpline

STIFFNESS = 1e6  # of the contacts, times the step [N s/m]
DAMPING = 0.7  # of the critical one of 1 kg
STICTION = 1e-3  # speed up to which friction grows [m/s]
TOLERANCE = 1e-6  # of Newton's method
SHORTEST = 0.01  # of the parts of a step that it may try where Newton's method fails


def is_installed() -> bool:
    """Whether Exudyn is there."""
    return find_spec("exudyn") is not None


def rolling(friction: float, radius: float, speed: float, times: np.ndarray, step: float) -> Callable[[], np.ndarray]:
    """Positions (k,) [m] at some times of a ball of 1 kg on a floor.

    Parameters
    ----------
    friction, radius, speed : float
        Coefficient of friction, radius [m], and speed without rotation at the start [m/s].
    times : ndarray, shape (k,)
        Times at the same distance; the first is 0 [s].
    step : float
        Step [s].
    """
    import exudyn as exu
    from exudyn import itemInterface as items
    from exudyn.utilities import InertiaSphere

    stiffness = STIFFNESS / step
    container = exu.SystemContainer()
    system = container.AddSystem()
    contact = system.AddGeneralContact()
    contact.verboseMode = 0
    contact.frictionProportionalZone = STICTION
    contact.SetFrictionPairings(friction * np.eye(1))
    contact.SetSearchTreeCellSize(numberOfCells=[1, 1, 1])
    material = {
        "contactStiffness": stiffness,
        "contactDamping": 2.0 * DAMPING * np.sqrt(stiffness),
        "frictionMaterialIndex": 0,
    }
    ground = system.AddMarker(items.MarkerNodeRigid(nodeNumber=system.AddNode(items.NodePointGround())))
    corners = [[-10.0, -10.0, 0.0], [20.0, -10.0, 0.0], [-10.0, 20.0, 0.0]]
    contact.AddTrianglesRigidBodyBased(rigidBodyMarkerIndex=ground, pointList=corners, triangleList=[[0, 1, 2]], **material)
    ball = system.CreateRigidBody(
        inertia=InertiaSphere(1.0, radius),
        nodeType=exu.NodeType.RotationRotationVector,
        referencePosition=[0.0, 0.0, radius - 9.81 / (0.5 * stiffness)],  # two springs one after the other bear it
        initialVelocity=[speed, 0.0, 0.0],
        gravity=[0.0, 0.0, -9.81],
    )
    node = system.GetObject(ball)["nodeNumber"]
    contact.AddSphereWithMarker(system.AddMarker(items.MarkerNodeRigid(nodeNumber=node)), radius=radius, **material)
    asked = (exu.OutputVariableType.Displacement, exu.OutputVariableType.Velocity)
    kept = [
        system.AddSensor(items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)) for kind in asked
    ]
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = SHORTEST * step  # all steps: those cut into parts shift the later ones
    settings.timeIntegration.numberOfSteps = round(times[-1] / step)
    settings.timeIntegration.endTime = times[-1]
    settings.timeIntegration.minimumStepSize = SHORTEST * step
    settings.timeIntegration.newton.relativeTolerance = settings.timeIntegration.newton.absoluteTolerance = TOLERANCE

    def motion() -> np.ndarray:
        system.Assemble()  # the contact would begin with what it held at the end of the motion before
        system.SolveDynamic(settings)
        positions, velocities = (system.GetSensorStoredData(sensor) for sensor in kept)
        return CubicHermiteSpline(positions[:, 0], positions[:, 1], velocities[:, 1])(times)

    return motion
