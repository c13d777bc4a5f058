"""Properties of every backend over a table of problems: they agree, they are honest, reactions do no work."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.backends import BACKENDS, available, certify, make
from gauss.backends.programme import FORMS
from gauss.backends.solution import Answer, failure
from gauss.errors import BackendError
from gauss.system import random_state
from tests.support import mechanisms

AGREEMENT = 1e-10  # of all methods where the answer is unique
ROUNDING = 1e-12
QP_BACKENDS = ("daqp", "clarabel", "osqp", "qpsolvers:quadprog", "piqp", "proxqp", "scs", "highs", "qpalm", "ecos", "cvxopt")
EXACT_QP_BACKENDS = ("daqp", "qpsolvers:quadprog", "clarabel", "osqp")  # those that the scaled form brings to rounding
INEQUALITY_BACKENDS = ("daqp", "clarabel", "piqp", "qpsolvers:quadprog", "osqp")
# By their nature; each is reported with its reason, never with a number.
REFUSES_REDUNDANT = {"kkt", "cvxopt"}
LOW_ACCURACY = {"ecos"}  # no tolerance brings it below about 1e-5 on these problems: the certificate must say so


def tree():
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5, 1.5, 1.0, 0.3]))
    rng = np.random.default_rng(0)
    return gauss.assemble(system, random_state(system, rng), rng.standard_normal(system.n_v))


def loop():
    system = gauss.compile_scene(mechanisms.four_bar())
    return gauss.assemble(system, system.initial_state(), [1.0, 0.5, 0.0, 0.0])


def coupled():
    scene = mechanisms.chain([1.0, 2.0, 0.5, 1.0])
    scene.couple("mimic", "joint2", "joint0", ratio=-1.5)
    system = gauss.compile_scene(scene)
    return gauss.assemble(system, system.initial_state(v=[1.0, 0.3, 0.2, -0.5], q=[0.2, 0.5, -0.1, 0.7]))


def skew_tree():
    system = gauss.compile_scene(mechanisms.two_bodies("universal", 4))
    return gauss.assemble(system, random_state(system, np.random.default_rng(2)))


def floating():
    system = gauss.compile_scene(mechanisms.two_bodies("free", 4))
    return gauss.assemble(system, random_state(system, np.random.default_rng(2)))


PROBLEMS = {f.__name__: f for f in (tree, loop, coupled, skew_tree, floating)}


@pytest.mark.slow
@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("backend", [*BACKENDS, *EXACT_QP_BACKENDS])
def test_methods_agree(problem, backend):
    compulsion = PROBLEMS[problem]()
    expected, found = gauss.solve(compulsion, "recursion"), gauss.solve(compulsion, backend)
    if problem == "loop" and backend in REFUSES_REDUNDANT:
        assert not found.status.certified
        assert "redundant" in str(found.status)
        return
    assert str(found.status) == "solved"
    assert np.abs(found.qdd - expected.qdd).max() <= AGREEMENT * np.abs(expected.qdd).max()
    assert np.abs(found.a - expected.a).max() <= AGREEMENT * np.abs(expected.a).max()
    unique = [c for c in compulsion.structure.constraints if c.name not in expected.certificate.not_unique]
    largest = max(np.abs(expected.multipliers).max(), np.abs(compulsion.impressed).max())
    for constraint in unique:
        difference = found.multipliers[constraint.rows] - expected.multipliers[constraint.rows]
        assert np.abs(difference).max() <= AGREEMENT * largest


@pytest.mark.slow
@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("backend", QP_BACKENDS)
def test_qp_backends_are_right_or_say_so(problem, backend):
    """Whatever a QP solver claims: "solved" means right to the tolerance, and wrong numbers are never called solved."""
    compulsion = PROBLEMS[problem]()
    expected, found = gauss.solve(compulsion, "recursion"), gauss.solve(compulsion, backend)
    if found.status.certified:
        assert np.abs(found.qdd - expected.qdd).max() <= 2e-6 * np.abs(expected.qdd).max()
    else:
        assert str(found.status).startswith("not solved: ")
        assert backend in REFUSES_REDUNDANT | LOW_ACCURACY


@pytest.mark.slow
@pytest.mark.parametrize("problem", ("tree", "loop", "coupled"))
@pytest.mark.parametrize("form", ("F1", "F2", "F2s", "F3"))
@pytest.mark.parametrize("backend", ("clarabel", "piqp", "osqp"))
def test_forms_are_the_same_problem(problem, form, backend):
    """With a stop that is touched, so that all kinds of rows take part; multipliers are read back from every form."""
    compulsion = PROBLEMS[problem]()
    drives = np.linspace(-0.2, 0.1, compulsion.P.size)  # the joint that closes a loop has one, too
    compulsion = replace(compulsion, P=compulsion.P + drives)
    free = gauss.solve(compulsion).qdd
    G = np.zeros((1, compulsion.Phi.size + compulsion.P.size))
    G[0, -1] = 1.0  # of the loop: the joint that closes it
    stopped = replace(compulsion, G=G, h=np.array([free[-1] - 0.5]))
    expected, found = gauss.solve(stopped, "daqp"), gauss.solve(stopped, backend, form=form)
    assert str(expected.status) == str(found.status) == "solved"
    scale = np.abs(expected.qdd).max()
    assert np.abs(found.qdd - expected.qdd).max() <= 1e-6 * scale
    assert found.inequality_multipliers == pytest.approx(expected.inequality_multipliers, rel=1e-5)
    residuals = np.concatenate(stopped.residuals(found.a, found.qdd, found.multipliers))
    pull = np.concatenate([G[0, : compulsion.Phi.size], np.zeros(compulsion.D.size), G[0, compulsion.Phi.size :]])
    forces = max(np.abs(compulsion.impressed).max(), np.abs(found.multipliers).max())
    assert np.abs(residuals + pull * found.inequality_multipliers).max() <= 1e-5 * forces


@pytest.mark.slow
def test_unknown_forms_and_settings_are_named():
    with pytest.raises(BackendError, match="F2s"):
        gauss.solve(tree(), "osqp", form="F4")
    with pytest.raises(BackendError, match="takes no settings"):
        gauss.solve(tree(), "kkt", form="F1")
    for backend in ("clarabel", "piqp"):
        with pytest.raises(BackendError, match="no setting 'epsilon'"):
            gauss.solve(tree(), backend, epsilon=1e-3)


@pytest.mark.parametrize("problem", PROBLEMS)
def test_reactions_of_ideal_pairs_do_no_work(problem):
    """Power of all reactions on bodies, −(A v)ᵀλ, is that of the drives; without them it is zero."""
    compulsion = PROBLEMS[problem]()
    compulsion = replace(compulsion, P=np.zeros_like(compulsion.P))
    solution = gauss.solve(compulsion)
    rng = np.random.default_rng(1)
    rows = np.concatenate([compulsion.A, compulsion.B], axis=1)
    _, sigma, Vt = np.linalg.svd(rows)
    null = Vt[(sigma > 1e-10).sum() :]
    assert null.size
    velocity = null.T @ rng.standard_normal(len(null))
    power = -(compulsion.A @ velocity[: compulsion.Phi.size]) @ solution.multipliers
    scale = np.abs(compulsion.A @ velocity[: compulsion.Phi.size]).max() * np.abs(solution.multipliers).max()
    assert abs(power) <= ROUNDING * max(scale, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["ABCD", "BCDA", "CDAB", "DABC", "DCBA", "ACBD"])
def test_a_loop_may_be_cut_anywhere(order):
    reference = gauss.compile_scene(mechanisms.four_bar())
    system = gauss.compile_scene(mechanisms.four_bar(order))
    names = list(reference.coordinates)
    expected = reference.accelerations(reference.initial_state())
    found = system.accelerations(system.initial_state())
    assert np.allclose([found[system.coordinates.index(n)] for n in names], expected, rtol=AGREEMENT)


def test_a_redundant_copy_changes_nothing():
    once, twice = (gauss.compile_scene(mechanisms.four_bar(twice=t)) for t in (False, True))
    one, two = (gauss.solve(gauss.assemble(s, s.initial_state())) for s in (once, twice))
    assert str(two.status) == "solved"
    assert np.allclose(one.a, two.a, rtol=1e-13, atol=1e-13 * np.abs(one.a).max())
    assert {"D", "again"} <= set(two.certificate.not_unique)


def test_redundant_copy_in_a_spatial_tree_leaves_unique_reactions():
    """Two welds in parallel share their reaction; that of the joint before them stays what it was."""
    solutions = []
    for copies in (1, 2):
        scene = mechanisms.chain([1.0, 2.0])
        scene.body("tool", 0.5, (0.01, 0.01, 0.01), on="link1", position=(1, 0, 0))
        for k in range(copies):
            scene.fixed(f"weld{k}", "link1", "tool", at=(1, 0, 0), frame="link1")
        system = gauss.compile_scene(scene)
        solutions.append(gauss.solve(gauss.assemble(system, system.state([0.3, 0.4], [1.0, 2.0]))))
    one, two = solutions
    assert set(two.certificate.not_unique) == {"weld0", "weld1"}
    assert np.allclose(one.multipliers[:12], two.multipliers[:12], rtol=1e-12)
    assert np.allclose(one.multipliers[12:18], two.multipliers[12:18] + two.multipliers[18:24], rtol=1e-11)


@pytest.mark.slow
def test_contradicting_rows_are_reported_by_name():
    compulsion = coupled()
    D = compulsion.D.copy()
    redundant = replace(
        compulsion.structure,
        constraints=(
            *compulsion.structure.constraints,
            replace(compulsion.structure.constraints[-1], name="copy", rows=slice(D.size, D.size + 1)),
        ),
    )
    for shift, certified in ((0.0, True), (0.1, False)):
        double = replace(
            compulsion,
            structure=redundant,
            A_blocks=(*compulsion.A_blocks, compulsion.A_blocks[-1]),
            B_blocks=(*compulsion.B_blocks, compulsion.B_blocks[-1]),
            C=np.zeros(D.size + 1),
            D=np.append(D, shift),
        )
        solution = gauss.solve(double)
        assert solution.status.certified is certified
        assert (
            certified
            or "contradict" in str(solution.status)
            and ("copy" in str(solution.status) or "mimic" in str(solution.status))
        )


@pytest.mark.slow
@pytest.mark.parametrize("backend", INEQUALITY_BACKENDS)
@pytest.mark.parametrize("active", [True, False])
def test_inequality_rows(backend, active):
    """A stop that is touched, q̈ ≤ h: either it holds and pushes, or it is as if it were not there."""
    compulsion = tree()
    free = gauss.solve(compulsion).qdd
    G = np.zeros((1, compulsion.Phi.size + compulsion.P.size))
    G[0, compulsion.Phi.size + 2] = 1.0
    h = np.array([free[2] + (-1.0 if active else 1.0)])
    solution = gauss.solve(replace(compulsion, G=G, h=h), backend)
    assert str(solution.status) == "solved"
    assert solution.certificate.complementarity <= 1e-6
    if active:
        assert solution.qdd[2] == pytest.approx(h[0], rel=1e-6)
        assert solution.inequality_multipliers[0] > 0
    else:
        assert solution.qdd == pytest.approx(free, rel=1e-6)


@pytest.mark.parametrize("backend", ["recursion", "kkt"])
def test_methods_for_equalities_refuse_inequalities(backend):
    compulsion = tree()
    G, h = np.ones((1, compulsion.Phi.size + compulsion.P.size)), np.zeros(1)
    solution = gauss.solve(replace(compulsion, G=G, h=h), backend)
    assert "inequality" in str(solution.status)


class _Liar:
    """Backend that claims a given status."""

    name = "liar"

    def __init__(self, change, found=True):
        self.change, self.found = change, found

    def __call__(self, compulsion):
        if self.change is None:
            return failure(compulsion, "gave up")
        right = gauss.solve(compulsion)
        return Answer(
            right.a + self.change, right.qdd, right.multipliers, right.inequality_multipliers, self.found, "so it says"
        )


@pytest.mark.parametrize(
    "change, found, certified, honest, words",
    [
        (0.0, True, True, True, "solved"),
        (0.0, False, True, False, "solved"),
        (1.0, True, False, False, "exceeds"),
        (np.nan, True, False, False, "not finite"),
        (None, False, False, True, "gave up"),
    ],
)
def test_status_follows_the_certificate(change, found, certified, honest, words):
    solution = gauss.solve(tree(), _Liar(change, found))
    assert solution.status.certified is certified
    assert solution.status.honest is honest
    assert words in str(solution.status)
    assert (str(solution.status) == "solved") is certified


def test_osqp_reuses_its_workspace():
    """The second solve of a motion starts from the first and needs no more iterations than a cold one."""
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5]))
    first, second = (gauss.assemble(system, system.state([0.3, 0.2, x], [1.0, 0.5, 0.2])) for x in (0.1, 0.1001))
    backend = make("osqp", polishing=False)
    gauss.solve(first, backend)
    solver = backend.solver._solver
    warm = gauss.solve(second, backend)
    assert backend.solver._solver is solver
    cold = gauss.solve(second, "osqp", polishing=False)
    assert str(warm.status) == str(cold.status) == "solved"
    assert warm.iterations <= cold.iterations


@pytest.mark.parametrize("backend", ("osqp", "clarabel", "piqp"))
def test_a_kept_workspace_leaves_the_programmes_alone(backend):
    """Values of the next instant are not written into the matrices of the first."""
    system, kept = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5])), make(backend)
    states = [system.state([0.3, 0.2, x], [1.0, 0.5, 0.2]) for x in (0.1, 0.4)]
    programmes = [FORMS["F2s"](gauss.assemble(system, state)) for state in states]
    before = [programme.C.data.copy() for programme in programmes]
    for programme in programmes:
        kept.solver(programme)
    assert all(np.array_equal(p.C.data, data) for p, data in zip(programmes, before, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("backend", ("osqp", "clarabel", "piqp"))
def test_a_kept_workspace_has_room_for_what_ever_was_not_zero(backend):
    """Stretched out, most entries vanish; once bent, the workspace is made anew, and serves both from then on."""
    system, kept = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5])), make(backend)
    compulsions = [
        gauss.assemble(system, system.state(q, [1.0, 0.5, 0.2])) for q in (np.zeros(3), [0.3, 0.2, 0.1], np.zeros(3))
    ]
    solvers = []
    for compulsion in compulsions:
        solution = gauss.solve(compulsion, kept)
        assert solution.status.certified
        assert np.abs(solution.qdd - gauss.solve(compulsion).qdd).max() <= 1e-6 * np.abs(solution.qdd).max()
        solvers.append(kept.solver._solver)
    assert solvers[0] is not solvers[1] and solvers[1] is solvers[2]


def test_programmes_without_zeros_are_the_same_and_share_nothing():
    compulsion = loop()
    whole = FORMS["F2s"](compulsion)
    lean = whole.without_zeros()
    assert np.array_equal(lean.C.toarray(), whole.C.toarray()) and lean.C.nnz == np.count_nonzero(whole.C.data) < whole.C.nnz
    assert not np.shares_memory(lean.C.indices, whole.C.indices)
    with pytest.raises(ValueError, match="read-only"):
        whole.C.eliminate_zeros()  # its pattern is that of other instants


def test_light_bodies_count():
    """An answer that is wrong for a body of 1 mg only is not certified, whatever its norm says."""
    system = gauss.compile_scene(mechanisms.chain([1.0, 1.0, 1e-6]))
    compulsion = gauss.assemble(system, system.state([0.3, 0.2, 0.1], [1.0, 0.5, 0.2]))
    change = np.zeros(18)
    change[15:] = 0.1
    assert gauss.solve(compulsion, _Liar(change)).certificate.worst == "link2"


def test_massless_body_between_joints():
    """A cross without mass between two hinges is a universal joint."""
    scene = gauss.Scene("cross")
    scene.body("cross", mass=0.0)
    scene.body("rod", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0))
    scene.revolute("first", "ground", "cross", axis=(0, 0, 1))
    scene.revolute("second", "cross", "rod", axis=(0, 1, 0))
    other = gauss.Scene("universal")
    other.body("rod", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0))
    other.universal("U", "ground", "rod", axis=(0, 0, 1), second_axis=(0, 1, 0))
    one, two = gauss.compile_scene(scene), gauss.compile_scene(other)
    state = [0.3, 0.4], [1.0, -2.0]
    assert one.accelerations(one.state(*state)) == pytest.approx(two.accelerations(two.state(*state)), rel=1e-13)
    for backend in ("kkt", "recursion"):
        assert str(gauss.solve(gauss.assemble(one, one.state(*state)), backend).status) == "solved"
    assert "without mass" in str(gauss.solve(gauss.assemble(one, one.state(*state)), "schur").status)


def test_unknown_backend_is_named():
    with pytest.raises(BackendError, match="clarabel"):
        gauss.solve(tree(), "clarabell")
    with pytest.raises(BackendError, match="takes no settings"):
        gauss.solve(tree(), "kkt", eps=1e-3)
    assert set(BACKENDS) < set(available())


def test_a_hinge_in_the_centre_of_a_point_mass_is_judged():
    """The cart is not turned by the pin; that its reach is zero must not hide an error of the pin's acceleration."""
    scene = gauss.Scene("cart and point mass", gravity=(0, -9.81, 0))
    scene.body("cart", 1.0)
    scene.body("bob", 0.5, com=(0, 0.8, 0))
    scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    scene.revolute("pin", "cart", "bob", axis=(0, 0, -1))
    system = gauss.compile_scene(scene)
    compulsion = gauss.assemble(system, system.state([0.2, 0.3], [0.1, 0.7]))
    right = gauss.solve(compulsion, "recursion")
    wrong = Answer(right.a, right.qdd * [1.0, 1.01], right.multipliers, np.zeros(0))
    assert certify(compulsion, wrong).error == pytest.approx(0.01, rel=0.3)  # compared with what moves its bodies, too


class Borrowing:
    """A backend of somebody else that answers by the factorisation made for the certificate."""

    name, used = "borrowing", ()

    def __call__(self, compulsion):
        raise AssertionError("a factorisation is at hand")

    def solve_with(self, factor):
        self.used = (*self.used, factor)
        return make("recursion").solve_with(factor)


def test_any_backend_may_answer_by_the_factorisation_of_the_certificate():
    """Not its class counts but what it offers; a wrong answer by that factorisation is found by the residuals."""
    problem, backend = loop(), Borrowing()
    found = gauss.solve(problem, backend)
    assert len(backend.used) == 1 and found.status.certified and found.backend == "borrowing"
    np.testing.assert_array_equal(found.qdd, gauss.solve(problem, "recursion").qdd)

    class Wrong(Borrowing):
        def solve_with(self, factor):
            answer, _ = super().solve_with(factor)
            answer = replace(answer, a=answer.a * (1.0 + 1e-3))
            return answer, factor.correction(problem, answer)

    assert not gauss.solve(problem, Wrong()).status.certified
