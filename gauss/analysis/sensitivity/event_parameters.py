"""Parameters of events: restitution, places of stops, limits of friction; a derivative of each where it acts.

Restitution e acts in impacts alone: the rates after one are affine in e with v⁺ = v⁻ for e = −1, so that
∂v⁺/∂e = (v⁺ − v⁻) / (1 + e). The place of a stop moves its gap function, and so the time of the impact. A limit of friction
is a force while its element slips; where it sticks, or begins to slip, accelerations do not depend on it.
"""

from collections.abc import Sequence

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import ArgumentError, SimulationError, StateError, did_you_mean, require
from gauss.scene import Scene, Slipping, Stop
from gauss.scene.named_numbers import scene_of
from gauss.system import System, sides

RESTITUTION, LIMIT = "restitution", "limit"
PLACES = {"lowest": 1.0, "highest": -1.0}  # of stops: their gaps are sign · (q − place)
PLACE_STEP = 2.0**-10  # of a place [rad, m]; residuals are linear in it


def is_of_event(scene: Scene, parameter: str) -> bool:
    """Whether a parameter such as "restitution:floor" is one of an event.

    StateError if there is no such unilateral constraint.
    ArgumentError if it has no such number, or the derivative by it does not exist.
    """
    require(parameter, (str,), "parameter")
    kind, _, name = parameter.partition(":")
    if kind == LIMIT:
        return isinstance(getattr(scene.set_valued.get(name), LIMIT, None), float)
    if kind not in (RESTITUTION, *PLACES) or name in scene.loads:
        return False
    if name not in scene.contacts:
        raise StateError(f"parameter {parameter!r}: no {name!r}. {did_you_mean(name, scene.contacts)}")
    given = scene.contacts[name]
    if kind == RESTITUTION and not given.restitution:
        raise ArgumentError(f"parameter {parameter!r}: bounces begin as it becomes positive: there is no derivative at 0.")
    if kind in PLACES and (not isinstance(given, Stop) or getattr(given, kind) is None):
        raise ArgumentError(f"parameter {parameter!r}: {name!r} is no stop with a place {kind!r}.")
    return True


def absent_from(system: System, whole: System, parameters: Sequence[str]) -> tuple[str, ...]:
    """Parameters of events that do not act in the smooth dynamics of a phase."""
    slipping = {f"{LIMIT}:{bound.load.name}" for bound in system.loads if isinstance(bound.load, Slipping)}
    return tuple(name for name in parameters if is_of_event(whole.scene, name) and name not in slipping)


def bearing_places(whole: System, held: Sequence[int], parameters: Sequence[str]) -> tuple[str, ...]:
    """Parameters that are places of stops which bear in a phase: its states lie on what moves."""
    names = {sides(whole.scene)[i].name for i in held}
    split = ((parameter, *parameter.partition(":")[::2]) for parameter in parameters)
    return tuple(parameter for parameter, kind, name in split if kind in PLACES and f"{name}.{kind}" in names)


def refuse_bearing_start(whole: System, held: Sequence[int], parameters: Sequence[str]):
    """Raise a SimulationError for places of stops that bear from the start, which would lie beyond a place that moves."""
    for parameter in bearing_places(whole, held, parameters):
        name = parameter.partition(":")[2]
        raise SimulationError(
            f"derivatives by {parameter} do not exist: {name!r} bears from the start, which does not move with it; start "
            "before the impact."
        )


def elsewhere(whole: System, parameter: str) -> System:
    """The system with a stop at another place, :data:`PLACE_STEP` farther out."""
    kind, _, name = parameter.partition(":")
    place = getattr(whole.scene.contacts[name], kind) - PLACES[kind] * PLACE_STEP
    return compile_scene(scene_of(whole.scene, {f"{name}.{kind}": place}))


def gap_by_parameters(whole: System, gap: int, sizes: dict[str, int]) -> np.ndarray:
    """Derivatives (n_p,) of a gap function by parameters of these sizes."""
    side, found = sides(whole.scene)[gap], np.zeros(sum(sizes.values()))
    for place, parameter in _columns(sizes):
        kind, _, name = parameter.partition(":")
        if kind in PLACES and side.name == f"{name}.{kind}":
            found[place] = -PLACES[kind]
    return found


def rates_by_restitution(whole: System, gap: int, sizes: dict[str, int], change: np.ndarray, e: float) -> np.ndarray:
    """Derivatives (n_v, n_p) of the rates after an impact of a gap, which changes them by ``change`` with restitution e."""
    found = np.zeros((change.size, sum(sizes.values())))
    for place, parameter in _columns(sizes):
        if parameter == f"{RESTITUTION}:{sides(whole.scene)[gap].whole.name}" and e:  # not where the rebound is suppressed
            found[:, place] = change / (1.0 + e)
    return found


def _columns(sizes: dict[str, int]) -> list[tuple[int, str]]:
    """First column of each parameter."""
    return list(zip(np.cumsum([0, *sizes.values()])[:-1].tolist(), sizes, strict=True))
