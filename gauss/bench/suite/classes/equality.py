"""Accelerations of mechanisms as the least compulsion under equality rows that are all independent."""

from collections.abc import Iterator
from functools import partial

from gauss.bench.scenes import chain
from gauss.bench.suite.classes.mechanisms import anywhere, loaded, of_compulsion, started
from gauss.bench.suite.instance import SuiteInstance

ROBOTS = {"panda": {}, "ur5": {}, "talos": {"root": "free"}, "solo12": {"root": "free"}, "icub": {"root": "free"}}
CHAINS = (2, 5, 10, 20, 50, 100)
TREES = (0, 1, 2, 3, 4, 5)
LOOPS: dict[str, dict] = {
    "stewart_platform": {},
    "delta_robot": {},
    "spatial_double_pendulum": {},
}


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for robot, options in ROBOTS.items():
        yield f"equality {robot}", partial(_robot, robot, options)
    for n in CHAINS:
        yield f"equality chain {n}", partial(_chain, n)
        yield f"equality hinges {n}", partial(_hinges, n)
    for seed in TREES:
        yield f"equality tree {seed}", partial(_tree, seed)
    for name, options in LOOPS.items():
        yield f"equality {name}", partial(_loop, name, options)
    for seed in (1, 2):
        yield f"equality talos pose {seed}", partial(_robot, "talos", {"root": "free"}, seed)


def _robot(name: str, options: dict, seed: int = 0) -> SuiteInstance:
    story = f"Robot {name} in random pose {seed} under random torques: rows of its joints."
    title = f"equality {name} pose {seed}" if seed else f"equality {name}"
    return of_compulsion(title, "equality", story, anywhere(loaded(f"robot:{name}", **options), seed))


def _chain(n: int) -> SuiteInstance:
    story = f"Spatial chain of {n} links with joints of every axis; few digits of the tip depend on the first joint."
    return of_compulsion(f"equality chain {n}", "equality", story, anywhere(loaded("spatial_chain", n=n)))


def _hinges(n: int) -> SuiteInstance:
    story = f"Chain of {n} equal rods on hinges about z, x, y in turn."
    return of_compulsion(f"equality hinges {n}", "equality", story, anywhere(chain([1.0] * n)))


def _tree(seed: int) -> SuiteInstance:
    story = f"Tree of 12 bodies, joints of every kind, number {seed}."
    return of_compulsion(f"equality tree {seed}", "equality", story, anywhere(loaded("random_tree", n=12, seed=seed), seed))


def _loop(name: str, options: dict) -> SuiteInstance:
    story = f"Mechanism {name} at its start under random loads: loops that fit, all rows independent."
    return of_compulsion(f"equality {name}", "equality", story, started(loaded(name, **options)))
