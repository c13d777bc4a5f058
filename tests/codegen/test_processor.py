"""Machine code for narrower vector registers: asked for by an environment variable, with the same digits."""

import os
import subprocess
import sys

import pytest

from gauss.codegen import processor
from gauss.errors import ArgumentError

SCRIPT = """
import numpy as np
import gauss
from gauss.codegen import processor
system = gauss.compile_scene(gauss.load("double_pendulum"))
q = np.linspace(-1.0, 1.0, 20).reshape(10, 2)
print(processor.width(), *system.forward_dynamics(q, -q, q).ravel().view(np.int64))
"""


def batch(most: str, cache) -> tuple[int, list[str]]:
    """Doubles in a register, and the bits of accelerations of a batch in a process that may use so many."""
    environment = os.environ | {processor.VARIABLE: most, "GAUSS_CACHE": str(cache)}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    width, *bits = done.stdout.split()
    return int(width), bits


@pytest.mark.slow
def test_narrower_registers_give_the_same_digits_from_one_cache(tmp_path):
    widest, bits = batch("8", tmp_path)
    narrower, same = batch("4", tmp_path)
    assert narrower == min(widest, 4) and same == bits
    assert batch("8", tmp_path) == (widest, bits)


@pytest.mark.parametrize("most", [2, 4, 8])
def test_features_of_wider_registers_are_off(most, monkeypatch):
    monkeypatch.setenv(processor.VARIABLE, str(most))
    found = processor.features.__wrapped__().split(",")
    wider = tuple("+" + prefix for prefix in processor.WIDER[most])
    assert len(found) > 10 and not [name for name in found if wider and name.startswith(wider)]
    assert processor.width.__wrapped__() <= most


@pytest.mark.parametrize("given", ["3", "avx", "-4"])
def test_other_numbers_are_refused(given, monkeypatch):
    monkeypatch.setenv(processor.VARIABLE, given)
    with pytest.raises(ArgumentError, match=given):
        processor.width.__wrapped__()
