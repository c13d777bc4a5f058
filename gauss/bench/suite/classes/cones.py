"""Friction as second-order cones: forces of the convex step of contact (Anitescu 2006), its velocities, and grasps."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.suite.bodies import Heap, balls, stack, table, wall
from gauss.bench.suite.classes.whole_body import FEET, control
from gauss.bench.suite.instance import SuiteInstance, programme

STEP = 2.0**-7  # [s], of time stepping
SOFT = 2.0**-12  # compliance, of the largest diagonal entry of W: forces of more contacts than freedoms are unique with it

SLIDING = ("block tilt 0.5 friction 0.25", "block tilt 1", "balls 1")  # no more rows stick than there are freedoms


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for name, heap, friction in heaps():
        yield f"cones {name}", partial(forces, "cones", f"cones {name}", heap, friction)
    for name, heap, friction in heaps():
        if name.startswith(SLIDING):
            yield f"cones velocities {name}", partial(_velocities, f"cones velocities {name}", heap, friction)
    for fingers in (3, 5, 7, 8):
        yield f"cones grasp {fingers}", partial(_grasp, fingers)
    for robot in FEET:
        title = f"cones whole body {robot}"
        yield title, partial(control, robot, 0, kind="cones", title=title)


def heaps() -> Iterator[tuple[str, Heap, float]]:
    """Bodies with friction: name, heap, coefficient."""
    for tilt in (0.25, 0.5, 1.0):
        for friction in (0.25, 0.75):
            slope = (10.0 * tilt, 2.0, -10.0)
            yield f"block tilt {tilt:g} friction {friction:g}", table(4, height=0.5, gravity=slope), friction
    for count, push in ((2, 4.0), (3, 16.0), (4, 16.0)):
        load = np.zeros((count, 6))
        load[-1, 3] = push
        yield f"stack {count} pushed", stack(count, push=load), 0.5
    for columns, rows in ((2, 2), (3, 2), (4, 2)):
        load = np.zeros((columns * rows, 6))
        load[0, 3], load[-1, 4] = 4.0, 8.0
        yield f"wall {columns} x {rows}", wall(columns, rows, push=load), 0.375
    for count in (1, 4, 8):
        yield f"balls {count}", balls(count, seed=count), 0.5


def forces(kind: str, name: str, heap: Heap, friction: float) -> SuiteInstance:
    """Impulses of contacts over a step: ½ rᵀ W r + qᵀ r over the cones |r_t| ≤ μ r_n."""
    H, count = heap.all_rows(), len(heap.pairs)
    W = (H @ sparse.diags_array(1.0 / heap.weights) @ H.T).toarray()
    W = (W + W.T) / 2 + SOFT * 2.0 ** np.round(np.log2(W.diagonal().max())) * np.eye(W.shape[0])
    G = -sparse.diags_array(np.tile([friction, 1.0, 1.0], count))
    law = {"friction": np.full(count, friction)} if kind == "coulomb" else {}
    axes = ("n", "t1", "t2")
    return programme(
        name,
        kind,
        f"Impulses of {count} contacts of {heap.mass.size} bodies over a step of {STEP:g} s, friction {friction:g}, soft by "
        f"{SOFT:g} of the stiffness" + (", by Coulomb's law." if law else "; the convex step."),
        W,
        STEP * (H @ heap.free),
        G=G,
        h=np.zeros(3 * count),
        cones=(3,) * count,
        variables=tuple(f"contact{i}.{axis}" for i in range(count) for axis in axes),
        units=("N s",) * (3 * count),
        **law,
    )


def _velocities(name: str, heap: Heap, friction: float) -> SuiteInstance:
    """Velocities after a step of the convex law: u in the dual cone, u_n ≥ μ |u_t|."""
    H, count = heap.all_rows(), len(heap.pairs)
    M = sparse.diags_array(heap.weights)
    G = -sparse.diags_array(np.tile([1.0, friction, friction], count)) @ H
    story = (
        f"Velocities of {heap.mass.size} bodies after a step of {STEP:g} s, {count} contacts, friction {friction:g}; convex."
    )
    return programme(
        name,
        "cones",
        story,
        M,
        -STEP * heap.load.ravel(),
        G=G,
        h=np.zeros(3 * count),
        cones=(3,) * count,
        **heap.names(("rad/s", "m/s")),
    )


def _grasp(fingers: int) -> SuiteInstance:
    """Least forces of fingers around a disc that hold its weight: each within its cone, none beyond its limit."""
    angles = 2 * np.pi * np.arange(fingers) / fingers
    place = np.array([np.cos(angles), np.sin(angles), 0 * angles]).T
    normal, across, up = -place, np.cross(np.array([0, 0, 1.0]), -place), np.tile([0, 0, 1.0], (fingers, 1))
    directions = np.stack([normal, across, up], axis=1).reshape(-1, 3)
    wrench = np.concatenate([directions, np.cross(np.repeat(place, 3, axis=0), directions)], axis=1).T
    n, friction = 3 * fingers, 0.5
    return programme(
        f"cones grasp {fingers}",
        "cones",
        f"{fingers} fingers hold a disc of 1 kg, turned by 0.5 N m, with least squares of forces; friction {friction:g}.",
        np.eye(n),
        np.zeros(n),
        A=wrench,
        b=[2.0, 1.0, 9.81, 0.0, 0.0, 0.5],
        G=-np.diag(np.tile([friction, 1.0, 1.0], fingers)),
        h=np.zeros(n),
        ub=np.tile([40.0, np.inf, np.inf], fingers),
        cones=(3,) * fingers,
        variables=tuple(f"finger{i}.{axis}" for i in range(fingers) for axis in ("n", "t", "z")),
        units=("N",) * n,
    )
