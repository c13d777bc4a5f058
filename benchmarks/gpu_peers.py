"""MuJoCo Warp and MJX (JAX) on the same GPU, each at its fastest: batches of one model, nothing computed that is not needed.

MuJoCo Warp computes in single precision, its steps are replayed as one CUDA graph. MJX computes in double precision, as one
compiled loop. Loops of a scene are soft constraints in both, whose residual is not that of gauss. Packages are imported when
they are asked for; one that is not installed is a row that says so.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from statistics import median

import numpy as np

import gauss
from gauss.bench.contest import duration

OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS", "SPRING", "DAMPER", "PASSIVE", "ACTUATION", "CLAMPCTRL", "SENSOR")  # of MuJoCo
PEERS: dict[str, Callable] = {}
Work = dict[str, tuple[Callable[[], object], int]]  # what is run, and evaluations or steps of a motion in it


def rows(
    name: str, scene: gauss.Scene, q: np.ndarray, v: np.ndarray, steps: int, step: float, rounds: int
) -> Iterator[dict]:
    """Rows of all peers: forward dynamics of states, and RK4 steps of motions from them."""
    for peer, prepared in PEERS.items():
        try:
            works = prepared(_model(scene, step), q, v, steps)
        except ImportError as error:
            yield {"scene": name, "peer": peer, "work": f"not installed ({error.name})"}
            continue
        for work, (run, units) in works.items():
            run()
            yield {"scene": name, "peer": peer, "work": work, "time": seconds(run, rounds) / (len(q) * units)}


def seconds(run: Callable, rounds: int) -> float:
    """Median time of a run by the clock."""
    return median(duration(run, time.perf_counter) for _ in range(rounds))


def _model(scene: gauss.Scene, step: float):
    """MuJoCo's model: RK4, and only what the scene has."""
    import mujoco

    from gauss.io.mjcf.write import to_mjcf

    spec = mujoco.MjSpec.from_string(to_mjcf(scene))
    spec.compiler.fusestatic = True
    model = spec.compile()
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_RK4
    off = OFF if model.neq else (*OFF, "CONSTRAINT", "EQUALITY")
    for name, bit in mujoco.mjtDisableBit.__members__.items():
        if name.removeprefix("mjDSBL_") in off:
            model.opt.disableflags |= int(bit)
    return model


def _fitting(states: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """States in coordinates of MuJoCo, as many; its reference configuration where it has other ones."""
    return states if states.shape[1] == usual.size else np.tile(usual, (len(states), 1))


def _warp(model, q: np.ndarray, v: np.ndarray, steps: int) -> Work:
    """Work of MuJoCo Warp."""
    import mujoco
    import mujoco_warp
    import warp

    there, data = mujoco_warp.put_model(model), mujoco_warp.put_data(model, mujoco.MjData(model), nworld=len(q))
    data.qpos.assign(_fitting(q, model.qpos0).astype(np.float32))
    data.qvel.assign(_fitting(v, np.zeros(model.nv)).astype(np.float32))

    def replayed(run: Callable) -> Callable:
        run()
        if not warp.get_device().is_cuda:
            return run
        with warp.ScopedCapture() as capture:
            run()
        return partial(warp.capture_launch, capture.graph)

    def finished(run: Callable) -> Callable:
        def work():
            run()
            warp.synchronize()

        return work

    one = replayed(lambda: mujoco_warp.step(there, data))
    forward = replayed(lambda: mujoco_warp.forward(there, data))
    return {
        "forward dynamics": (finished(forward), 1),
        "RK4 step": (finished(lambda: [one() for _ in range(steps)]), steps),
    }


def _mjx(model, q: np.ndarray, v: np.ndarray, steps: int) -> Work:
    """Work of MJX."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from mujoco import mjx

    there = mjx.put_model(model)
    blank = mjx.make_data(model)
    start = jax.vmap(lambda x, rate: blank.replace(qpos=x, qvel=rate))
    data = start(jax.numpy.array(_fitting(q, model.qpos0)), jax.numpy.array(_fitting(v, np.zeros(model.nv))))
    forward = jax.jit(jax.vmap(lambda d: mjx.forward(there, d).qacc))
    move = jax.jit(jax.vmap(lambda d: jax.lax.fori_loop(0, steps, lambda _, x: mjx.step(there, x), d).qpos))
    return {
        "forward dynamics": (lambda: forward(data).block_until_ready(), 1),
        "RK4 step": (lambda: move(data).block_until_ready(), steps),
    }


PEERS |= {"MuJoCo Warp, single precision": _warp, "MJX (JAX), double precision": _mjx}
