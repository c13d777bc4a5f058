"""Equal chains of a mechanism in the lanes of vector registers: the same numbers as one after the other."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel, processor, write
from gauss.codegen.packed_function import PackedFunction
from gauss.dynamics import chain_lanes
from gauss.dynamics.chain_lanes import in_chain_lanes
from gauss.dynamics.equal_chains import equal_chains
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import numbers
from gauss.dynamics.plan import ACCELERATIONS
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_refinement import embedded_once, refined_once
from gauss.dynamics.traced_system import Program
from tests.support import mechanisms

ROUNDING = 1e-11  # relative to the largest acceleration: parameters round in another order than folded constants
CERTIFIED = 1e-9  # of accelerations that passed the check
KINDS = ("revolute", "prismatic", "universal", "ball", "cylindrical")
wide = pytest.mark.skipif(processor.width() < 4, reason="vector registers of two doubles are too narrow to gain")


def walker(
    legs: int, seed: int = 0, odd: int = 0, rods: bool = False, rotors: bool = False, equal_numbers: bool = False
) -> gauss.Scene:
    """Body that floats on random legs of equal joints, ``odd`` of them with another last joint.

    Each leg has a spring; with ``rods`` a rod closes a loop in it, with ``rotors`` a rotor is geared to its first hinge.
    """
    rng = np.random.default_rng(seed)
    kinds = ["revolute" if rotors else rng.choice(KINDS), *rng.choice(KINDS, size=2)]
    scene = gauss.Scene("walker", gravity=(0.3, -9.8, 1.0))
    scene.body("base", 8.0, mechanisms.inertia(rng), position=rng.normal(size=3))
    scene.free("root", "ground", "base")
    state = rng.bit_generator.state
    for leg in range(legs):
        if equal_numbers:
            rng.bit_generator.state = state
        previous = "base"
        for k, kind in enumerate(kinds):
            name = f"link{leg}.{k}"
            place = {"on": previous, "position": rng.normal(size=3), "rotation": rng.normal(size=3)}
            scene.body(name, rng.uniform(0.5, 2.0), mechanisms.inertia(rng), rng.normal(size=3), **place)
            kind = "screw" if leg < odd and k == 2 else kind
            axis = {} if kind == "ball" else {"axis": rng.normal(size=3)}
            pitch = {"pitch": 0.3} if kind == "screw" else {}
            scene.joint(f"joint{leg}.{k}", kind, previous, name, frame=name, **axis, **pitch)
            previous = name
        scene.spring(f"spring{leg}", "base", name, other_at=rng.normal(size=3), stiffness=50.0 + leg, damping=0.5)
        if rotors:
            scene.body(f"rotor{leg}", 0.2, (1e-3, 2e-3, 2e-3), on="base", position=(0.1, 0.1 * leg, 0.0))
            scene.revolute(f"shaft{leg}", "base", f"rotor{leg}", frame=f"rotor{leg}", axis=(1.0, 0.0, 0.0))
            scene.couple(f"gear{leg}", f"shaft{leg}", f"joint{leg}.0", 6.0)
        if rods:
            _rod(scene, f"rod{leg}", "base", f"link{leg}.1")
    return scene


def _rod(scene: gauss.Scene, name: str, one: str, other: str):
    """Rod between the origins of two bodies, on a ball and a Cardan joint."""
    scene.body(name, 0.4, (0.02, 0.03, 0.04), on=one, position=(0.2, 0.1, 0.3))
    scene.ball(f"{name} foot", one, name, at=(0.05, 0.1, -0.1), frame=one)
    scene.universal(f"{name} head", name, other, at=(0.1, -0.1, 0.1), frame=other, axis=(1.0, 0.0, 0.0))


def _with_triangle() -> gauss.Scene:
    """Walker with two rods on its base that hold each other: they cannot move, and are reduced."""
    scene = walker(3, 9)
    for name, x in (("left", 0.0), ("right", 1.0)):
        scene.body(name, 0.5, (0.01, 0.02, 0.03), on="base", position=(0.25 + 0.5 * x, 0.5, 0.0))
        scene.revolute(f"{name} foot", "base", name, at=(x, 0.0, 0.0), frame="base", axis=(0.0, 0.0, 1.0))
    scene.revolute("tip", "left", "right", at=(0.5, 1.0, 0.0), frame="base", axis=(0.0, 0.0, 1.0))
    return scene


WALKERS = {
    "two legs": lambda: walker(2),
    "four legs, two of them others": lambda: walker(4, odd=2),
    "three legs": lambda: walker(3, 1),
    "four equal legs": lambda: walker(4, 2, equal_numbers=True),
    "five legs": lambda: walker(5, 3),
    "eight legs": lambda: walker(8, 4),
    "ten legs": lambda: walker(10, 5),
    "five legs, one with a screw": lambda: walker(5, 6, odd=1),
    "geared legs": lambda: walker(4, 8, rotors=True),
    "a rigid triangle on the base": _with_triangle,
}
LOOPS = {
    "legs with rods": lambda: walker(4, 7, rods=True),
    "delta robot": lambda: gauss.load("delta_robot"),
    "Stewart platform": lambda: gauss.load("stewart_platform"),
    "uneven Stewart platform": lambda: gauss.load("stewart_platform", base=1.1, top=0.5, height=1.3),
}
EQUAL = {"five legs, one with a screw": 4, "ten legs": 8, "delta robot": 2}
EQUAL |= {"Stewart platform": 5, "uneven Stewart platform": 5}


def _once(system, laws):
    """Dynamics of the plan of single states."""
    return embedded_once if ACCELERATIONS.plan(Question(system, laws)).dynamics == "embedded loops" else refined_once


def _lanes(system) -> PackedFunction | None:
    laws = Laws(system)
    once = _once(system, laws)
    return in_chain_lanes(system, laws, once, (system.n_q, system.n_v, system.n_v, 1), "lanes")


def _reported(system) -> list[tuple[int, int]]:
    """Chains that ``explain`` reports: their number and that of their joints."""
    return system.dynamics.equal_chains(system, ACCELERATIONS.plan(Question(system, Laws(system, False))))


def _one_by_one(system) -> Kernel:
    """The function with its constants folded, one operation after the other."""
    laws = Laws(system)
    once = _once(system, laws)
    dynamics = lambda q, v, tau, t: once(Program(system, laws), q, v, tau, t)  # noqa: E731
    return Kernel(write(dynamics, system.n_q, system.n_v, system.n_v, 1), batch=False)


def _inputs(system):
    """Numbers of consistent states and generalised forces."""
    states, taus = mechanisms.consistent_states(system)
    return [
        np.concatenate([state.q, state.v, tau, [state.t]]).astype(float) for state, tau in zip(states, taus, strict=True)
    ]


@pytest.mark.slow
@wide
@pytest.mark.parametrize("name", [*WALKERS, *LOOPS])
def test_lanes_round_like_single_operations(name):
    system = gauss.compile_scene((WALKERS | LOOPS)[name]())
    packed = _lanes(system)
    assert packed is not None
    equal = EQUAL.get(name, len(equal_chains(system)[0].chains))
    assert max(map(len, packed.packed.units)) == len(equal_chains(system)[0].chains) == equal
    single, together, plain = Kernel(packed.function, batch=False), Kernel(packed, batch=False), _one_by_one(system)
    numbers = [packed.numbers[k] for k in sorted(packed.numbers)]
    for x in _inputs(system):
        found, accelerations = together(x), slice(system.n_v)
        np.testing.assert_array_equal(found, single(np.concatenate([x, numbers])))
        expected = plain(x)[accelerations]
        assert found[accelerations] == pytest.approx(expected, rel=0.0, abs=ROUNDING * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", [*WALKERS, *LOOPS])
def test_the_function_is_that_of_the_certified_solution(name):
    system = gauss.compile_scene((WALKERS | LOOPS)[name]())
    for state, tau in zip(*mechanisms.consistent_states(system), strict=True):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        found = system.forward_dynamics(state.q, state.v, tau)
        assert found == pytest.approx(exact, rel=0.0, abs=CERTIFIED * np.abs(exact).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_walkers(seed):
    legs, odd = 3 + seed % 4, seed % 3
    system = gauss.compile_scene(walker(legs, 20 + seed, odd=odd, rods=seed % 2 == 1))
    kinds = equal_chains(system)
    assert sorted(len(equal.chains) for equal in kinds) == sorted(count for count in (legs - odd, odd) if count > 1)
    for state, tau in zip(*mechanisms.consistent_states(system), strict=True):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        assert system.forward_dynamics(state.q, state.v, tau) == pytest.approx(
            exact, rel=0.0, abs=CERTIFIED * np.abs(exact).max()
        )


def _swapped(one: str, other: str) -> gauss.Scene:
    """Two legs with two rods each, in another order in the second leg."""
    scene = walker(2, 7)
    for leg, order in enumerate(((one, other), (other, one))):
        for name in order:
            place = {"on": f"link{leg}.0", "position": (0.1, 0.2, 0.3)}
            scene.body(f"{name}{leg}", 0.3, (0.01, 0.02, 0.03), **place)
            axis = {"axis": (0.0, 1.0, 0.2)}
            scene.joint(f"{name} {leg}", name, f"link{leg}.0", f"{name}{leg}", frame=f"{name}{leg}", **axis)
    return scene


def test_chains_are_equal_whatever_the_order_of_their_joints():
    system = gauss.compile_scene(_swapped("prismatic", "revolute"))
    ((equal,),) = (equal_chains(system),)
    kinds = [[equal.subsystem.joints[joint].pair.kind for joint in chain.joints] for chain in equal.chains]
    assert len(kinds) == 2 and kinds[0] == kinds[1]
    assert len(kinds[0]) == 5


def _related() -> gauss.Scene:
    scene = walker(4, 1)
    scene.constrain("held", lambda at: at.position("link0.2")[:1] - at.position("link1.2")[:1])
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("name", [*WALKERS, *LOOPS])
def test_equal_numbers_belong_to_each_chain_once(name):
    system = gauss.compile_scene((WALKERS | LOOPS)[name]())
    equal, found = equal_chains(system)[0], numbers(system)[0]
    assert sum(size for _, _, size in chain_lanes._elements(system, equal)) == found.size
    groups = list(chain_lanes._equal_numbers(system, equal))
    places = [place for group in groups for place in group]
    assert len(set(places)) == len(places)
    own = {equal.subsystem.Phi[6 * body + 3] for chain in equal.chains for body in chain.bodies}  # masses
    assert own <= set(found[places])
    assert (len(equal.chains), len(equal.chains[0].joints)) in _reported(system)


@pytest.mark.slow
@wide
def test_laws_in_python_are_called_beside_the_lanes():
    scene = walker(4, 1)
    scene.force("jet", "base", force=lambda t: (np.cos(float(t)), 0.0, 0.3))  # float() of a symbol
    system = gauss.compile_scene(scene)
    assert _lanes(system) is not None
    for state, tau in zip(*mechanisms.consistent_states(system), strict=True):
        exact = gauss.solve(gauss.assemble(system, state, tau)).qdd
        found = system.accelerations(state, tau)
        assert found == pytest.approx(exact, rel=0.0, abs=CERTIFIED * np.abs(exact).max())


LEFT_ALONE = {
    "one leg": lambda: walker(1),
    "two other legs": lambda: walker(2, odd=1),
    "a constraint of the user's": _related,
    "serial chain": lambda: gauss.load("spatial_chain", n=6),
    "ladder": lambda: gauss.load("n_four_bar", n=5),
    "one body": lambda: gauss.load("free_body"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LEFT_ALONE)
def test_other_mechanisms_keep_their_code(name):
    system = gauss.compile_scene(LEFT_ALONE[name]())
    assert _lanes(system) is None and not _reported(system)
