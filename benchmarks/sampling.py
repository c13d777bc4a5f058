"""Many motions with inputs of their own: rollouts of sampling control beside mujoco.rollout, environments beside MuJoCo's.

Run it with:

    python -m benchmarks.sampling [--rounds 7]

Sampling control is ``models/examples/control/mppi.py``: 4096 motions of 50 control intervals, each of 4 steps of RK4
of 5 ms, on one thread. MuJoCo makes the same steps of the same mechanism, its forces given as ``qfrc_applied``; a
control step adds to the rollouts the noise, the costs and the weights of the law, which are the same for both.
``mujoco.rollout`` returns every step, gauss every fourth. Of a Panda that is thrown about, rounding grows to the
difference at the end. Environments are Gymnasium's; an action of a cart-pole of gauss is 10 steps of RK4, one of
MuJoCo's InvertedPendulum-v5 is 2. CPU time of the process; medians of rounds. Writes benchmarks/results/sampling.csv
and .md.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("GAUSS_TIER", "optimised")

import importlib.util  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Callable, Iterator  # noqa: E402
from pathlib import Path  # noqa: E402
from statistics import median  # noqa: E402
from typing import Any  # noqa: E402

import gymnasium  # noqa: E402
import mujoco  # noqa: E402
import mujoco.rollout  # noqa: E402
import numpy as np  # noqa: E402

import gauss  # noqa: E402
import gauss.gym  # noqa: E402
from benchmarks.command import agreeing, command, load_at_the_end  # noqa: E402
from gauss.bench.contest import OURS, Competitor, difference, interleaved  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import formatted_table, head, in_time  # noqa: E402
from gauss.io.mjcf.write import to_mjcf  # noqa: E402

EXAMPLE = Path(__file__).parents[1] / "models" / "examples" / "control" / "mppi.py"
MUJOCO, LAW = "MuJoCo", "law"
ACTIONS = 50  # of an environment in a run
MANY = 1024  # motions of a vector environment of gauss
GROWN = 1e-4  # relative difference at the end to which rounding may have grown
FEW = 16  # of one of MuJoCo's, which makes its motions one after the other


def example():
    """The module of the example."""
    spec = importlib.util.spec_from_file_location("mppi", EXAMPLE)
    assert spec is not None and spec.loader is not None  # the file is there
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class MujocoRollout:
    """Rollouts of a scene by MuJoCo, with inputs as generalised forces.

    Parameters
    ----------
    system : System
        The system; its inputs are efforts of joints.
    run : dict
        Number and length of the steps, and how many of them hold an input.
    """

    def __init__(self, system: gauss.System, run: dict):
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(system.scene))
        self.model.opt.integrator, self.model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, run["step"]
        self.data, self.every = mujoco.MjData(self.model), run["every"]
        joints = [given.joint for given in system.scene.inputs.values()]
        self.places = [int(self.model.joint(name).dofadr[0]) for name in joints]
        self.columns = [int(self.model.joint(joint.name).dofadr[0]) for joint in system.joints if joint.pair.n_v]

    def __call__(self, q, v, control) -> np.ndarray:
        """States (batch, steps, n) from one start under inputs (batch, rows, n_u)."""
        self.data.qpos[self.columns], self.data.qvel[self.columns] = q, v
        start = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(self.model, self.data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        forces = np.zeros((*control.shape[:2], self.model.nv))
        forces[..., self.places] = control
        forces = np.repeat(forces, self.every, axis=1)
        spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED
        return mujoco.rollout.rollout(
            self.model, [self.data], np.tile(start, (len(control), 1)), forces, control_spec=int(spec), nstep=forces.shape[1]
        )[0]


def sampling(rounds: int) -> Iterator[dict]:
    """Rollouts, and whole control steps, of the two mechanisms of the example."""
    module = example()
    for name, make in (("cart-pole", module.cart_pole), ("Panda", module.panda)):
        scene, cost, _ = make()
        law = module.Mppi(scene, cost)
        law.run["threads"] = 1
        system, start = law.system, law.system.initial_state()
        control = np.clip(0.5 * law.high * np.random.default_rng(1).standard_normal(law.shape), -law.high, law.high)
        starts = np.tile(start.q, (len(control), 1)), np.tile(start.v, (len(control), 1))
        ours = lambda s=system, x=starts, c=control, run=law.run: gauss.rollout(s, *x, control=c, **run)  # noqa: E731
        peer = MujocoRollout(system, law.run)
        theirs = lambda p=peer, s=start, c=control: p(s.q, s.v, c)  # noqa: E731
        ends = theirs()[:, -1, 1 : 1 + peer.model.nq][:, peer.columns]
        agreement = agreeing(difference(ours().q[:, -1], ends), GROWN, name)
        tasks = {
            OURS: Competitor(ours),
            MUJOCO: Competitor(theirs),
            LAW: Competitor(lambda f=law, s=start: f(0.0, s.q, s.v)),
        }
        found = {task: median(seconds) for task, seconds in interleaved(tasks, rounds).items()}
        yield {"name": name, "motions": len(control), "steps": law.run["steps"], **found, "agreement": agreement}


def environments(rounds: int) -> Iterator[dict]:
    """Environments of one motion and of many."""
    task = gauss.gym.cart_pole_swing_up()
    one, many = gauss.gym.MechanismEnv(task), gauss.gym.MechanismVectorEnv(task, MANY)
    pendulum: Callable[[], Any] = lambda: gymnasium.make("InvertedPendulum-v5").unwrapped  # noqa: E731
    peer, peers = pendulum(), gymnasium.vector.SyncVectorEnv([pendulum] * FEW)
    asked: dict[str, tuple[Any, int, int]] = {
        "cart-pole of gauss": (one, 1, task.hold),
        f"{MANY} cart-poles of gauss": (many, MANY, task.hold),
    }
    asked |= {"InvertedPendulum-v5": (peer, 1, peer.frame_skip)}
    asked |= {f"{FEW} of InvertedPendulum-v5": (peers, FEW, peer.frame_skip)}
    for environment, *_ in asked.values():
        environment.reset(seed=0)
    tasks = {name: Competitor(_acting(environment), count * ACTIONS) for name, (environment, count, _) in asked.items()}
    for name, seconds in interleaved(tasks, rounds).items():
        _, count, hold = asked[name]
        yield {"name": name, "motions": count, "steps": hold, OURS: median(seconds)}


def _acting(environment) -> Callable[[], None]:
    """Actions drawn once, then held; episodes that end begin anew."""
    action = environment.action_space.sample()

    def run():
        for _ in range(ACTIONS):
            _, _, terminated, truncated, _ = environment.step(action)
            if not hasattr(environment, "num_envs") and (terminated or truncated):
                environment.reset()

    return run


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows of both tables, and the conditions."""
    warnings.simplefilter("ignore")  # of robots whose files hold more than is read
    conditions = header("numpy", "mujoco", "gymnasium")
    rows = [*sampling(rounds), *environments(rounds)]
    return [dict.fromkeys(rows[0], "") | row for row in rows], [*conditions, load_at_the_end()]


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """The page of the tables."""
    motions, acting = ([row for row in rows if (row[MUJOCO] != "") == of_motions] for of_motions in (True, False))
    for row in motions:
        rest = max(row[LAW] - row[OURS], 0.0)
        row |= {"ratio": row[MUJOCO] / row[OURS], "rate": 1.0 / row[LAW], "their rate": 1.0 / (row[MUJOCO] + rest)}
        row |= {"a step": in_time(row[OURS] / row["motions"] / row["steps"])}
    for row in acting:
        row |= {"actions": 1.0 / row[OURS], "steps a second": row["steps"] / row[OURS]}
    columns = {"mechanism": "{name}", "motions": "{motions:.0f}", "steps": "{steps:.0f}", "gauss": f"{{{OURS}:.3f}} s"}
    columns |= {"of that a step of a motion": "{a step}", "mujoco.rollout": f"{{{MUJOCO}:.3f}} s", "ratio": "{ratio:.1f}"}
    columns |= {"control steps a second": "{rate:.2f}", "with mujoco.rollout": "{their rate:.2f}"}
    columns |= {"difference at the end": "{agreement:.0e}"}
    environments = {"environment": "{name}", "steps an action": "{steps:.0f}", "actions a second": "{actions:.3g}"}
    environments |= {"steps a second": "{steps a second:.3g}"}
    lines = [*head("Many motions with inputs of their own", conditions), "## Rollouts of sampling control, one thread", ""]
    lines += [*formatted_table(columns, motions), "", "## Environments of Gymnasium", ""]
    return [*lines, *formatted_table(environments, acting), ""]


if __name__ == "__main__":
    command("sampling", __doc__, measure, page, {"rounds": (7, "interleaved repetitions")})
