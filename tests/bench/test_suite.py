"""Classes of quadratic programmes: references right to thirty digits, verdicts that are proven."""

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from gauss.bench.problems import make_problem
from gauss.bench.reference import reference
from gauss.bench.suite import CLASSES, instances, recipes
from gauss.bench.suite.catalogue import EXACT, ROUNDED, checked
from gauss.bench.suite.classes.mechanisms import of_compulsion
from gauss.bench.suite.doubled import product
from gauss.bench.suite.instance import SOLVED, with_reference
from gauss.bench.suite.optimality import residuals
from gauss.errors import BackendError
from gauss.linkages.doubled import Doubled
from tests.support.suite import parts

FEWEST = 200  # instances that the suite is to have
SMALL = 70  # unknowns up to which conditions are checked once more, number by number
SEEN = 1e-18  # relative error of a reference that the check must see: far below doubles, far above its own rounding
FOREIGN = 1e-6  # relative error of a foreign solver's answer at its own tolerance of 1e-10


def test_there_are_enough_instances_and_all_have_names_of_their_own():
    names = [recipe.name for kind in CLASSES for recipe in recipes(kind)]
    assert len(names) >= FEWEST
    assert len(set(names)) == len(names)


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(CLASSES))
def test_references_meet_the_conditions_of_optimality(some, kind):
    for instance in some[kind]:
        assert instance.kind == kind and instance.story and len(set(instance.variables)) == instance.n
        if instance.verdict != SOLVED:
            continue
        found = instance.reference
        assert max(residuals(instance, found.x, found.y, found.z, found.z_box)) <= (
            ROUNDED if found.contradiction else EXACT
        )
        if instance.n <= SMALL and not instance.friction.size:
            assert _stationarity(instance) <= EXACT


def _stationarity(instance) -> float:
    """Residual of stationarity, by numbers of 60 digits one by one: other arithmetic than that of the references."""
    found = instance.reference
    with mpmath.workdps(60):
        x, y, z, z_box = ([mpmath.mpf(h) + mpmath.mpf(lo) for h, lo in zip(p.hi, p.lo, strict=True)] for p in parts(found))
        worst = 0.0
        P, A, G = (matrix.toarray() for matrix in (instance.P, instance.A, instance.G))
        for j in range(instance.n):
            terms = [mpmath.mpf(instance.q[j]), z_box[j]]
            for M, factors in ((P[:, j], x), (A[:, j], y), (G[:, j], z)):
                terms += [mpmath.mpf(M[i]) * factors[i] for i in np.flatnonzero(M)]
            size = sum(abs(term) for term in terms)
            worst = max(worst, float(abs(sum(terms)) / size)) if size > 1e-20 else worst
    return worst


@pytest.mark.parametrize("part", ["x", "y", "z", "z_box"])
def test_a_wrong_reference_is_refused(few, part):
    """An error that no double shows, in any part that an instance has, is seen by the check."""
    tried = 0
    for instance in few:
        right = getattr(instance.reference, part)
        if instance.verdict != SOLVED or not np.abs(right.hi).max(initial=0.0):
            continue
        tried += 1
        wrong = Doubled(right.hi, right.lo + SEEN * np.abs(right.hi).max() * (np.abs(right.hi) == np.abs(right.hi).max()))
        with pytest.raises(BackendError, match="reference leaves"):
            checked(with_reference(instance, replace(instance.reference, **{part: wrong})))
    assert tried


@pytest.mark.slow
def test_infeasible_and_unbounded_ones_are_proven_in_rational_arithmetic(some):
    """Certificates hold exactly, but that of noise, whose rows are no round numbers."""
    for instance in [i for i in some["infeasible"] if "noisy" not in i.name]:
        found = instance.reference
        pull = _exactly(instance.A.T, found.y.hi), _exactly(instance.G.T, found.z.hi), [Fraction(v) for v in found.z_box.hi]
        assert not any(map(sum, zip(*pull, strict=True))) and (found.z.hi >= 0).all()
        bounds = np.where(found.z_box.hi > 0, instance.ub, np.where(found.z_box.hi < 0, instance.lb, 0.0))
        sides = (instance.b, found.y.hi), (instance.h, found.z.hi), (bounds, found.z_box.hi)
        assert sum(Fraction(a) * Fraction(b) for one, other in sides for a, b in zip(one, other, strict=True)) < 0
    for instance in some["unbounded"]:
        ray, x = instance.reference.ray, instance.reference.x.hi
        assert not any(_exactly(instance.P, ray)) and not any(_exactly(instance.A, ray)) and instance.q @ ray < 0
        assert all(value <= 0 for value in _exactly(instance.G, ray))
        assert (ray[np.isfinite(instance.ub)] <= 0).all() and (ray[np.isfinite(instance.lb)] >= 0).all()
        assert (instance.A @ x == instance.b).all() and (instance.G @ x <= instance.h).all()


def _exactly(M, v) -> list[Fraction]:
    M = M.tocsr()
    rows = (range(M.indptr[i], M.indptr[i + 1]) for i in range(M.shape[0]))
    return [sum((Fraction(M.data[k]) * Fraction(v[M.indices[k]]) for k in row), Fraction(0)) for row in rows]


def test_a_verdict_without_proof_is_refused(few):
    by_verdict = {instance.verdict: instance for instance in few}
    infeasible, unbounded = by_verdict["infeasible"], by_verdict["unbounded"]
    nothing = Doubled(0.0 * infeasible.reference.z.hi, 0.0 * infeasible.reference.z.hi)
    for wrong in (
        with_reference(infeasible, replace(infeasible.reference, z=nothing)),
        replace(infeasible, h=infeasible.h + 1.0),  # rows that are let out as far can be met
        with_reference(unbounded, replace(unbounded.reference, ray=-unbounded.reference.ray)),
        replace(unbounded, ub=np.ones(unbounded.n)),
    ):
        with pytest.raises(BackendError):
            checked(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5", "stewart", "three stops", "light tip 1e-9"])
def test_references_agree_with_those_of_fifty_digits(name):
    """Two ways to extended precision, from the full form and from F2, whose making rounds: they differ by that."""
    compulsion = make_problem(name).compulsion
    found, right = checked(of_compulsion(name, "contacts", "", compulsion)), reference(compulsion)
    np.testing.assert_allclose(found.reference.x.hi, right.a, rtol=1e-12, atol=1e-12 * np.abs(right.a).max())
    assert set(right.active) <= set(found.reference.active)


@pytest.mark.slow
@pytest.mark.peer
def test_a_foreign_solver_finds_answers_and_multipliers_of_the_same_signs(some):
    """Signs and places of multipliers are those of qpsolvers, where they are unique."""
    import qpsolvers

    tried = 0
    for kind in ("contacts", "mpc", "scales"):
        for instance in some[kind]:
            if instance.n > 120 or not instance.reference.unique or "1e" in instance.name:
                continue
            rows = {"G": instance.G, "h": instance.h} if instance.h.size else {"G": None, "h": None}
            rows |= {"A": instance.A, "b": instance.b} if instance.b.size else {}
            problem = qpsolvers.Problem(instance.P, instance.q, **rows, lb=instance.lb, ub=instance.ub)
            found = qpsolvers.solve_problem(problem, "clarabel", tol_gap_rel=1e-10, tol_gap_abs=1e-10, tol_feas=1e-10)
            right = instance.reference
            pairs = [(found.x, right.x)] + [(found.z, right.z)] * (instance.h.size > 0)
            pairs += [(found.z_box, right.z_box)] * bool(np.abs(right.z_box.hi).any())
            for got, expected in pairs:
                assert np.abs(got - expected.hi).max() <= FOREIGN * max(np.abs(expected.hi).max(), np.abs(instance.q).max())
                tried += 1
    assert tried > 3


@pytest.mark.slow
def test_coulombs_law_holds_contact_by_contact(some):
    for instance in some["coulomb"]:
        r = instance.reference.x.hi.reshape(-1, 3)
        u = (product(instance.P, instance.reference.x) + instance.q).rounded().reshape(-1, 3)
        small = 1e-14 * np.abs(instance.q).max(), 1e-14 * np.abs(r).max()
        assert u[:, 0].min() >= -small[0] and r[:, 0].min() >= -small[1]
        assert (np.minimum(u[:, 0] / small[0], r[:, 0] / small[1]) <= 1.0).all()
        rub, slip = np.hypot(*r[:, 1:].T), np.hypot(*u[:, 1:].T)
        assert (rub <= instance.friction * r[:, 0] + small[1]).all()
        slides = (slip > small[0]) & (r[:, 0] > small[1])
        np.testing.assert_allclose(rub[slides], (instance.friction * r[:, 0])[slides], rtol=1e-12)
        assert ((r[:, 1:] * u[:, 1:]).sum(axis=1)[slides] < 0).all()


@pytest.mark.slow
def test_steps_of_a_sequence_have_one_shape_and_change_what_is_active():
    names = [
        recipe.name for recipe in recipes("sequences") if "dropped box" in recipe.name or "falling chain" in recipe.name
    ]
    steps = instances(["sequences"], names)
    for sequence in {step.sequence for step in steps}:
        own = [step for step in steps if step.sequence == sequence]
        assert len({(step.n, step.b.size, step.h.size, step.variables) for step in own}) == 1
        assert len({tuple(step.reference.active) for step in own}) > 2


@pytest.mark.slow
def test_stages_of_control_are_banded(some):
    for instance in some["mpc"]:
        steps, n_x, n_u = instance.stages
        assert instance.n == steps * (n_x + n_u) and instance.b.size == steps * n_x
        A = instance.A.tocoo()
        assert (A.col // (n_x + n_u) <= A.row // n_x).all() and (A.row // n_x - A.col // (n_x + n_u) <= 1).all()
