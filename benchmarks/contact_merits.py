"""Contacts of many bodies: figures of merit over whole motions, beside MuJoCo at the same step.

Run it with:

    python -m benchmarks.contact_merits [--only SCENE]

Every figure is the worst over all steps and contacts of a motion. gauss repeats the steps of its time stepping one by one:
forces are means over a step, rates those at its end, gaps those that the rates give at its end, before positions are
projected; penetration is that of the states. MuJoCo is asked at the end of each ``mj_step``: its forces, rates and gaps are
those of that instant. Its model is that of ``gauss.save``: contacts as stiff as its step bears, RK4, elliptic friction
cones, Newton solver.

| figure | of contacts with force f, rate u, gap g, least mass m of the bodies, step h |
|---|---|
| Signorini | the smaller one of g and h² f_n / m, without sign [m]: zero if a gap is closed or bears nothing |
| Coulomb | friction beyond μ f_n, relative to the largest normal force of the step |
| dissipation | u_t + f_t · u_t / (μ f_n) [m/s]: zero if friction at its limit opposes the slip, or nothing slips |
| gained | energy that steps add, all together, relative to that of the start over the floor: nothing drives the bodies |
| balance | energy and what contacts dissipate, against the energy of the start, relative to this (gauss) |
| penetration | deepest one [m], as in the table of times |
| h to h/2 | largest distance of a body's centre from where half the step leads it [m]; chaotic heaps have large ones |

Dissipation counts where f_n is more than a thousandth of the weight of a body: smaller forces tell no direction.

Writes benchmarks/results/contact_merits.md and .csv.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

import gauss
from benchmarks import convex_meshes, free_bodies
from benchmarks.command import chosen, command, load_at_the_end
from benchmarks.contacts import in_mujoco
from benchmarks.convex_meshes import mesh_depth
from gauss.bench.machine import header
from gauss.bench.markdown import head, table
from gauss.dynamics.contact.asleep_bodies import BodySleepers
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.gap_laws import gap_after
from gauss.system import State

STEP, g = 1e-3, 9.81
LOADED = 1e-3  # of the weight of a body: smaller normal forces do not tell a direction of slip
FIGURES = ("signorini", "coulomb", "dissipation", "gained", "balance", "penetration", "halved")
TITLES = ("scene", "method", "Signorini", "Coulomb", "dissipation", "gained", "balance", "penetration", "h to h/2")


class Instant(NamedTuple):
    """End of a step: coordinates (n, 7), contacts, energy, and what contacts dissipated since the start [J].

    ``force`` and ``rate`` (m, 3) are along normals and two tangents [N, m/s], ``gap`` (m,) [m], ``friction`` (m,).
    """

    q: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    gap: np.ndarray
    friction: np.ndarray
    energy: float
    dissipated: float = np.nan


class Recorder(FreeBodyStepper):
    """Steps of free bodies that keep the rates and gaps at which their laws hold."""

    def _changed_modes(self, near, begun, known, force, reached, work, h, share):
        time = (1.0 - share) * h
        self.reached = reached + time * near.bias, gap_after(near.gap, reached[:, 0], near.bias[:, 0], time)
        return super()._changed_modes(near, begun, known, force, reached, work, h, share)


def ours(scene: gauss.Scene, end: float, step: float) -> Iterator[Instant]:
    """Ends of the steps of gauss, the start first."""
    system = gauss.compile_scene(scene)
    stepper, state, dissipated = Recorder(system), system.initial_state(), 0.0
    masses = np.array([body.mass for body in scene.bodies.values()])
    empty = np.zeros((0, 3))
    yield Instant(state.q.reshape(-1, 7), empty, empty, empty[:, 0], empty[:, 0], _energy(stepper, state, masses), 0.0)
    for k in range(round(end / step)):
        found = stepper.python_step(state, step)
        state = State((k + 1) * step, found.q, found.v)
        dissipated += step * float(found.power[2])
        friction = stepper.table.friction[found.contacts.law]
        laws = found.force, *stepper.reached, friction
        yield Instant(state.q.reshape(-1, 7).copy(), *laws, _energy(stepper, state, masses), dissipated)


def _energy(stepper: FreeBodyStepper, state: State, masses: np.ndarray) -> float:
    return float(BodySleepers(stepper).kinetic_energies(state).sum() + g * masses @ state.q.reshape(-1, 7)[:, 2])


def theirs(scene: gauss.Scene, end: float, step: float) -> Iterator[Instant]:
    """Ends of the steps of MuJoCo, the start first."""
    model = in_mujoco(scene, step)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(end / step) + 1):
        mujoco.mj_forward(model, data)
        rates, contacts = np.zeros(data.nefc), data.contact
        mujoco.mj_mulJacVec(model, data, rates, data.qvel)
        places = np.array(contacts.efc_address)
        kept = places >= 0
        rows = places[kept, None] + np.arange(3) if kept.any() else np.zeros((0, 3), dtype=int)
        laws = data.efc_force[rows], rates[rows], np.array(contacts.dist)[kept], np.array(contacts.friction)[kept, 0]
        yield Instant(data.qpos.reshape(-1, 7).copy(), *laws, float(data.energy.sum()))
        mujoco.mj_step(model, data)


def merits(instants: list[Instant], deepest: Callable, mass: float, step: float) -> dict[str, float]:
    """Worst figures of a motion; of a missing balance NaN."""
    signorini, coulomb, dissipation = [0.0], [0.0], [0.0]
    for now in instants:
        push, across, slip = now.force[:, 0], np.hypot(*now.force[:, 1:].T), np.hypot(*now.rate[:, 1:].T)
        signorini.append(np.abs(np.minimum(now.gap, step**2 * push / mass)).max(initial=0.0))
        most = push.max(initial=0.0)
        coulomb.append((across - now.friction * push).max(initial=0.0) / most if most > 0.0 else 0.0)
        held = (push > LOADED * mass * g) & (now.friction > 0.0)
        power = (now.force[:, 1:] * now.rate[:, 1:]).sum(axis=1)
        dissipation.append((slip[held] + power[held] / (now.friction * push)[held]).max(initial=0.0))
    energy, lost = (np.array([getattr(now, name) for now in instants]) for name in ("energy", "dissipated"))
    scale = energy[0]
    return {
        "signorini": max(signorini),
        "coulomb": max(coulomb),
        "dissipation": max(dissipation),
        "gained": np.diff(energy).clip(min=0.0).sum() / scale,
        "balance": np.abs(energy + lost - energy[0]).max() / scale,
        "penetration": max(deepest(now.q) for now in instants),
    }


def scenes() -> dict[str, tuple[gauss.Scene, float, Callable]]:
    """Scenes, durations [s] and deepest penetrations."""
    heap, wide = convex_meshes.heap(50), 0.28
    return {
        "stack of 10 boxes": (free_bodies.stack(10), 0.3, lambda q: free_bodies.box_depth(q, (free_bodies.EDGE,) * 3)),
        "10 dominoes": (free_bodies.dominoes(10, push=3.0), 0.6, lambda q: free_bodies.box_depth(q, free_bodies.TILE)),
        "30 balls in a bin": (free_bodies.bin_of_balls(30), 1.0, lambda q: free_bodies.ball_depth(q, free_bodies.WALL)),
        "100 balls in a bin": (free_bodies.bin_of_balls(100, wall=wide), 0.6, lambda q: free_bodies.ball_depth(q, wide)),
        "50 convex meshes in a bin": (heap, 0.4, lambda q: mesh_depth(heap, q)),
    }


def rows(only: str) -> list[dict]:
    """Rows of the table."""
    found, all_scenes = [], scenes()
    for name in chosen(only, all_scenes):
        scene, end, deepest = all_scenes[name]
        mass = min(body.mass for body in scene.bodies.values())
        for method, motion in (("gauss, time_stepping", ours), ("mujoco.mj_step", theirs)):
            whole, halved = list(motion(scene, end, STEP)), list(motion(scene, end, 0.5 * STEP))[::2]
            row = {"scene": name, "method": f"{method}, {STEP:g} s"} | merits(whole, deepest, mass, STEP)
            apart = [np.linalg.norm(a.q[:, :3] - b.q[:, :3], axis=1).max() for a, b in zip(whole, halved, strict=True)]
            found.append(row | {"halved": max(apart)})
            print(*line(found[-1]), sep=" | ", flush=True)
    return found


def line(row: dict) -> list[str]:
    """Cells of a row of the page."""
    numbers = [float(row[name]) for name in FIGURES]
    return [row["scene"], row["method"], *("" if np.isnan(number) else f"{number:.1e}" for number in numbers)]


def page(found: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    about = __doc__.split("\n\n", 3)[3].rsplit("\n\n", 1)[0]
    return [*head("Contacts: figures of merit over motions", conditions), *table(TITLES, map(line, found)), "", about, ""]


def measured(only: str) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    found = rows(only)
    return found, [*header("numpy", "mujoco", "llvmlite"), load_at_the_end()]


if __name__ == "__main__":
    command("contact_merits", __doc__, measured, page, {"only": ("", "part of the names of scenes")})
