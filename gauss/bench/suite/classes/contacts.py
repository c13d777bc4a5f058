"""Many one-sided rows: joints at stops, bodies on many feet, heaps of balls, walls of bricks; without friction."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

from gauss.bench.scenes import chain
from gauss.bench.suite.bodies import Heap, balls, wall
from gauss.bench.suite.classes.mechanisms import of_compulsion
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.scene import Scene


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for n in (4, 8, 16, 32, 64):
        for form in ("F2", "F3"):
            yield f"contacts stops {n} {form}", partial(_stops, n, form)
    for feet in (3, 5, 8, 12, 16):
        yield f"contacts feet {feet}", partial(_feet, feet)
    for count in (8, 27, 64, 125):
        for spread in (0.0, 6.0):
            yield f"contacts balls {count} spread {spread:g}", partial(_balls, count, spread)
    for columns, rows in ((3, 3), (4, 4), (6, 5)):
        yield f"contacts wall {columns} x {rows}", partial(_wall, columns, rows)
    for seed in range(4):
        yield f"contacts impact {seed}", partial(_impact, seed)


def _stops(n: int, form: str) -> SuiteInstance:
    scene, rng = chain([1.0] * n), np.random.default_rng(n)
    angles = rng.uniform(-1.0, 1.0, n)
    for i in range(0, n, 2):
        end: dict[str, Any] = {"highest" if i % 4 else "lowest": float(angles[i])}
        scene.stop(f"joint{i}", **end)
    system = compile_scene(scene)
    effort = 20.0 * rng.standard_normal(n)
    story = f"Chain of {n} rods, every other joint at a stop, under random torques; form {form}."
    return of_compulsion(
        f"contacts stops {n} {form}", "contacts", story, assemble(system, system.state(angles), effort), form
    )


def _feet(count: int) -> SuiteInstance:
    rng = np.random.default_rng(count)
    scene = Scene("feet")
    scene.body("box", 2.0, (0.2, 0.3, 0.25), position=(0, 0, 0.2))
    scene.free("float", "ground", "box")
    points = np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)), np.full(count, -0.2)])
    scene.points("feet", "box", points)
    scene.half_space("floor")
    scene.contact("stands", "feet", "floor")
    system = compile_scene(scene)
    story = f"Box on {count} feet at random places, pushed so that some lift."
    compulsion = assemble(system, system.start(), np.array([8.0, -6.0, 1.0, 2.0, 1.0, -3.0]))
    return of_compulsion(f"contacts feet {count}", "contacts", story, compulsion)


def _balls(count: int, spread: float) -> SuiteInstance:
    story = f"{count} balls in a box, masses 2^(±{spread:g}), pushed at random: accelerations under contact."
    heap = balls(count, seed=count, spread=spread, gaps=True)
    return accelerations(f"contacts balls {count} spread {spread:g}", "contacts", story, heap)


def _wall(columns: int, rows: int) -> SuiteInstance:
    rng = np.random.default_rng(columns)
    push = np.round(16.0 * rng.standard_normal((columns * rows, 6)))
    story = f"Wall of {columns} × {rows} bricks in running bond, each pushed at random: some contacts open."
    return accelerations(f"contacts wall {columns} x {rows}", "contacts", story, wall(columns, rows, push=push))


def _impact(seed: int) -> SuiteInstance:
    """Velocities after a plastic impact: J v ≥ −gap/h, gaps of all contacts different."""
    heap, rng, step = balls(27, seed=seed, gaps=True), np.random.default_rng(seed), 2.0**-7
    rows = heap.rows(heap.normal)
    before = rng.standard_normal(rows.shape[1])
    h = rng.uniform(0.0, 0.01, rows.shape[0]) / step
    M = sparse.diags_array(heap.weights)
    story = f"27 balls at random velocities: those after a step of {step:g} s that closes no gap."
    q = -(heap.weights * before + step * heap.load.ravel())
    names = heap.names(("rad/s", "m/s"))
    return programme(f"contacts impact {seed}", "contacts", story, M, q, G=-rows, h=h, **names)


def accelerations(name: str, kind: str, story: str, heap: Heap) -> SuiteInstance:
    """Accelerations of a heap that starts from rest: least compulsion, no contact closes further."""
    rows, M = heap.rows(heap.normal), sparse.diags_array(heap.weights)
    return programme(name, kind, story, M, -heap.load.ravel(), G=-rows, h=np.zeros(rows.shape[0]), **heap.names())
