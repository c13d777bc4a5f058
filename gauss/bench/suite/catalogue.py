"""The instances of the suite by class: ``instances()`` makes them, each with its reference, which is checked on the way.

An instance whose verdict is not proven to the digits that its reference claims is refused.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from typing import NamedTuple

from gauss.bench.suite.cones import refined_with_cones
from gauss.bench.suite.instance import INFEASIBLE, SOLVED, SuiteInstance, with_reference
from gauss.bench.suite.optimality import certificate_residual, ray_residual, residuals
from gauss.bench.suite.refine import refined
from gauss.errors import BackendError, did_you_mean

VERSION = "1.0.0"  # of the random numbers of the suite
CLASSES = {
    "equality": "Accelerations of open and closed mechanisms: equality rows alone, all independent.",
    "scales": "The same mechanisms in other units, and with masses up to twelve orders apart.",
    "contacts": "Many one-sided rows: joints at stops, feet, heaps of balls, walls of bricks.",
    "degenerate": "Contacts that touch without force, loads at the brink of tilting, more contacts than freedoms.",
    "redundant": "Overconstrained loops and rows said twice: the answer is unique, its multipliers are not.",
    "infeasible": "Rows that contradict each other, with a Farkas certificate.",
    "unbounded": "Loads on what has no mass and no support, with a ray of descent.",
    "cones": "Friction as second-order cones: the convex step of contact, and grasps.",
    "coulomb": "Coulomb's law, a complementarity problem: the minimum of nothing.",
    "whole body": "Whole-body control and inverse dynamics of legged robots, humanoids among them.",
    "mpc": "Predictive control of mechanisms: stages that are coupled by their states.",
    "sequences": "Steps of motions with changing contacts or bounds, for warm starts.",
    "large": "Ten thousand to a hundred thousand variables.",
}
EXACT = 1e-25  # largest residual of a reference, relative
ROUNDED = 1e-12  # the same, where the rounding of rows that depend on each other leaves a contradiction, which is reported
STEEP = 1e-9  # relative: a certificate or ray that shows less might be rounding of the data


class Recipe(NamedTuple):
    """Name of an instance, and how it is made."""

    name: str
    make: Callable[[], SuiteInstance]


def instances(classes: Iterable[str] | None = None, names: Iterable[str] | None = None) -> list[SuiteInstance]:
    """Instances of the suite, each with a reference that is checked.

    Parameters
    ----------
    classes : sequence of str, optional
        Their classes, see :data:`CLASSES`; all but "large" when not given.
    names : sequence of str, optional
        Only these of them; all when not given.

    Returns
    -------
    list of Instance
        In the order of the classes; steps of a sequence follow each other.

    Raises
    ------
    BackendError
        If there is no such class or name, or a reference is not confirmed.
    """
    return list(made(classes, names))


def made(classes: Iterable[str] | None = None, names: Iterable[str] | None = None) -> Iterator[SuiteInstance]:
    """As :func:`instances`, one by one."""
    chosen = [kind for kind in CLASSES if kind != "large"] if classes is None else list(classes)
    found = [recipe for kind in chosen for recipe in recipes(kind)]
    if names is not None:
        by_name = {recipe.name: recipe for recipe in found}
        for name in (names := list(names)):
            if name not in by_name:
                raise BackendError(f"no instance {name!r} of the suite. {did_you_mean(name, by_name)}")
        found = [by_name[name] for name in names]
    for recipe in found:
        yield checked(recipe.make())


@lru_cache
def recipes(kind: str) -> tuple[Recipe, ...]:
    """Names of the instances of a class, and how they are made: nothing is computed yet.

    BackendError if there is no such class.
    """
    if kind not in CLASSES:
        raise BackendError(f"no class {kind!r} of problems. {did_you_mean(kind, CLASSES)}")
    module = import_module(f"gauss.bench.suite.classes.{kind.replace(' ', '_')}")
    return tuple(Recipe(name, make) for name, make in module.recipes())


def checked(instance: SuiteInstance) -> SuiteInstance:
    """The instance with its reference, confirmed.

    BackendError if the reference, the certificate or the ray does not hold.
    """
    if instance.verdict == SOLVED:
        reference = instance.reference or (refined_with_cones(instance) if instance.cones else refined(instance))
        worst = max(residuals(instance, reference.x, reference.y, reference.z, reference.z_box))
        if worst > (ROUNDED if reference.contradiction else EXACT):
            raise BackendError(f"{instance.name}: the reference leaves {worst:.1e}.")
        return with_reference(instance, replace(reference, residual=worst))
    reference = instance.proof
    if instance.verdict == INFEASIBLE:
        worst, slope = certificate_residual(instance, reference.y, reference.z, reference.z_box)
    else:
        worst, slope = ray_residual(instance, reference.ray)
        worst = max(worst, residuals(instance, reference.x, reference.y, reference.z, reference.z_box).primal)
    if worst > EXACT or slope < STEEP:
        raise BackendError(
            f"{instance.name}: its verdict is not proven, the proof leaves {worst:.1e} and shows {slope:.1e}."
        )
    return with_reference(instance, replace(reference, residual=worst))
