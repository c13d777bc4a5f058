"""Functions whose instructions quick compilation selects all at once: the module is the same but for their convention."""

import re

import numpy as np
import pytest

from gauss.codegen import machine, write
from gauss.codegen.emit import Writer
from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.linking import linked
from gauss.codegen.object_code import CONVENTION, LEAST_MULTIPLY_ADDS, optimised_objects, quick_objects, selected_whole
from gauss.codegen.tiers import OPTIMISED, QUICK


def horner(degree: int, name: str):
    """Polynomial by Horner's rule: ``degree`` multiply–adds."""

    def value(x):
        total = x[0]
        for k in range(degree):
            total = total * x[1] + (1.0 + k)
        return [total, total * x[0]]

    return write(value, 2, name=name)


def module(degree: int) -> str:
    """Module of a function that calls another one, which has so many multiply–adds."""
    inner, writer = horner(degree, "inner"), Writer()
    outer = write(lambda x: inner(inner(x)), 2, name="outer")
    writer.over_states(outer, ())
    return str(writer.module)


@pytest.mark.parametrize("degree", [LEAST_MULTIPLY_ADDS - 1, LEAST_MULTIPLY_ADDS, 5 * LEAST_MULTIPLY_ADDS])
def test_only_the_convention_of_long_functions_differs(degree):
    text = module(degree)
    found = selected_whole(text)
    assert found.replace(CONVENTION, "") == text
    defined = re.findall(rf'define internal {CONVENTION}void (@"inner[^"]*")', found)
    assert len(defined) == (degree >= LEAST_MULTIPLY_ADDS)
    for name in defined:
        assert found.count(f"call {CONVENTION}void {name}(") == text.count(f"call void {name}(") > 0


def test_functions_that_are_passed_on_keep_their_convention():
    text = module(LEAST_MULTIPLY_ADDS)
    (name,) = re.findall(r'define internal void (@"inner[^"]*")', text)
    assert selected_whole(f"{text}\n@table = constant ptr {name}\n").count(CONVENTION) == 0


def test_the_results_are_those_of_the_optimised_code():
    text, given = module(3 * LEAST_MULTIPLY_ADDS), np.random.default_rng(0).standard_normal((2, 7))
    assert CONVENTION in selected_whole(text)
    results = []
    for objects, tier in ((quick_objects(text), QUICK), ([*optimised_objects(text, 1)], OPTIMISED)):
        found, code = np.empty((2, 7)), machine.MachineCode("test", linked(objects), tier)
        run = code.entry("run", SIGNATURE)
        run.call(7, given.ctypes.data, 7, found.ctypes.data, 7)
        results.append(found)
    assert np.array_equal(*results)
