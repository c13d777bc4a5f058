"""The recursion against 60 digits: right to rounding at any ratio of masses."""

import numpy as np
import pytest

import gauss
from gauss.system import random_state
from tests.support import exact, mechanisms

RECURSION = 1e-14  # the goal, relative to the largest acceleration
# Where half an ulp of the state itself moves the exact answer visibly, a few such half ulps are made in the kinematics.
CONDITIONING = 10.0


def _moved_by_rounding(system, state, effort, reference, rng):
    """How far the exact answer moves when every coordinate and rate moves by half an ulp."""
    nudge = lambda x: x * (1 + 1.1e-16 * rng.choice([-1, 1], x.size))  # noqa: E731
    moved = [exact.accelerations(system, system.state(nudge(state.q), nudge(state.v)), effort) for _ in range(3)]
    return max(exact.relative_error([float(x) for x in m], reference) for m in moved)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("profile", ["end", "rising", "alternating"])
def test_recursion_at_mass_ratios(profile, ratio):
    masses = {
        "end": [1.0] * 9 + [ratio],
        "rising": [ratio ** (i / 9) for i in range(10)],
        "alternating": [ratio if i % 2 else 1.0 for i in range(10)],
    }[profile]
    system = gauss.compile_scene(mechanisms.chain(masses))
    rng = np.random.default_rng(5)
    for _ in range(6):
        state, effort = random_state(system, rng), rng.standard_normal(10)
        reference = exact.accelerations(system, state, effort)
        solution = gauss.solve(gauss.assemble(system, state, effort), "recursion")
        error = exact.relative_error(solution.qdd, reference)
        allowed = RECURSION
        if error > RECURSION:
            allowed = CONDITIONING * _moved_by_rounding(system, state, effort, reference, rng)
        assert error <= allowed
        assert str(solution.status) == "solved"


def test_certificate_is_the_error():
    """The estimated error of a spoilt answer is its true error (per body, relative)."""
    system = gauss.compile_scene(mechanisms.chain([1.0] * 10))
    rng = np.random.default_rng(6)
    state = random_state(system, rng)
    compulsion = gauss.assemble(system, state)
    best = gauss.solve(compulsion)
    for size in (1e-2, 1e-5, 1e-8):
        wrong = best.a * (1 + size * rng.standard_normal(best.a.size))
        from gauss.backends import certify
        from gauss.backends.solution import Answer

        certificate = certify(compulsion, Answer(wrong, best.qdd, best.multipliers, np.zeros(0)))
        lengths = np.sqrt(compulsion.Phi.reshape(-1, 6)[:, :3].sum(axis=1) / 2 / compulsion.Phi[3::6])

        def norm(a, lengths=lengths):
            parts = a.reshape(-1, 6)
            return np.hypot(lengths * np.linalg.norm(parts[:, :3], axis=1), np.linalg.norm(parts[:, 3:], axis=1))

        true = norm(wrong - best.a) / np.maximum(norm(wrong), norm(compulsion.a_free))
        assert certificate.body_errors == pytest.approx(true, rel=1e-3)
