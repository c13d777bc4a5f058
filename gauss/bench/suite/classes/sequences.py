"""Steps of motions: programmes of one shape whose data change a little and whose active rows change, for warm starts.

Steps of a sequence follow each other in the order of their names; sizes and names of the variables are the same in all.
"""

from collections.abc import Iterator
from functools import lru_cache, partial

import numpy as np

from gauss.backends.coordinates import Coordinates
from gauss.bench.scenes import chain
from gauss.bench.suite.bodies import Heap, make_heap
from gauss.bench.suite.classes.mpc import PLANTS, horizon
from gauss.bench.suite.classes.whole_body import control
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.bench.suite.refine import refined
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics

STEP = 2.0**-6  # [s], of time stepping
STEPS = 12
LOSS = (
    2.0**-8
)  # of the state in a step, which the controller does not know: what is at a bound leaves it by more than rounding


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    motions = {
        "falling chain": partial(_falling_chain, 5),
        "dropped box": _dropped_box,
        "catching the pole": partial(_closed_loop, "cart and pole", 25, 1),
        "crane on its way": partial(_closed_loop, "crane", 30, 2),
        "talos shifts its weight": partial(_shifting, "talos_reduced"),
    }
    for title, motion in motions.items():
        for k in range(STEPS):
            yield f"sequence {title} {k:02d}", partial(_step, motion, k)


def _step(motion, k: int) -> SuiteInstance:
    return _all_steps(motion)[k]


@lru_cache
def _all_steps(motion) -> tuple[SuiteInstance, ...]:
    return tuple(motion())


def _falling_chain(n: int) -> Iterator[SuiteInstance]:
    """Velocities after each step of a chain that falls into its stops: no gap closes within the step."""
    scene = chain([1.0] * n)
    for i in range(n):
        scene.stop(f"joint{i}", lowest=-0.35, highest=0.35, name=f"stop{i}")
    system = compile_scene(scene)
    state = system.state(np.linspace(0.3, -0.3, n), np.linspace(-2.0, 4.0, n))
    for k in range(2 * STEPS):
        found, form = gaps(kinematics(system, state)), Coordinates(assemble(system, state, np.zeros(n)))
        n_a = form.J.shape[0]
        rows = found.J[:, :n_a] @ form.J + found.J[:, n_a:]
        free = state.v + STEP * np.linalg.solve(form.M, form.force)
        instance = programme(
            f"sequence falling chain {k // 2:02d}",
            "sequences",
            f"Chain of {n} rods falls into stops of ± 0.35 rad, step {k} of {STEP:g} s: velocities that close no gap.",
            form.M,
            -form.M @ free,
            G=-rows,
            h=found.width / STEP,
            sequence="falling chain",
            variables=tuple(f"joint{i}.rate" for i in range(n)),
            units=("rad/s",) * n,
        )
        v = refined(instance).x.rounded()
        state = system.state(state.q + STEP * v, v)
        if k % 2 == 0:
            yield instance


def _dropped_box() -> Iterator[SuiteInstance]:
    """Velocities after each step of a box that is dropped on its edge and tumbles; eight corners above a floor."""
    half = np.array([0.5, 0.3, 0.2])
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    mass, inertia = 2.0, 2.0 / 3.0 * ((half**2).sum() - half**2)
    tilt, place = np.array([0.3, 0.2, 0.1]), np.array([0.0, 0.0, 0.45])
    R, v = _turned(tilt), np.array([0.5, -1.0, 0.0, 0.2, 0.0, -1.0])
    for k in range(2 * STEPS):
        points = place + corners @ R.T
        contacts = [(0, -1, point, (0.0, 0.0, 1.0)) for point in points]
        heap: Heap = make_heap([mass], inertia, [place], contacts)
        rows, turning = heap.rows(heap.normal), R @ np.diag(inertia) @ R.T
        M = np.zeros((6, 6))
        M[:3, :3], M[3:, 3:] = (turning + turning.T) / 2, mass * np.eye(3)
        load = heap.load.ravel()
        load[:3] = -np.cross(v[:3], turning @ v[:3])
        instance = programme(
            f"sequence dropped box {k // 2:02d}",
            "sequences",
            f"Box falls on its edge and tumbles, step {k} of {STEP:g} s: no corner gets below the floor.",
            M,
            -(M @ v + STEP * load),
            G=-rows,
            h=points[:, 2] / STEP,
            sequence="dropped box",
            **heap.names(("rad/s", "m/s")),
        )
        v = refined(instance).x.rounded()
        place, R = place + STEP * v[3:], _turned(STEP * v[:3]) @ R
        if k % 2 == 0:
            yield instance


def _turned(angles: np.ndarray) -> np.ndarray:
    """Rotation about a vector by its length."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angles).as_matrix()


def _closed_loop(name: str, steps: int, every: int) -> Iterator[SuiteInstance]:
    """Horizons of a controller whose first inputs are applied, with a push in between."""
    plant = PLANTS[name]()
    x, n_u = plant.start, plant.B.shape[1]
    for k in range(every * STEPS):
        title = {"cart and pole": "catching the pole", "crane": "crane on its way"}[name]
        instance = horizon(f"sequence {title} {k // every:02d}", "sequences", plant, steps, x, sequence=title)
        if k % every == 0:
            yield instance
        u = refined(instance).x.rounded()[:n_u]
        x = (1.0 - LOSS) * (plant.A @ x + plant.B @ u) + (0.02 * plant.start if k == 5 * every else 0.0)


def _shifting(name: str) -> Iterator[SuiteInstance]:
    """A humanoid that shifts its weight, one foot carrying less and less: forces are bounded by what it may carry."""
    for k in range(STEPS):
        most, shift = 400.0 * 0.5**k, 2.0 * np.sin(np.pi * k / STEPS)
        title, sequence = f"sequence talos shifts its weight {k:02d}", "talos shifts its weight"
        yield control(name, 0, most=most, shift=float(shift), kind="sequences", title=title, sequence=sequence)
