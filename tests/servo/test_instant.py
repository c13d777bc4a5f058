"""Servo-constraints at one instant: worked examples, two routes, what can be held and what cannot."""

import numpy as np
import pytest

import gauss
from gauss import math, servo
from gauss.errors import GaussError, SceneError, StateError
from gauss.scene import Guided
from gauss.servo import AuxiliarySupport, Motor, Servo, ServoRelation, Thruster, UnrealisableError
from gauss.system import random_state
from tests.support import mechanisms, servos

EXACT = 1e-13  # relative, of closed forms of a few operations
ROUTES = 1e-10  # relative, two routes through different matrices of condition up to about 1e3


def leaning(rate=0.7, acceleration=-0.4):
    return lambda t: 0.3 + rate * t + acceleration * t * t / 2


PENDULUM = ([0.2, 0.3], [0.1, 0.7])  # coordinates and rates of the worked example


@pytest.mark.parametrize("cart, effort", [(1.0, 4.843547882978168), (1000.0, 3371.0231199244)])
def test_inverted_pendulum_on_a_servo_cart(cart, effort):
    """Example 1 of the theory: ẍ = (g sin θ − l θ̈)/cos θ whatever the cart weighs."""
    held = Servo(servos.cart_pendulum(cart), [servos.lean(leaning())], [Motor("motor", "rail")])
    solution = servo.solve(held, held.system.state(*PENDULUM))
    x = (servos.G * np.sin(0.3) + 0.8 * 0.4) / np.cos(0.3)
    assert solution.efforts == pytest.approx([effort], rel=EXACT)
    assert solution.effort("motor") == solution.efforts[0]
    assert solution.qdd == pytest.approx([x, -0.4], rel=EXACT)
    assert solution.error <= EXACT
    assert "oblique" in solution.method


def test_the_ideal_reading_is_another_motion():
    """A contact that keeps θ pushes along the gradient of θ: no force on the cart, and the cart moves otherwise."""
    ideal = Servo(servos.cart_pendulum(), [servos.lean(leaning(), ideal=True)], [])
    motor = Servo(servos.cart_pendulum(), [servos.lean(leaning())], [Motor("torque", "pin")])
    state = ideal.system.state(*PENDULUM)
    by_contact, by_motor = servo.solve(ideal, state), servo.solve(motor, state)
    theta, M, m, length = 0.3, 1.0, 0.5, 0.8
    x = m * length * (0.7**2 * np.sin(theta) + 0.4 * np.cos(theta)) / (M + m)
    assert by_contact.qdd == pytest.approx([x, -0.4], rel=EXACT)
    assert by_motor.qdd == pytest.approx(by_contact.qdd, rel=EXACT)
    assert by_contact.multipliers[-1] == pytest.approx(-by_motor.efforts[0], rel=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["recursion", "kkt", "schur", "nullspace", "pinv", "clarabel", "daqp", "saddle"])
def test_ideal_servos_go_through_every_backend(backend):
    """Efforts are those of S u = b: the multipliers of a backend need not be right where a body has no inertia."""
    held = Servo(servos.cart_pendulum(), [servos.lean(leaning())], [Motor("torque", "pin")])
    state = held.system.state(*PENDULUM)
    solution, direct = servo.solve(held, state, backend=backend), servo.lagrange(held, state)
    assert solution.qdd == pytest.approx(direct.qdd, rel=1e-8)  # an interior-point method stops there
    assert solution.efforts == pytest.approx(direct.efforts, rel=1e-8)
    assert ("Gauss QP" in solution.method) == (backend != "saddle")


def test_oblique_servos_are_refused_by_a_minimiser():
    held = Servo(servos.cart_pendulum(), [servos.lean(leaning())], [Motor("motor", "rail")])
    with pytest.raises(GaussError, match="not ideal.*'saddle' or 'auto'"):
        servo.solve(held, held.system.state(*PENDULUM), backend="kkt")


@pytest.mark.slow
def test_explain_says_which_way():
    held = Servo(servos.cart_pendulum(), [servos.lean(leaning())], [Motor("motor", "rail")])
    ideal = Servo(servos.cart_pendulum(), [servos.lean(leaning())], [Motor("motor", "pin")])
    crane = servos.crane_servo(lambda t: 0.1 * t, lambda t: -3.0)
    guided = Servo(servos.cart_pendulum(), [servos.lean(leaning(), ideal=True)], [])
    state = held.system.state(*PENDULUM)
    assert "saddle system directly" in servo.explain(held, state)
    assert "minimum of the compulsion" in servo.explain(ideal, state)
    assert "contacts alone" in servo.explain(guided, state)
    assert "differentiated 4 times" in servo.explain(crane)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_three_routes_on_random_systems(seed):
    """Saddle system in maximal coordinates, Lagrange's equations with multipliers, and those that need none."""
    rng = np.random.default_rng(seed)
    held = servos.random_servo(rng, int(rng.integers(3, 5)), int(rng.integers(1, 4)))
    state = random_state(held.system, rng)
    found, route = servo.solve(held, state, backend="saddle"), servo.lagrange(held, state)
    scale = np.abs(found.qdd).max()
    assert np.abs(found.qdd - route.qdd).max() <= ROUTES * scale
    assert np.abs(found.efforts - route.efforts).max() <= ROUTES * np.abs(found.efforts).max()
    assert np.abs(found.qdd - servo.without_multipliers(held, state)).max() <= ROUTES * scale


@pytest.mark.slow
@pytest.mark.parametrize("by", ["A", "C", "D"])
def test_routes_agree_on_a_closed_loop(by):
    """Four-bar of spatial hinges, three redundant rows: the coupler's angle held by a motor in any joint."""
    scene = mechanisms.four_bar()
    scene.start("A", 0.5, 10.0)
    follow = ServoRelation("coupler", lambda t, m: m.position("coupler", (0.5, 0, 0))[1] - 0.3 * t)
    held = Servo(scene, [follow], [Motor("motor", by)])
    state = held.system.initial_state()
    found, route = servo.solve(held, state), servo.lagrange(held, state)
    assert found.qdd == pytest.approx(route.qdd, rel=ROUTES)
    assert found.efforts == pytest.approx(route.efforts, rel=ROUTES)


@pytest.mark.slow
def test_arm_with_one_motor_is_oblique():
    """Example 5: the tip on a line by the shoulder alone, against the ideal guide of the tip."""
    driven = Servo(servos.arm(), [servos.tip_on_line()], [Motor("shoulder motor", "shoulder")])
    guided = Servo(servos.arm(), [servos.tip_on_line(ideal=True)], [])
    state = driven.system.initial_state()
    one, other = servo.solve(driven, state), servo.solve(guided, state)
    jacobian = np.array([-np.sin(0.4) - 0.8 * np.sin(1.1), -0.8 * np.sin(1.1)])
    for solution in (one, other):
        assert jacobian @ solution.qdd == pytest.approx(0.0, abs=1e-12)
    assert np.abs(one.qdd - other.qdd).max() > 0.1 * np.abs(other.qdd).max()
    assert other.multipliers[-1] != 0.0


def test_arm_loses_hold_where_the_coupling_vanishes():
    """S = J M⁻¹ eᵀ is zero where m22 J1 = m12 J2: found along a sweep, and named."""
    driven = Servo(servos.arm(), [servos.tip_on_line()], [Motor("shoulder motor", "shoulder")])
    m22, a, J1, J2 = 0.06 + 1.0 * 0.4**2, 1.0 * 1.0 * 0.4, 1.0, 0.8

    def S(q1, q2):
        m12 = m22 + a * np.cos(q2)
        return m22 * (-J1 * np.sin(q1) - J2 * np.sin(q1 + q2)) + m12 * J2 * np.sin(q1 + q2)

    q2 = 0.7
    low, high = 1.0, 1.5
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if S(low, q2) * S(middle, q2) > 0 else (low, middle)
    verdict = servo.realisable(driven, driven.system.state([low, q2]))
    assert not verdict and verdict.outcome == "rank lost"
    assert "'tip'" in str(verdict) and "'shoulder motor'" in str(verdict)
    assert servo.realisable(driven, driven.system.state([low + 0.1, q2]))
    with pytest.raises(UnrealisableError, match="'tip'"):
        servo.solve(driven, driven.system.state([low, q2]))


@pytest.mark.slow
@pytest.mark.parametrize("weight", [1.0, 10.0, 1e4])
def test_indeterminate_efforts_are_of_least_weighted_norm(weight):
    """Example 7: a second motor on the rod; S u = b by the least weighted norm, u = R⁻¹Sᵀ(S R⁻¹Sᵀ)⁻¹ b."""
    motors = [Motor("motor", "rail"), Motor("torque", "pin")]
    held = Servo(servos.cart_pendulum(), [servos.lean(leaning())], motors, weights={"motor": weight})
    state = held.system.state(*PENDULUM)
    verdict = servo.realisable(held, state)
    assert verdict and verdict.outcome == "indeterminate" and "least weighted norm" in str(verdict)
    alone = [servo.solve(Servo(servos.cart_pendulum(), [servos.lean(leaning())], [motor]), state) for motor in motors]
    u1, u2 = (solution.efforts[0] for solution in alone)  # all solutions: u/u1 + w/u2 = 1
    share = np.array([1 / (weight * u1), 1 / u2])
    expected = share / (share @ [1 / u1, 1 / u2])
    assert servo.solve(held, state).efforts == pytest.approx(expected, rel=1e-12)


def test_preload_is_what_efforts_stay_near():
    motors = [Motor("motor", "rail"), Motor("torque", "pin")]
    held = Servo(servos.cart_pendulum(), [servos.lean(leaning())], motors, weights={"motor": 1e12}, preload={"motor": 2.0})
    assert servo.solve(held, held.system.state(*PENDULUM)).effort("motor") == pytest.approx(2.0, rel=1e-9)


def test_relations_at_three_levels_are_one_relation():
    """The same inclination, given as an angle, a rate and an acceleration."""
    profile, state = leaning(), None
    levels = {
        "position": lambda t, m: m.coordinate("pin") - profile(t),
        "velocity": lambda t, m: m.rate("pin") - (0.7 - 0.4 * t),
        "acceleration": lambda t, m: m.joint_acceleration("pin") + 0.4,
    }
    found = []
    for level, residual in levels.items():
        held = Servo(servos.cart_pendulum(), [ServoRelation("lean", residual, level=level)], [Motor("motor", "rail")])
        state = held.system.state(*PENDULUM)
        found.append(servo.solve(held, state).efforts[0])
    assert found == pytest.approx([found[0]] * 3, rel=EXACT)


def test_equilibrium_of_a_moved_support():
    """Example 2: a rod kept inclined by moving its support rests upright only; its support accelerates with g tan θ."""
    upright = Servo(servos.cart_pendulum(), [servos.lean(lambda t: 0.0 * t)], [AuxiliarySupport("support", ("rail",))])
    found = servo.equilibrium(upright, upright.system.state([0.4, 0.2]))
    assert found.state.q == pytest.approx([0.4, 0.0], abs=1e-10)
    assert found.efforts == pytest.approx([0.0], abs=1e-10)
    inclined = Servo(
        servos.cart_pendulum(), [servos.lean(lambda t: 0.25 + 0.0 * t)], [AuxiliarySupport("support", ("rail",))]
    )
    with pytest.raises(StateError, match="no equilibrium.*'pin'"):
        servo.equilibrium(inclined)
    state = inclined.system.state([0.0, 0.25])
    assert servo.solve(inclined, state).qdd[0] == pytest.approx(servos.G * np.tan(0.25), rel=EXACT)


def test_equilibrium_with_springs_and_loops():
    """A sprung four-bar held at an angle by its crank motor: the acceleration of the held equilibrium is zero."""
    scene = mechanisms.four_bar()
    scene.start("A", 0.0, 0.0)
    scene.spring("spring", "rocker", "ground", at=(0.7, 0, 0), other_at=(2, 0, 0), stiffness=30.0)
    hold = ServoRelation("crank", lambda t, m: m.coordinate("A") - 0.4)
    held = Servo(scene, [hold], [Motor("motor", "A")])
    found = servo.equilibrium(held)
    assert found.state.q[0] == pytest.approx(0.4, abs=1e-10)
    moving = servo.solve(held, found.state)
    assert np.abs(moving.qdd).max() <= 1e-8
    assert moving.efforts == pytest.approx(found.efforts, rel=1e-9)


def test_rows_and_directions_are_separate():
    """S = G X_W is unsymmetric for two crossed relations and motors, and each effort does what it says."""
    relations = [servos.lean(leaning()), servos.at(lambda t: 0.0 * t)]
    held = Servo(servos.cart_pendulum(), relations, [Motor("motor", "rail"), Motor("torque", "pin")])
    solution = servo.solve(held, held.system.state(*PENDULUM))
    load = gauss.assemble(held.system, held.system.state(*PENDULUM), load=solution.efforts)
    assert gauss.solve(load).qdd == pytest.approx(solution.qdd, abs=1e-12)
    assert solution.qdd == pytest.approx([0.0, -0.4], abs=1e-12)


def test_constraints_of_a_scene_are_held_by_servos():
    """A guided point of the scene's vocabulary, kept by two motors in place of a contact; the same relation by hand."""
    guided = Guided("tip", "lower", (0.8, 0, 0), lambda t: (1.2 + 0.1 * math.sin(t), 1.0, 0.0), ((1, 0, 0), (0, 1, 0)))
    by_hand = ServoRelation(
        "tip", lambda t, m: m.position("lower", (0.8, 0, 0))[:2] - np.array([1.2 + 0.1 * math.sin(t), 1.0])
    )
    motors = [Motor("one", "shoulder"), Motor("two", "elbow")]
    one, other = (Servo(servos.arm(), [relation], motors) for relation in (guided, by_hand))
    state = servo.initial_state(one)
    assert servo.solve(one, state).efforts == pytest.approx(servo.solve(other, state).efforts, rel=EXACT)
    assert "tip[1]" in one.held


@pytest.mark.slow
def test_contacts_of_a_scene_and_ideal_relations_are_one():
    """The rolling disk as a constraint of the scene, and as ideal relations beside a scene without it."""
    ideal = servos.rolling_servo()
    scene = servos.tilting_plate()
    scene.rolling("contact", "disk", "plate", servos.RADIUS, other_at=(0, 0, servos.PIVOT), axis=(0, 1, 0), crown=0.0)
    held = Servo(scene, [relation for relation in ideal.relations if not relation.ideal], ideal.actuators)
    state = servo.initial_state(ideal)
    one, other = servo.solve(ideal, state), servo.solve(held, state)
    assert one.qdd == pytest.approx(other.qdd, abs=1e-10)
    assert one.efforts == pytest.approx(other.efforts, rel=1e-9)


# What cannot be held is said, with the names of what clashes.

MOTOR, TORQUE = Motor("motor", "rail"), Motor("torque", "pin")
JET = Thruster("jet", "cart", force=(0, 1, 0))
UNREALISABLE = {
    "more relations than efforts": (
        [servos.lean(leaning()), servos.at(lambda t: 0.0 * t)],
        [MOTOR],
        "impossible",
        "lean, place.*only 1 freely disposable efforts .motor.",
    ),
    "no effort at all": ([servos.lean(leaning())], [], "impossible", "no effort to hold 'lean'"),
    "one relation twice": (
        [servos.lean(leaning()), servos.lean(leaning(), "again")],
        [MOTOR, TORQUE],
        "contradictory",
        "'lean', 'again' depend on each other",
    ),
    "contradicting relations": (
        [servos.lean(leaning()), servos.lean(lambda t: 0.5 * t, "other")],
        [MOTOR, TORQUE],
        "contradictory",
        "'lean', 'other' depend on each other",
    ),
    "three relations of two freedoms": (
        [
            servos.lean(leaning()),
            servos.at(lambda t: t),
            ServoRelation("both", lambda t, m: m.coordinate("pin") + m.position("cart")[0]),
        ],
        [MOTOR, TORQUE, Thruster("fan", "bob", force=(1, 0, 0))],
        "contradictory",
        "'lean', 'place', 'both' depend on each other",
    ),
    "a force against the rail": ([servos.lean(leaning())], [JET], "no hold", "no effort accelerates 'lean', and 'jet'"),
    "one of two forces is idle": (
        [servos.lean(leaning()), servos.at(lambda t: t)],
        [MOTOR, JET],
        "no hold",
        "'jet' does not move any relation",
    ),
    "what an ideal guide decides": (
        [servos.lean(leaning(), "guide", ideal=True), servos.lean(leaning())],
        [MOTOR],
        "contradictory",
        "contacts alone decide 'lean'",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", UNREALISABLE)
def test_what_cannot_be_held_is_said(case):
    relations, actuators, outcome, words = UNREALISABLE[case]
    held = Servo(servos.cart_pendulum(), relations, actuators)
    state = held.system.state(*PENDULUM)
    verdict = servo.realisable(held, state)
    assert not verdict and verdict.outcome == outcome
    for request in (servo.solve, servo.initial_state, lambda held, state: servo.simulate(held, 0.1, state=state)):
        with pytest.raises(UnrealisableError, match=words) as caught:
            request(held, state)
        assert caught.value.verdict.outcome == outcome


def test_singular_configuration_of_the_pendulum():
    """At θ = 90° the cart's force points along the rod: rank is lost there, and nearby it is not."""
    held = Servo(servos.cart_pendulum(), [servos.lean(lambda t: np.pi / 2 + t)], [MOTOR])
    verdict = servo.realisable(held, held.system.state([0.0, np.pi / 2]))
    assert verdict.outcome == "rank lost" and verdict.condition == np.inf
    near = servo.realisable(held, held.system.state([0.0, np.pi / 2 - 0.01]))
    assert near and near.singular_values[0] == pytest.approx(np.sin(0.01) / np.sqrt(3 - np.cos(0.01) ** 2), rel=1.0)


MISTAKES = {
    "no relation": (lambda: Servo(servos.cart_pendulum(), [], [MOTOR]), "at least one relation"),
    "no such coordinate": (lambda: _servo(actuators=[Motor("m", "rial")]), "Did you mean 'rail'"),
    "no such body": (lambda: _servo(actuators=[Thruster("m", "cat", force=(1, 0, 0))]), "Did you mean 'cart'"),
    "no such joint": (lambda: _servo(actuators=[AuxiliarySupport("m", ("pins",))]), "Did you mean 'pin'"),
    "a frame that is not there": (lambda: _servo(lambda t, m: m.position("bb")[0]), "Did you mean 'bob'"),
    "no force": (lambda: Thruster("m", "cart"), "neither force nor moment"),
    "a cable to itself": (lambda: servo.Cable("c", "bob", "bob"), "both ends"),
    "an actuator that is none": (lambda: _servo(actuators=["motor"]), "expected a Motor"),
    "names taken": (lambda: _servo(actuators=[MOTOR, Motor("motor", "pin")]), "different names"),
    "relations of one name": (
        lambda: Servo(servos.cart_pendulum(), [servos.lean(leaning())] * 2, [MOTOR]),
        "different names",
    ),
    "weight of nothing": (lambda: _servo(weights={"moto": 1.0}), "Did you mean 'motor'"),
    "negative weight": (lambda: _servo(weights={"motor": -1.0}), "positive finite number"),
    "no level": (lambda: ServoRelation("lean", lambda t, m: t, level="jerk"), "no level 'jerk'"),
    "no function": (lambda: ServoRelation("lean", 0.3), "must be a function"),
    "nothing that moves": (lambda: _servo(lambda t, m: 0.3 * t), "nothing that moves"),
    "what joints forbid": (lambda: _servo(lambda t, m: m.position("cart")[1] - t), "nothing that moves"),
    "a constant": (lambda: _servo(lambda t, m: 0.3), "whatever the motion"),
    "a branch": (lambda: _servo(lambda t, m: m.coordinate("pin") if float(t) > 1 else 0.0), "cannot be traced"),
    "the wrong sine": (lambda: _servo(lambda t, m: m.coordinate("pin") - __import__("math").sin(t)), "np.sin, not math.sin"),
    "rates at position level": (lambda: _servo(lambda t, m: m.rate("pin")), "say level='velocity'"),
    "accelerations at velocity level": (
        lambda: _servo(lambda t, m: m.joint_acceleration("pin"), "velocity"),
        "level='acceleration'",
    ),
    "squared accelerations": (lambda: _rows(lambda t, m: m.joint_acceleration("pin") ** 2), "not linear"),
}


def _servo(residual=None, level="position", actuators=(MOTOR,), **options):
    relation = servos.lean(leaning()) if residual is None else ServoRelation("lean", residual, level)
    return Servo(servos.cart_pendulum(), [relation], actuators, **options)


def _rows(residual):
    held = _servo(residual, "acceleration")
    return servo.realisable(held)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused(mistake):
    make, words = MISTAKES[mistake]
    with pytest.raises((SceneError, StateError), match=words):
        make()
