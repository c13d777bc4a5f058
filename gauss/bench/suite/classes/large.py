"""Ten thousand to a hundred thousand variables, sparse: chains, horizons, nets before a wall, walls of bricks."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.scenes import chain
from gauss.bench.suite.bodies import balls
from gauss.bench.suite.classes.contacts import accelerations
from gauss.bench.suite.classes.mechanisms import of_compulsion
from gauss.bench.suite.classes.mpc import PLANTS, horizon
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for n in (1700, 2500):
        yield f"large chain {n}", partial(_chain, n)
    for steps in (1000, 5000):
        yield f"large masses {steps}", partial(_masses, steps)
    for side in (100, 316):
        yield f"large net {side}", partial(_net, side)
    yield "large balls 2000", partial(_balls, 2000)


def _chain(n: int) -> SuiteInstance:
    system = compile_scene(chain([1.0] * n))
    angles = 0.5 * np.sin(np.arange(n))
    story = f"Chain of {n} rods under gravity: accelerations of all bodies, rows of their hinges."
    return of_compulsion(f"large chain {n}", "large", story, assemble(system, system.state(angles)))


def _masses(steps: int) -> SuiteInstance:
    return horizon(f"large masses {steps}", "large", PLANTS["masses"](), steps)


def _net(side: int) -> SuiteInstance:
    """A net of springs that sags onto a bumpy floor."""
    line = sparse.diags_array([-np.ones(side - 1), 2.0 * np.ones(side), -np.ones(side - 1)], offsets=[-1, 0, 1])
    unit = sparse.eye_array(side)
    K = sparse.csc_array(sparse.kron(line, unit) + sparse.kron(unit, line))
    x, y = np.meshgrid(*2 * (np.linspace(0, 1, side),))
    floor = -0.04 + 0.01 * np.sin(9.0 * x) * np.cos(7.0 * y)
    n = side * side
    story = f"Net of {side} × {side} points on springs sags onto a bumpy floor."
    names = {"variables": tuple(f"point{i}.z" for i in range(n)), "units": ("m",) * n}
    return programme(f"large net {side}", "large", story, K, np.full(n, 1.0 / n), lb=floor.ravel(), **names)


def _balls(count: int) -> SuiteInstance:
    story = f"{count} balls in a box under gravity, pushed at random."
    return accelerations(f"large balls {count}", "large", story, balls(count, seed=5, gaps=True))
