"""Loops eliminated where they close, against the general elimination and against the certified solution."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.dynamics import traced_refinement
from gauss.dynamics.embedded_aba import EmbeddedChains, EmbeddedMechanism, Embedding
from gauss.dynamics.front_rank import embedding
from gauss.dynamics.generic_rank import dependent_rows, is_generic_rank
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.plan import FUNCTIONS
from gauss.dynamics.rules import Question
from tests.support import mechanisms

pytestmark = pytest.mark.slow

ROUNDING = 1e-10  # relative to the largest entry: both eliminations lose digits near singular states
CERTIFIED = 1e-9  # of accelerations that passed the check


def _platform(last: str = "revolute", reach: float = 1.4):
    """Platform on four legs of six freedoms, whose last is a hinge or a slider on the platform.

    The lower and the upper rod of the first leg, 1 m each, are stretched to ``reach``.
    """
    scene = gauss.Scene(f"{last} platform")
    scene.body("platform", 3.0, (0.3, 0.3, 0.5), position=(0.0, 0.0, 1.0))
    for k in range(4):
        angle = k * np.pi / 2.0 + 0.2 * k
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        long = reach if k == 0 else 1.4 + 0.05 * k
        ankle = np.array([0.0, 0.0, 1.0]) + 0.3 * outward
        foot = ankle + long * (0.6 * outward - [0.0, 0.0, 0.8])
        bend = np.cross(outward, [0.1 * k, 0.2, 1.0])
        knee = (ankle + foot) / 2.0 + bend / np.linalg.norm(bend) * np.sqrt(max(0.0, 1.0 - long**2 / 4.0))
        for name, one, two in (("lower", foot, knee), ("upper", knee, ankle)):
            scene.body(f"{name}{k}", 1.0 + 0.1 * k, (0.02, 0.08, 0.08), position=tuple((one + two) / 2.0))
        scene.ball(f"foot{k}", "ground", f"lower{k}", at=tuple(foot))
        first = np.cross(knee - foot, ankle - foot + 0.1 * bend)
        first, second = first / np.linalg.norm(first), np.cross(first, knee - ankle)
        axes = {"axis": tuple(first), "second_axis": tuple(second / np.linalg.norm(second))}
        scene.universal(f"knee{k}", f"lower{k}", f"upper{k}", at=tuple(knee), **axes)
        make = scene.revolute if last == "revolute" else scene.prismatic
        make(f"ankle{k}", f"upper{k}", "platform", at=tuple(ankle), axis=(0.6 - 0.4 * k, 0.8, 0.3))
    return scene


def _crossed():
    """Two four-bars on a free base, and a third loop that runs through both."""
    scene = gauss.Scene("crossed")
    scene.body("base", 5.0, (0.4, 0.5, 0.6))
    scene.free("root", "ground", "base")
    for side, y in (("left", 0.3), ("right", -0.3)):
        points = {"hip": (0, y, 0), "knee": (0.1, y, -0.5), "ankle": (0.4, y, -0.6), "heel": (0.35, y, 0.05)}
        rods = {"thigh": ("hip", "knee"), "shin": ("knee", "ankle"), "rod": ("heel", "ankle")}
        for name, ends in rods.items():
            middle = np.mean([points[end] for end in ends], axis=0)
            scene.body(f"{side} {name}", 1.0, (0.03, 0.04, 0.05), position=tuple(middle))
        scene.revolute(f"{side} hip", "base", f"{side} thigh", at=points["hip"], axis=(0.0, 1.0, 0.0))
        scene.revolute(f"{side} knee", f"{side} thigh", f"{side} shin", at=points["knee"], axis=(0.1, 1.0, 0.0))
        scene.ball(f"{side} heel", "base", f"{side} rod", at=points["heel"])
        scene.ball(f"{side} ankle", f"{side} rod", f"{side} shin", at=points["ankle"])
    scene.body("tie", 0.5, (0.05, 0.01, 0.05), position=(0.25, 0.0, -0.55))
    scene.ball("tie left", "left shin", "tie", at=(0.25, 0.3, -0.55))
    scene.universal(
        "tie right", "right shin", "tie", at=(0.25, -0.3, -0.55), axis=(1.0, 0.0, 0.0), second_axis=(0.0, 0.0, 1.0)
    )
    return scene


def _upright(model: str):
    """A model whose loop joint slides along gravity."""
    return replace(gauss.load(model), gravity=(9.8, 0.0, 0.0))


def _floating():
    """Two bodies held together by ball joints to the ground and each other, and a free joint that measures a pose."""
    scene = gauss.Scene("measured")
    for name, x in (("one", 0.5), ("two", 1.5)):
        scene.body(name, 1.0, (0.1, 0.2, 0.25), position=(x, 0.1, 0.2))
    scene.ball("root", "ground", "one")
    scene.ball("middle", "one", "two", at=(1.0, 0.0, 0.1))
    scene.free("pose", "ground", "two", at=(1.5, 0.1, 0.2))
    return scene


SCENES = {
    name: lambda name=name: gauss.load(name) for name in ("four_bar", "slider_crank", "rolling_disk", "stewart_platform")
}
SCENES |= {
    "squeezer": lambda: gauss.load("andrews_squeezer"),
    "ladder": lambda: gauss.load("n_four_bar", n=3),
    "four-bars of a leg": lambda: gauss.load("four_bar_branch", n=2),
    "belt": lambda: gauss.load("parallel_chains", belt=True),
    "chains": lambda: gauss.load("parallel_chains"),
    "platform on hinges": lambda: _platform("revolute"),
    "platform on sliders": lambda: _platform("prismatic"),
    "crossed loops": _crossed,
    "guide along gravity": lambda: _upright("slider_crank"),
    "measured pose": _floating,
}
WITH_HUBS = {"stewart_platform", "platform on hinges", "platform on sliders"}


def _states(system):
    """Consistent states with generalised forces along all coordinates, of loop joints, too."""
    return zip(*mechanisms.consistent_states(system), strict=True)


def _agree(one, two):
    one, two = (np.asarray(part, dtype=float) for part in (one, two))
    assert one == pytest.approx(two, rel=ROUNDING, abs=ROUNDING * np.abs(two).max(initial=1e-3))


@pytest.mark.parametrize("name", SCENES)
def test_both_eliminations_agree(name):
    system = gauss.compile_scene(SCENES[name]())
    for state, tau in _states(system):
        given = system, state.q, state.v, state.t
        embedded, general = EmbeddedMechanism(*given), Mechanism(*given)
        assert any(body.embedded.hubs for body in embedded.bodies) == (name in WITH_HUBS)
        (found, y), (expected, multipliers) = embedded.motion(tau), general.motion(tau)
        _agree(found, expected)
        _agree(general.reaction(y), general.reaction(multipliers))
        target = np.random.default_rng(1).standard_normal(general.scale.size)
        for mine, theirs in zip(embedded.response(tau, target), general.response(tau, target), strict=True):
            _agree(mine, theirs)


@pytest.mark.parametrize("name", ["guide along gravity", "measured pose", "platform on hinges", "crossed loops"])
def test_the_function_is_that_of_the_certified_solution(name):
    system = gauss.compile_scene(SCENES[name]())
    assert FUNCTIONS.plan(Question(system, Laws(system))).dynamics == "embedded loops"
    for state, tau in _states(system):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        found = system.forward_dynamics(state.q, state.v, tau)
        assert found == pytest.approx(exact, rel=CERTIFIED, abs=CERTIFIED * np.abs(exact).max())


def test_a_stretched_leg_is_left_to_the_general_elimination():
    """The platform moves on, but the leg alone cannot meet its rows: its front is singular."""
    regular = gauss.compile_scene(_platform("revolute"))
    stretched = gauss.compile_scene(_platform("revolute", reach=2.0))
    for system, is_regular in ((regular, True), (stretched, False)):
        state, tau = system.initial_state(), np.linspace(-1.0, 1.0, system.n_v)
        with np.errstate(all="ignore"):
            assert EmbeddedMechanism(system, state.q, state.v).is_regular == is_regular
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        found = system.forward_dynamics(state.q, state.v, tau)
        assert found == pytest.approx(exact, rel=CERTIFIED, abs=CERTIFIED * np.abs(exact).max())


def test_legs_that_cannot_meet_their_own_rows_are_eliminated_without_hubs():
    """The rods of a delta robot turn about themselves."""
    system = gauss.compile_scene(gauss.load("delta_robot"))
    assert embedding(system) == Embedding(EmbeddedChains, [])
    for state, tau in _states(system):
        given = system, state.q, state.v, state.t
        (found, _), (expected, _) = EmbeddedChains(*given).motion(tau), Mechanism(*given).motion(tau)
        _agree(found, expected)


def _held_at_three_points():
    """An arm of seven hinges on a free base, whose end is held on the ground by three ball joints."""
    rng, scene, inner = np.random.default_rng(3), gauss.Scene("three points"), "base"
    scene.body("base", 3.0, (0.3, 0.4, 0.5))
    scene.free("root", "ground", "base")
    for k in range(7):
        x = np.array([0.3 * (k + 1), 0.05 * k**2, 0.1 * k])
        scene.body(f"link{k}", 1.0, (0.02, 0.03, 0.04), position=tuple(x))
        scene.revolute(f"hinge{k}", inner, f"link{k}", at=tuple(x - [0.15, 0.0, 0.0]), axis=tuple(rng.standard_normal(3)))
        inner = f"link{k}"
    for k, side in enumerate(np.eye(3)):
        scene.ball(f"point{k}", "ground", inner, at=tuple(x + 0.2 * side))
    return scene


REDUNDANT = {  # with the number of rows that follow from the others
    "bricard": (lambda: gauss.load("bricard"), 1),
    "planetary_gears": (lambda: gauss.load("planetary_gears"), 2),
    "held at three points": (_held_at_three_points, 3),
}


@pytest.mark.parametrize("name", REDUNDANT)
def test_of_redundant_constraints_a_set_of_full_rank_is_eliminated(name):
    make, redundant = REDUNDANT[name]
    system = gauss.compile_scene(make())
    found = embedding(system)
    assert found is not None and sum(map(len, found.dependent)) == redundant
    assert FUNCTIONS.plan(Question(system, Laws(system))).dynamics == "embedded loops"
    for state, tau in _states(system):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        under_loads = system.forward_dynamics(state.q, state.v, tau)
        assert under_loads == pytest.approx(exact, rel=CERTIFIED, abs=CERTIFIED * np.abs(exact).max())
        given = system, state.q, state.v, state.t
        (rates, y), (expected, multipliers) = (one(*given).motion(tau) for one in (found, Mechanism))
        _agree(rates, expected)
        _agree(Mechanism(*given).reaction(y), Mechanism(*given).reaction(multipliers))


@pytest.mark.parametrize("name", ["slider_crank", "held at three points"])
def test_a_row_that_is_wrongly_left_out_is_no_silent_fault(name, monkeypatch):
    scene = replace((SCENES | {key: make for key, (make, _) in REDUNDANT.items()})[name](), gravity=(0.1, 0.2, -9.7))
    monkeypatch.setattr(traced_refinement, "embedding_of", lambda system: Embedding(dependent=wrong))
    system = gauss.compile_scene(scene)  # of its own: machine code is cached by content
    rows = dependent_rows(system, system.initial_state())
    wrong = [set(range(sum(len(c.sizes) for c in body.constraints))) for body in Mechanism(*_start(system)).bodies]
    wrong = [own and own - {min(own - set(left))} for own, left in zip(wrong, rows, strict=True)]
    for state, tau in _states(system):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        found = system.forward_dynamics(state.q, state.v, tau)
        assert found == pytest.approx(exact, rel=CERTIFIED, abs=CERTIFIED * np.abs(exact).max())


def _start(system):
    state = system.initial_state()
    return system, state.q, state.v, state.t


def _flat():
    """Parallelogram whose rods all lie on one line."""
    scene = gauss.Scene("flat")
    places = {"ground": (0.0, 1.0), "left": (0.0, 0.5), "coupler": (0.5, 1.5), "right": (1.0, 1.5)}
    for name in ("left", "coupler", "right"):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), position=(np.mean(places[name]), 0.0, 0.0))
    for one, two, x in (
        ("ground", "left", 0.0),
        ("left", "coupler", 0.5),
        ("coupler", "right", 1.5),
        ("ground", "right", 1.0),
    ):
        scene.revolute(f"{one} {two}", one, two, at=(x, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    return scene


def test_rows_that_depend_on_others_at_the_start_alone_are_kept():
    for make, generic in ((_flat, False), (REDUNDANT["bricard"][0], True)):
        system = gauss.compile_scene(make())
        dependent = dependent_rows(system, system.initial_state())
        assert sum(map(len, dependent)) == 1 and is_generic_rank(system, dependent) == generic
        found = embedding(system)
        assert found is not None and any(found.dependent) == generic
