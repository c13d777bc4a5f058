"""Forces of contacts and set-valued elements over a step meet every law, with more contacts than freedoms, too."""

import numpy as np
import pytest

from gauss.dynamics.contact.contact_step import ACCEPTED_LAW_ERROR, CONVEX_ERROR, ContactLaws, ContactProblem

FREEDOMS = 6


def _problem(rng, smooth, rough, set_valued):
    """Random contacts and set-valued elements of a body of six freedoms with random inertia, which a motion can satisfy."""
    m, n = smooth + rough, smooth + 3 * rough + set_valued
    J = rng.standard_normal((n, FREEDOMS))
    root = rng.standard_normal((FREEDOMS, FREEDOMS))
    W = 0.1 * J @ np.linalg.inv(root @ root.T + np.eye(FREEDOMS)) @ J.T
    laws = ContactLaws(
        normal=np.arange(m),
        across=np.arange(m, m + 2 * rough).reshape(rough, 2),
        under=np.arange(smooth, m),
        friction=rng.uniform(0.05, 0.6, rough),
        set_valued=np.arange(m + 2 * rough, n),
        limit=rng.uniform(0.1, 2.0, set_valued),
    )
    return ContactProblem(0.5 * (W + W.T), J @ rng.standard_normal(FREEDOMS), laws)


CASES = [(4, 0, 0), (8, 0, 0), (0, 1, 0), (0, 2, 0), (0, 4, 0), (2, 2, 2), (0, 0, 4), (0, 3, 3)]


@pytest.mark.parametrize(("smooth", "rough", "set_valued"), CASES)
def test_forces_obey_their_laws(smooth, rough, set_valued):
    rng, settled = np.random.default_rng(0), 0
    for _ in range(40):
        problem = _problem(rng, smooth, rough, set_valued)
        laws, tolerance = problem.laws, ACCEPTED_LAW_ERROR * (1.0 + np.abs(problem.b).max())
        f, error = problem.solve(np.zeros(problem.b.size))
        u, w = problem.W @ f + problem.b, problem.sizes
        if error is None:
            continue
        settled += 1
        n = laws.normal
        assert (f[n] * w[n] >= -tolerance).all()
        assert (u[n] >= -tolerance).all()
        assert (np.minimum(f[n] * w[n], u[n]) <= tolerance).all()
        for t, normal, mu in zip(laws.across, laws.under, laws.friction, strict=True):
            size, bound, speed = np.hypot(*f[t]), mu * f[normal], np.hypot(*u[t])
            off = tolerance / w[t[0]]
            assert size <= bound + off
            if speed > 1e3 * tolerance:  # it slides: all of the friction, against the sliding
                assert f[t] == pytest.approx(-bound * u[t] / speed, abs=1e3 * off)
        for g, limit in zip(laws.set_valued, laws.limit, strict=True):
            assert abs(f[g]) <= limit + tolerance / w[g]
            if abs(u[g]) > tolerance:
                assert f[g] == pytest.approx(-np.sign(u[g]) * limit, abs=tolerance / w[g])
    assert settled >= (40 if not rough else 30)  # without friction it is a convex problem, which always has an answer


@pytest.mark.parametrize("rough", [1, 3])
def test_the_convex_step_has_the_least_of_its_function(rough):
    """Among all forces in the cones ½ fᵀ W f + bᵀ f is least: no allowed change makes it smaller."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        problem = _problem(rng, 1, rough, 1)
        f = problem._convex(np.zeros(problem.b.size))
        slope, scale = problem.W @ f + problem.b, CONVEX_ERROR * (1.0 + np.abs(problem.b).max())
        assert problem._allowed(f) == pytest.approx(f, abs=1e-12)
        for other in rng.standard_normal((200, f.size)):
            change = problem._allowed(f + other) - f
            assert slope @ change >= -10.0 * scale * np.abs(change).sum()


def test_nothing_that_touches_takes_no_forces():
    problem = _problem(np.random.default_rng(2), 0, 0, 0)
    assert problem.solve(np.zeros(0))[1] == 0.0


def test_a_start_that_is_right_is_kept():
    problem = _problem(np.random.default_rng(3), 8, 0, 0)  # many answers: the one at hand is as good as any
    f, _ = problem.solve(np.zeros(8))
    again, _ = problem.solve(f)
    assert again == pytest.approx(f, abs=0)
