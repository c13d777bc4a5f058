"""What control costs from Python: steps, samples of held inputs, opaque laws, prepared motions, forces, derivatives.

Run it with:

    python -m benchmarks.control [--rounds 15]

Each row has a goal, which stands beside the median and the least of the rounds (CPU time of the process): on a machine with
other work the least is nearer to what the call costs. What is called an overhead is the difference of two tasks that make
the same steps. Writes benchmarks/results/control.csv and .md.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("GAUSS_TIER", "optimised")

import warnings  # noqa: E402
from collections.abc import Callable, Iterator  # noqa: E402
from statistics import median  # noqa: E402
from typing import Any, NamedTuple  # noqa: E402

import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

import gauss  # noqa: E402
from benchmarks.command import command, load_at_the_end  # noqa: E402
from benchmarks.latency.scenes import FEET, biped  # noqa: E402
from benchmarks.loop_contacts import LoopContacts  # noqa: E402
from gauss.analysis.crosscheck.pinocchio_ import twin  # noqa: E402
from gauss.bench.contest import Competitor, interleaved, repeated  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import formatted_table, head, in_time  # noqa: E402

STEP, STEPS, CALLS = 1e-3, 1000, 200
MOTIONS = 1024  # of a rollout
POSE = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.7, 0.02, 0.02])  # of a Panda that is held


class Row(NamedTuple):
    """A task, and what is subtracted from it.

    Attributes
    ----------
    name : str
        What is measured.
    goal : float
        Most that it should cost [s]; a ratio where ``is_ratio``.
    run : callable
        The task.
    units : float
        Of the task.
    without : callable, optional
        A task that makes the same but for what is measured, of as many units.
    is_ratio : bool
        Whether the two are divided instead of subtracted.
    """

    name: str
    goal: float
    run: Callable
    units: int = 1
    without: Callable | None = None
    is_ratio: bool = False


def panda(inputs: bool = True) -> gauss.Scene:
    """Panda with free fingers, a motor in each joint."""
    scene = gauss.load("robot:panda", mimic=False)
    for joint in [name for name, one in scene.joints.items() if one.pair.n_v]:
        if inputs:
            scene.input(f"motor of {joint}", joint, limits=80.0)
    return scene


def stepping() -> Iterator[Row]:
    """Steps of a simulator, samples of held inputs."""
    system = gauss.compile_scene(panda())
    simulator, zero = gauss.Simulator(system, STEP), np.zeros(system.n_v)

    def singly():
        simulator.reset()
        for _ in range(STEPS):
            simulator.step(zero)

    def together():
        simulator.reset()
        simulator.step(zero, n=STEPS)

    def held(rate: float, **how):
        run: dict[str, Any] = {"control": lambda t, q, v: zero, "progress": False, "times": [0.0, STEPS * STEP]} | how
        return lambda: gauss.simulate(system, STEPS * STEP, rate=rate, **run)

    yield Row("`Simulator.step` of a Panda, RK4, in all", 4e-6, singly, STEPS)
    yield Row("the same, beyond the step in machine code", 3e-6, singly, STEPS, together)
    rk4: dict[str, Any] = {"integrator": "rk4", "step": STEP}
    yield Row("a sample of held inputs, with its law, RK4", 5e-6, held(STEPS, **rk4), STEPS, held(1.0, **rk4))
    yield Row("a sample of held inputs at 1 kHz, with its law and its steps, DOP853", 3e-5, held(STEPS, rtol=1e-6), STEPS)

    def law(t, q, v):
        return system.inverse_dynamics(q, v, 100.0 * (POSE - q) - 20.0 * v)

    run: dict[str, Any] = {"control": law, "rate": 1000.0, "progress": False}
    yield Row("computed torque of a Panda, 5 s at 1 kHz, RK4", 0.5, lambda: gauss.simulate(system, 5.0, **run, **rk4))
    yield Row("the same, DOP853", 0.5, lambda: gauss.simulate(system, 5.0, rtol=1e-6, **run))


def laws_and_motions() -> Iterator[Row]:
    """Opaque laws, prepared motions."""
    scene = panda(inputs=False)
    joint = next(name for name, one in scene.joints.items() if one.pair.n_v)
    scene.drive(joint, torque=lambda t, at: -0.3 * float(at.rate(joint)))
    system, simulator = gauss.compile_scene(scene), gauss.Simulator(scene, STEP)
    run: dict[str, Any] = {"integrator": "rk4", "step": STEP, "progress": False, "times": [0.0, STEPS * STEP]}
    opaque, stages = lambda: gauss.simulate(system, STEPS * STEP, **run), 4 * STEPS
    yield Row("an evaluation of a Panda with an opaque law, by `simulate`", 15e-6, opaque, stages)

    def stepped():
        simulator.reset()  # its fingers fly off without limits
        simulator.step(n=STEPS)

    yield Row("the same, by `Simulator`", 15e-6, stepped, stages)
    prepared = gauss.prepare(gauss.load("pendulum"), 1e-9)
    yield Row("a prepared motion of one step", 5e-6, repeated(prepared, CALLS), CALLS)


def rollouts() -> Iterator[Row]:
    """Steps of batches."""
    for name, scene in (("Panda", panda()), ("cart-pole", gauss.load("cart_pole"))):
        if name == "cart-pole":
            scene.input("push", "rail", limits=10.0)
        system = gauss.compile_scene(scene)
        start, shape = system.initial_state(), (MOTIONS, 50, len(scene.inputs))
        starts = np.tile(start.q, (MOTIONS, 1)), np.tile(start.v, (MOTIONS, 1))
        control = np.random.default_rng(1).uniform(-1.0, 1.0, shape)
        run: dict[str, Any] = {"steps": 200, "step": STEP, "every": 200}
        own = lambda s=system, x=starts, u=control, how=run: gauss.rollout(s, *x, control=u, **how)  # noqa: E731
        none = lambda s=system, x=starts, how=run: gauss.rollout(s, *x, **how)  # noqa: E731
        yield Row(f"rollout of a {name} with inputs of each lane, over that without", 1.2, own, 1, none, is_ratio=True)
    system = gauss.compile_scene(biped(FEET))
    start = system.initial_state()
    starts = np.tile(start.q, (256, 1)), np.tile(start.v, (256, 1))
    run = {"steps": 50, "step": 1e-4, "every": 50}
    yield Row(
        "an RK4 step of a biped with two loops, in lanes", 4e-6, lambda: gauss.rollout(system, *starts, **run), 256 * 50
    )


def forces() -> Iterator[Row]:
    """Forces of all samples of a motion."""
    scene = gauss.load("stewart_platform")
    legs = [name for name, joint in scene.joints.items() if joint.pair.kind == "prismatic"]
    for leg in legs:
        scene.drive(leg, force=lambda t, at, leg=leg: 100.0 - 50.0 * at.rate(leg))
    system = gauss.compile_scene(scene)
    given = gauss.simulate(system, 0.2, times=np.linspace(0.0, 0.2, 10_000), progress=False)
    fresh = lambda: gauss.Trajectory.from_coordinates(system, given.t, given.q, given.v)  # noqa: E731

    def ask(question: Callable):
        motion = fresh()
        return [question(motion, leg) for leg in legs]

    for question in (gauss.reactions, gauss.drive_forces):
        name = f"`{question.__name__}` of all legs of a Stewart platform, 10 000 samples"
        yield Row(name, 0.2, lambda asked=question: ask(asked), 1, fresh)


def derivatives() -> Iterator[Row]:
    """Derivatives of accelerations, beside Pinocchio's."""
    for name, scene, goal, theirs in (
        ("Panda", panda(inputs=False), 5e-6, "`computeABADerivatives`"),
        ("biped with two loops", biped(FEET), 60e-6, "`constraintDynamics` and `computeConstraintDynamicsDerivatives`"),
    ):
        system = gauss.compile_scene(scene)
        state, load = system.initial_state(), np.zeros(system.n_v)
        call = lambda f=system.acceleration_derivatives, s=state, u=load: f(s.q, s.v, u)  # noqa: E731
        what, ours = f"`acceleration_derivatives` of a {name}", repeated(call, CALLS)
        yield Row(f"{what}, one call", goal, ours, CALLS)
        peer = repeated(_by_pinocchio(system, state), CALLS)
        yield Row(f"{what}, over {theirs} of Pinocchio", 1.0, ours, CALLS, peer, is_ratio=True)


def _by_pinocchio(system: gauss.System, state: gauss.State) -> Callable:
    """Call of Pinocchio's derivatives of the accelerations."""
    pair = twin(system)
    model, data, at = pair.model, pair.model.createData(), pair.configuration(state)
    if system.is_tree:
        return lambda: pin.computeABADerivatives(model, data, at.q, at.v, np.zeros(model.nv))
    return LoopContacts(pair, at).derivatives


def measure(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows of the table, and the conditions."""
    warnings.simplefilter("ignore")  # of laws that are seldom evaluated, and robots whose files hold more than is read
    conditions = header("numpy", "pin")
    rows = []
    for row in (*stepping(), *laws_and_motions(), *rollouts(), *forces(), *derivatives()):
        tasks = {"run": row.run} | ({} if row.without is None else {"without": row.without})
        seconds = interleaved({name: Competitor(task, row.units) for name, task in tasks.items()}, rounds)
        found = {"name": row.name, "goal": row.goal, "ratio": int(row.is_ratio)}
        rows.append(found | {which.__name__: _cost(seconds, which, row.is_ratio) for which in (median, min)})
    return rows, [*conditions, load_at_the_end()]


def _cost(seconds: dict[str, list[float]], of: Callable, is_ratio: bool) -> float:
    """What a row costs, by the median or the least of its tasks."""
    cost = of(seconds["run"])
    if "without" in seconds:
        without = of(seconds["without"])
        cost = cost / without if is_ratio else cost - without
    return cost


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """The page of the table."""
    shown = [
        {"name": row["name"]}
        | {key: f"{row[key]:.2f}" if row["ratio"] else in_time(row[key]) for key in ("goal", "median", "min")}
        for row in rows
    ]
    columns = {"what": "{name}", "goal": "{goal}", "median": "{median}", "least": "{min}"}
    return [*head("What control costs from Python", conditions), *formatted_table(columns, shown), ""]


if __name__ == "__main__":
    command("control", __doc__, measure, page)
