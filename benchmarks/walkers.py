"""Walking robots of Gymnasium with contacts, stepped with inputs by a simulator, beside MuJoCo at the same step."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

import gauss

STEP, HOLD, ACTIONS = 1e-3, 5, 200  # s, steps of an action, actions of a motion
SHARE = 0.2  # of the largest inputs
MODELS = ("hopper", "walker2d_v5", "half_cheetah", "ant", "humanoid")


def models() -> dict[str, Path]:
    """Files of the robots; none where Gymnasium has none of MuJoCo."""
    package = find_spec("gymnasium")
    if package is None or package.origin is None:
        return {}
    folder = Path(package.origin).parent / "envs" / "mujoco" / "assets"
    return {name: folder / f"{name}.xml" for name in MODELS if (folder / f"{name}.xml").exists()}


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
