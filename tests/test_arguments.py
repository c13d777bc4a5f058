"""Calls that do not fit a signature are refused as errors of gauss; a TypeError of what is called stays what it is."""

import pytest

import gauss
from gauss.arguments import named_arguments
from gauss.errors import ArgumentError

SCENE = gauss.load("double_pendulum")
SYSTEM = gauss.compile_scene(SCENE)
MISSING = {
    "simulate": (lambda: gauss.simulate(SCENE), "duration"),
    "Simulator": (lambda: gauss.Simulator(SCENE), "step"),
    "SimulatorBatch": (lambda: gauss.SimulatorBatch(SCENE, 1e-3), "batch"),
    "prepare": (lambda: gauss.prepare(SCENE), "duration"),
    "compile_scene": (lambda: gauss.compile_scene(), "scene"),
    "input": (lambda: gauss.Scene("one").input(), "name"),
    "mass_matrix": (lambda: SYSTEM.mass_matrix(), "q"),
    "bias_forces": (lambda: SYSTEM.bias_forces(SYSTEM.reference.q), "v"),
}


@pytest.mark.parametrize("name", MISSING)
def test_a_missing_argument_is_named(name):
    call, missing = MISSING[name]
    with pytest.raises(ArgumentError, match=f"^{name}.*'{missing}'"):
        call()


def test_too_many_arguments_are_refused():
    with pytest.raises(ArgumentError, match="^compile_scene"):
        gauss.compile_scene(SCENE, *range(20))


def test_an_error_within_the_call_stays_what_it_is():
    @named_arguments
    def failing(number):
        return number + "text"

    with pytest.raises(TypeError, match="unsupported operand") as raised:
        failing(1)
    assert not isinstance(raised.value, ArgumentError)
