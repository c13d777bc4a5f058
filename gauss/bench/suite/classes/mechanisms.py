"""Compulsions of mechanisms as instances: forms F2 (accelerations of bodies) and F3 (of joints) with names and units."""

import warnings

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.programme import FORMS
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import assemble
from gauss.errors import NotImportedWarning
from gauss.io import load
from gauss.system import System, random_state

LINEAR = ("ax", "ay", "az")
ANGULAR = ("alpha_x", "alpha_y", "alpha_z")


def of_compulsion(
    name: str, kind: str, story: str, compulsion: Compulsion, form: str = "F2", units=("rad/s²", "m/s²")
) -> SuiteInstance:
    """Instance of a compulsion in a form."""
    found = FORMS[form](compulsion)
    n = found.c.size
    if form == "F3":
        names = {"variables": tuple(f"joint{i}.acceleration" for i in range(n)), "units": ("rad/s² or m/s²",) * n}
    else:
        names = {
            "variables": tuple(f"{body}.{axis}" for body in compulsion.structure.bodies for axis in (*ANGULAR, *LINEAR)),
            "units": ((units[0],) * 3 + (units[1],) * 3) * (n // 6),
        }
    return programme(name, kind, story, found.H, found.c, A=found.C, b=found.d, G=found.K, h=found.k, **names)


def loaded(name: str, **options):
    """Scene of that name; elements of a robot's file beyond its mechanics are left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return load(name, **options)


def anywhere(scene, seed: int = 0) -> Compulsion:
    """Compulsion in a random state under random loads; couplings are met."""
    system, rng = compile_scene(scene), np.random.default_rng(seed)
    state = random_state(system, rng)
    state = system.initial_state(state.q, state.v) if system.has_closures else state
    return assemble(system, state, rng.standard_normal(system.n_v))


def started(scene, seed: int = 0) -> Compulsion:
    """Compulsion of a mechanism with loops at its start, under random loads."""
    system: System = compile_scene(scene)
    return assemble(system, system.initial_state(), np.random.default_rng(seed).standard_normal(system.n_v))
