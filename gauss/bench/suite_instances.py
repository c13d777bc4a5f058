"""Classes of the suite in the form of the comparison: programmes, verdicts, and starts of warm starts."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy import sparse

from gauss.bench.instances import Instance, Matrices, of_arrays
from gauss.bench.known import KnownSolution, known
from gauss.bench.problems import SOLVABLE, UNKNOWN
from gauss.bench.structured import ProgrammeStructure
from gauss.bench.suite import CLASSES, SuiteInstance, fingerprint, made, recipes
from gauss.bench.suite.instance import SOLVED
from gauss.bench.suite.optimality import plain_multipliers
from gauss.bench.suite.refine import held_rows

INDEPENDENT = "independent"  # the suite's class "equality" in the comparison, whose selection has one of that name
SUITE = (INDEPENDENT, *(kind for kind in CLASSES if kind != "equality"))


def suite_class(kind: str) -> str:
    """Name in the suite of a class of the comparison."""
    return "equality" if kind == INDEPENDENT else kind


def of_suite(kind: str, names: list[str]) -> Iterator[Instance]:
    """Instances of a class by name; steps of a sequence start at the reference of the step before."""
    kind = suite_class(kind)
    order = [recipe.name for recipe in recipes(kind)]
    for name in names:
        (found,) = made([kind], [name])
        start = None
        if found.sequence and (place := order.index(name)):
            (before,) = made([kind], [order[place - 1]])
            start = before.proof.x.rounded() if before.sequence == found.sequence else None
        yield of_suite_instance(found, start)


def of_suite_instance(found: SuiteInstance, start: np.ndarray | None = None) -> Instance:
    """Instance of the comparison; bounds become rows, which all solvers take alike, and rows of cones come last."""
    plain, right = found.plain_rows()
    rows = sparse.vstack([plain, sparse.csr_array(found.G)[found.orthant :]], format="csc")
    right = np.concatenate([right, found.h[found.orthant :]])
    structure = ProgrammeStructure(found.cones, tuple(found.friction), found.stages)
    fields = {"note": found.story, "structure": structure, "data": fingerprint(found)}
    instance = of_arrays(found.name, found.kind, found.P, found.q, found.A, found.b, rows, right, **fields)
    right_one = None
    if found.reference is None or (found.verdict == SOLVED and found.reference.x.hi.size != found.n):
        verdict = UNKNOWN
    elif found.verdict == SOLVED:
        assert instance.matrices is not None  # it was made of arrays
        verdict, right_one = SOLVABLE, _known(found, instance.matrices)
    else:
        verdict = found.verdict
    return replace(instance, known=right_one, verdict=verdict, start=start)


def _known(found: SuiteInstance, matrices: Matrices) -> KnownSolution:
    r = found.proof
    x, y, z, z_box = (part.rounded() for part in (r.x, r.y, r.z, r.z_box))
    plain = plain_multipliers(found, z, z_box)
    multipliers = np.concatenate([y, plain, z[found.orthant :]])
    touched = [np.arange(block.start, block.stop) for block in found.blocks if block.start in r.active]
    cones = np.concatenate([np.zeros(0, dtype=int), *touched]) - found.orthant + plain.size
    held = np.concatenate([np.arange(y.size), y.size + held_rows(found, r.x)[0], y.size + cones])
    return known(matrices, x, found.units, multipliers, held, r.unique)
