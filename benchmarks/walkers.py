"""Public models with contacts, stepped with inputs by a simulator, beside MuJoCo at the same step.

They are read where their packages are installed: walking robots of Gymnasium; a quadruped with a ball, a walker, and an arm
with a gripper of dm_control, of which files alone are needed (``pip install --no-deps dm_control``).
"""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

import gauss

STEP, HOLD, ACTIONS = 1e-3, 5, 200  # s, steps of an action, actions of a motion
SHARE = 0.2  # of the largest inputs
MODELS = (  # package, folder in it, names of files
    ("gymnasium", "envs/mujoco/assets", ("hopper", "walker2d_v5", "half_cheetah", "ant", "humanoid")),
    ("dm_control", "suite", ("walker", "quadruped", "manipulator")),
)


def models() -> dict[str, Path]:
    """Files of the models by their names; what is not installed is said and left out."""
    found: dict[str, Path] = {}
    for package, folder, names in MODELS:
        spec = find_spec(package)
        place = None if spec is None or spec.origin is None else Path(spec.origin).parent / folder
        files = {} if place is None else {_title(package, name): place / f"{name}.xml" for name in names}
        there = {name: file for name, file in files.items() if file.exists()}
        found |= there
        if len(there) < len(names):
            print(f"left out, as {package} is not installed or has no such files: {', '.join(names)}")
    return found


def _title(package: str, name: str) -> str:
    return name if package == MODELS[0][0] else f"{name} of {package}"


def ours(file: Path) -> tuple[Callable, Callable]:
    """Motion of a simulator, made at the first call, and its deepest penetration [m]."""
    made: list[gauss.Simulator] = []
    actions = np.random.default_rng(0).uniform(-SHARE, SHARE, (ACTIONS, 100))

    def motion() -> gauss.Simulator:
        if not made:
            made.append(gauss.Simulator(gauss.load(file, limits="stops", contacts=True), STEP))
        simulator = made[0]
        largest = np.array([max(map(abs, given.bounds)) for given in simulator.system.scene.inputs.values()])
        simulator.reset()
        for action in actions:
            simulator.step(largest * action[: largest.size], n=HOLD)
        return simulator

    return motion, lambda simulator: penetration(simulator.system, simulator.state)


def penetration(system: gauss.System, state: gauss.State) -> float:
    """Deepest penetration of shapes [m], by the distance that they are to be moved apart."""
    apart = gauss.resolve_overlaps(system, state)
    return float(np.abs(apart.q - state.q).max())


def theirs(file: Path) -> tuple[Callable, Callable]:
    """The same by MuJoCo."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data, largest = mujoco.MjData(model), np.abs(model.actuator_ctrlrange).max(axis=1, initial=0.0)
    model.opt.timestep = STEP
    actions = np.random.default_rng(0).uniform(-SHARE, SHARE, (ACTIONS, 100))

    def motion() -> mujoco.MjData:
        mujoco.mj_resetData(model, data)
        for action in actions:
            data.ctrl[:] = largest * action[: largest.size]
            mujoco.mj_step(model, data, nstep=HOLD)
        return data

    return motion, lambda found: max(0.0, -float(found.contact.dist.min(initial=0.0)))
