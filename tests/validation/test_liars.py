"""Backends that say anything: none is certified beyond what is right, in accelerations or in multipliers, and none raises.

``python -m benchmarks.liars`` tells ten thousand, and counts what became of them.
"""

import contextlib
from collections import Counter
from dataclasses import dataclass, is_dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

import gauss
from gauss.backends import Answer, make
from gauss.backends.certificate import TOLERANCE
from gauss.backends.estimate import acceleration_errors
from gauss.backends.factorisation import factored
from gauss.backends.programme import FORMS, Outcome
from gauss.backends.programmed import Programmed
from gauss.bench.problems import make_problem
from gauss.system import random_state
from tests.support import mechanisms

COUNT = 200  # lies in the suite
WIDE = 1e15  # times: as much as multipliers are pumped up in directions that move nothing
TWO_DIGITS = 0.02  # relative: what is asked of an estimated error that stands well above rounding
ROUNDING = 1e-12  # relative to the least that a reaction is compared with, 1e-3 of the forces: of projections made here
MEETS = 1e-9  # relative to the largest acceleration: slack of a row that holds
ABOVE = 1e3  # times the error of what is returned: well above


def tree():
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 1e-3, 1.5]))
    return gauss.assemble(system, random_state(system, np.random.default_rng(0)))


def started(scene, **given):
    """Compulsion of a scene in its initial state."""
    system = gauss.compile_scene(scene)
    return gauss.assemble(system, system.initial_state(**given))


def planar_loop():
    system = gauss.compile_scene(mechanisms.four_bar())
    return gauss.assemble(system, system.initial_state(), [1.0, 0.5, 0.0, 0.0])


def loop_with_a_copy():
    return started(mechanisms.four_bar(twice=True))


def coupled():
    scene = mechanisms.chain([1.0, 2.0, 0.5])
    scene.couple("mimic", "joint2", "joint0", ratio=-1.5)
    return started(scene, v=[1.0, 0.3, 0.2], q=[0.2, 0.5, -0.1])


def tipping_box():
    return started(gauss.load("box_on_plane_4"))


def standing_box():
    scene = gauss.load("box_on_plane_8")
    scene.loads.clear()
    return started(scene)


def stops():
    return make_problem("three stops").compulsion


@dataclass(frozen=True)
class Case:
    """A problem and its solution, which is right to rounding."""

    compulsion: gauss.Compulsion
    right: gauss.Solution

    @property
    def touching(self) -> np.ndarray:
        """One-sided rows that hold, whether or not they push."""
        c, right = self.compulsion, self.right
        slack = c.h - c.G @ np.concatenate([right.a, right.qdd])
        return np.flatnonzero(slack <= MEETS * c.acceleration_scale(right.a, right.qdd) * c.row_scales)


MAKERS = (tree, planar_loop, loop_with_a_copy, coupled, tipping_box, standing_box, stops)


@pytest.fixture(scope="module")
def cases():
    return made()


def made() -> dict[str, Case]:
    found = {}
    for maker in MAKERS:
        compulsion = maker()
        found[maker.__name__] = Case(compulsion, gauss.solve(compulsion))
        assert str(found[maker.__name__].right.status) == "solved"
    return found


class Telling:
    """Backend that says one thing."""

    name = "telling"

    def __init__(self, said):
        self.said = said

    def __call__(self, compulsion):
        return self.said(compulsion) if callable(self.said) else self.said


# --- lies: of a part of the answer, and of all of it

PARTS = {
    "noise": lambda x, size, rng: x * (1.0 + size * rng.standard_normal(x.size)),
    "share": lambda x, size, rng: x * (1.0 + size),
    "anywhere": lambda x, size, rng: x + size * np.abs(x).max(initial=0.0) * rng.standard_normal(x.size),
    "nothing": lambda x, size, rng: 0.0 * x,
    "other way": lambda x, size, rng: -x,
    "swapped": lambda x, size, rng: rng.permutation(x),
    "single precision": lambda x, size, rng: x.astype(np.float32),
    "one off": lambda x, size, rng: (
        x + size * np.abs(x).max(initial=0.0) * (np.arange(x.size) == rng.integers(max(x.size, 1)))
    ),
    "huge": lambda x, size, rng: x * 10.0 ** rng.uniform(3, 300),
    "not finite": lambda x, size, rng: np.where(rng.random(x.size) < 0.3, rng.choice([np.nan, np.inf, -np.inf]), x),
}
NAMES = ("a", "qdd", "multipliers", "inequality_multipliers")


def partly(case, size, rng):
    """Some parts of the right answer are changed."""
    answer, lie = case.right.answer, PARTS[rng.choice(list(PARTS))]
    chosen = [name for name in NAMES if rng.random() < 0.4] or [rng.choice(NAMES)]
    return replace(answer, **{name: lie(getattr(answer, name), size, rng) for name in chosen})


def pumped(case, size, rng):
    """Multipliers that move nothing are added, as large as one likes: they leave the answer as right as it was."""
    answer, basis = case.right.answer, factored(case.compulsion).free_multipliers()
    scale = np.abs(answer.multipliers).max(initial=1.0) * 10.0 ** rng.uniform(0, np.log10(WIDE))
    loose = basis @ rng.standard_normal(basis.shape[1]) / np.abs(basis).max(initial=1e-300) if basis.size else 0.0
    return replace(answer, multipliers=answer.multipliers + scale * loose)


def other_forces(case, size, rng):
    """Right for other forces: all rows are met, and the equations of motion of another problem."""
    factor = 1.0 + size * rng.standard_normal(case.compulsion.impressed.size)
    return gauss.solve(replace(case.compulsion, impressed=case.compulsion.impressed * factor)).answer


def other_rows(case, size, rng):
    """Right for rows whose right-hand sides differ: the equations of motion are met, the rows are not."""
    shift = size * max(np.abs(case.compulsion.D).max(initial=0.0), 1.0) * rng.standard_normal(case.compulsion.D.size)
    found = gauss.solve(replace(case.compulsion, D=case.compulsion.D + shift)).answer
    return found if np.isfinite(found.a).all() else case.right.answer


def unbound(case, size, rng):
    """Right without the one-sided rows, which push nonetheless."""
    compulsion = case.compulsion
    free = gauss.solve(replace(compulsion, G=compulsion.G[:0], h=compulsion.h[:0])).answer
    return replace(free, inequality_multipliers=size * rng.random(compulsion.h.size))


def glued(case, size, rng):
    """Right when one-sided rows hold both ways."""
    compulsion = case.compulsion
    factor = factored(compulsion, np.arange(compulsion.h.size))
    a, qdd, multipliers, mu = factor.solve(compulsion.impressed, compulsion.D, compulsion.P, compulsion.h)
    return Answer(a, qdd, multipliers, mu)


def hidden(case, size, rng):
    """Wrong accelerations behind multipliers that are far too large, beside which they look small."""
    answer = case.right.answer
    pump, shift = 10.0 ** rng.uniform(3, 12), rng.standard_normal(answer.multipliers.size)
    a = answer.a + size * np.abs(answer.a).max() * rng.standard_normal(answer.a.size)
    return replace(answer, a=a, multipliers=answer.multipliers + pump * np.abs(answer.multipliers).max() * shift)


WHOLES = (partly, partly, partly, partly, pumped, other_forces, other_rows, unbound, glued, hidden)


def lie(case: Case, rng) -> tuple[str, Answer]:
    """Kind of a lie, and an answer that is wrong in something, with a claim and a message that mean nothing."""
    whole = WHOLES[rng.integers(len(WHOLES))]
    said = whole(case, 10.0 ** rng.uniform(-12, 1), rng)
    claim, words = bool(rng.random() < 0.8), str(rng.choice(["", "solved", "optimal"]))
    return whole.__name__.replace("_", " "), replace(said, found=claim, message=words)


def outcome(case: Case, said) -> str:
    """What becomes of an answer; an AssertionError if it is certified beyond what is right."""
    compulsion, right = case.compulsion, case.right
    solution = gauss.solve(compulsion, Telling(said))
    certificate, dual, status = solution.certificate, solution.certificate.dual, solution.status
    if np.isnan(certificate.error):
        assert not status.certified and status.reason
        return "no numbers"
    if not status.certified:
        assert status.reason
        return "refused"
    off = acceleration_errors(compulsion, solution.answer, (solution.a - right.a, solution.qdd - right.qdd))
    assert off.max() <= certificate.error + right.certificate.error and off.max() <= TOLERANCE
    wrong = dual.relative(*determined(case, case.touching, solution))
    rounding = dual.errors + right.certificate.dual.errors + ROUNDING
    assert (wrong <= rounding).all() and (solution.inequality_multipliers >= 0.0).all()
    given = dual.relative(*determined(case, dual.active, said))
    rounding += ROUNDING * dual.relative(said.multipliers, said.inequality_multipliers).max(initial=0.0)
    # rows let go may have been redundant, not wrong
    elsewhere = np.delete(np.abs(said.inequality_multipliers) + right.inequality_multipliers, dual.active)
    clear = (given > ABOVE * rounding) & ~elsewhere.any()
    assert dual.given_errors[clear] == pytest.approx(given[clear], rel=TWO_DIGITS)
    assert bool(status.replaced) == (dual.given_error > TOLERANCE)
    assert status.honest == (said.found == (not status.replaced))
    if status.accelerations_only:
        return "accelerations only"
    assert str(status) == "solved" and wrong.max(initial=0.0) <= TOLERANCE
    return "multipliers replaced" if status.replaced else "solved"


def determined(case: Case, active, found):
    """Errors of multipliers less what redundant rows, of which some one-sided ones hold, leave open in them."""
    multipliers = found.multipliers - case.right.multipliers
    mu = found.inequality_multipliers - case.right.inequality_multipliers
    loose, loose_mu = factored(case.compulsion, active).free_part(multipliers, mu[active])
    mu[active] -= loose_mu
    return multipliers - loose, mu


def outcomes(cases: dict[str, Case], count: int, seed: int = 0) -> Counter:
    """What becomes of many lies: numbers by kind of lie, problem and outcome."""
    rng, found = np.random.default_rng(seed), Counter()
    with np.errstate(all="ignore"):
        for _ in range(count):
            name = list(cases)[rng.integers(len(cases))]
            kind, said = lie(cases[name], rng)
            found[kind, name.replace("_", " "), outcome(cases[name], said)] += 1
    return found


@pytest.mark.slow
def test_no_lie_is_certified_beyond_what_is_right(cases):
    found = Counter()
    for (_, _, became), number in outcomes(cases, COUNT).items():
        found[became] += number
    assert sum(found.values()) == COUNT and min(found[kind] for kind in ("refused", "multipliers replaced", "solved")) > 10


def _raises(error):
    def said(compulsion):
        raise error

    return said


def _shaped(**parts):
    """What a backend says that answers in other shapes; made without looking at them, as a careless one would."""

    def said(compulsion):
        answer = object.__new__(Answer)
        right = gauss.solve(compulsion).answer
        for name in (*NAMES, "found", "message", "iterations"):
            object.__setattr__(answer, name, parts[name](getattr(right, name)) if name in parts else getattr(right, name))
        return answer

    return said


MALFORMED = {
    "nothing": (None, "returned None"),
    "an array": (np.zeros(3), "ndarray"),
    "a look-alike": (SimpleNamespace(a=1.0), "SimpleNamespace"),
    "a class": (lambda compulsion: Answer, "returned a type"),
    "too short": (_shaped(a=lambda x: x[:-1]), "a is float64 of shape"),
    "too long": (_shaped(qdd=lambda x: np.append(x, 0.0)), "qdd is float64 of shape"),
    "columns": (_shaped(a=lambda x: x[:, None]), "a is float64 of shape"),
    "a number": (_shaped(multipliers=lambda x: 1.0), "multipliers is a float"),
    "accelerations of None": (_shaped(a=lambda x: None), "a is None"),
    "complex": (_shaped(a=lambda x: x + 0j), "complex128"),
    "text": (_shaped(qdd=lambda x: x.astype(str)), "real numbers"),
    "objects": (_shaped(a=lambda x: x.astype(object)), "object of shape"),
    "ragged": (_shaped(a=lambda x: [[1.0], [1.0, 2.0]]), "a is no array"),
    "forces of rows that are not there": (_shaped(inequality_multipliers=lambda x: np.ones(x.size + 1)), "inequality_mult"),
    "a claim of None": (_shaped(found=lambda x: None), "found is None"),
    "iterations in words": (_shaped(iterations=lambda x: "many"), "iterations is a str"),
    "raises": (_raises(ZeroDivisionError("by nothing")), "ZeroDivisionError: by nothing (test_liars.py, line"),
    "panics": (_raises(BaseException("of a library")), "BaseException: of a library"),
    "singular": (_raises(np.linalg.LinAlgError("Singular matrix")), "Singular matrix"),
    "gives up in silence": (lambda compulsion: replace(_nan(compulsion), found=False, message=""), "gives no reason"),
    "not finite": (lambda compulsion: _nan(compulsion), "not finite"),
}


def _nan(compulsion):
    answer = gauss.solve(compulsion).answer
    return replace(answer, a=answer.a * np.nan)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MALFORMED)
def test_whatever_a_backend_returns_or_raises_becomes_a_status(cases, kind):
    said, words = MALFORMED[kind]
    for case in (cases["tree"], cases["tipping_box"]):
        status = gauss.solve(case.compulsion, Telling(said)).status
        assert not status.certified and words in str(status)


class Solving(Telling):
    """QP solver that says one thing of a programme."""

    name = "solving"


OUTCOMES = {
    "nothing": (lambda programme: None, "NoneType"),
    "x of another size": (lambda p: Outcome(np.zeros(p.c.size + 1), None, None, True, "ok"), "x is float64"),
    "y of another size": (lambda p: Outcome(np.zeros(p.c.size), np.zeros(1), None, True, "ok"), "y is float64"),
    "z of another size": (lambda p: Outcome(np.zeros(p.c.size), None, np.zeros(p.k.size + 1), True, "ok"), "z is float64"),
    "no x": (lambda p: Outcome(None, None, None, True, "optimal"), "optimal"),
    "raises": (_raises(KeyError("H")), "KeyError"),
}


@pytest.mark.parametrize("kind", OUTCOMES)
def test_whatever_a_qp_solver_returns_or_raises_becomes_a_status(cases, kind):
    said, words = OUTCOMES[kind]
    for case in (cases["planar_loop"], cases["tipping_box"]):
        status = gauss.solve(case.compulsion, Programmed(Solving(said))).status
        assert not status.certified and words in str(status)


def test_interruptions_pass(cases):
    with pytest.raises(KeyboardInterrupt):
        gauss.solve(cases["tree"].compulsion, Telling(_raises(KeyboardInterrupt())))


def test_a_factorisation_that_is_borrowed_gives_no_right_to_say_anything(cases):
    """Answers by the certificate's own factorisation, with corrections of any shape, and lies about both."""
    compulsion = cases["planar_loop"].compulsion

    class Borrowing(Telling):
        def solve_with(self, factor):
            return self.said(*make("recursion").solve_with(factor))

    for said in (lambda *_: None, lambda answer, _: (answer, None), lambda answer, c: (answer, (*c[:3], np.zeros(5)))):
        assert "failed" in str(gauss.solve(compulsion, Borrowing(said)).status)
    none = lambda answer, c: (replace(answer, multipliers=0.0 * answer.multipliers), tuple(0.0 * part for part in c))  # noqa: E731
    assert "accelerations only" in str(gauss.solve(compulsion, Borrowing(none)).status)


def test_workspaces_that_are_written_again_change_no_solution(cases):
    compulsion = cases["tree"].compulsion
    answer = gauss.solve(compulsion).answer
    solution = gauss.solve(compulsion, Telling(answer))
    answer.a[:], answer.multipliers[:] = np.nan, np.nan
    assert np.isfinite(solution.a).all() and np.isfinite(solution.multipliers).all()


def written_over(holder, seen: set[int]):
    """Write to every array that can be reached from an object, as far as that is possible."""
    if id(holder) in seen:
        return
    seen.add(id(holder))
    if isinstance(holder, np.ndarray):
        with contextlib.suppress(ValueError):
            holder[...] = 7
    elif is_dataclass(holder) or sparse.issparse(holder):
        written_over(list(vars(holder).values()), seen)
    elif isinstance(holder, list | tuple | dict):
        for part in holder.values() if isinstance(holder, dict) else holder:
            written_over(part, seen)


def writing(given):
    written_over(given, set())
    raise RuntimeError("done")


@pytest.mark.slow
@pytest.mark.parametrize("backend", [Telling(writing), *(Programmed(Solving(writing), form) for form in FORMS)])
@pytest.mark.parametrize("scene", ["four_bar", "box_on_plane_4"])
def test_what_a_backend_writes_to_spoils_nothing(scene, backend):
    """Neither the system, for later calls, nor the compulsion that the answer is certified for, nor what is kept."""
    system = gauss.compile_scene(gauss.load(scene))
    compulsion, later = (gauss.assemble(system, system.initial_state()) for _ in range(2))
    right = gauss.solve(later)
    assert "done" in str(gauss.solve(compulsion, backend).status)
    for found in (gauss.solve(compulsion), gauss.solve(gauss.assemble(system, system.initial_state()))):
        assert str(found.status) == "solved" and np.array_equal(found.qdd, right.qdd) and np.array_equal(found.a, right.a)
