"""Optimal motions against closed forms, and against collocation of hand-written equations with CasADi alone."""

import numpy as np
import pytest
from scipy.optimize import brentq

import gauss
from gauss.errors import ArgumentError, GaussError, SimulationError, StateError

casadi = pytest.importorskip("casadi")
EXACT = 1e-7  # relative: what IPOPT leaves, where the mesh holds the optimum exactly
MESH = 1e-6  # default tolerance of the mesh
DISCRETE = 2e-4  # relative difference of costs: fourth order of both meshes, some 0.05 s apart
GRAVITY = 9.81


def cart(limit=1.0):
    """Mass of 1 kg on a rail."""
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.prismatic("rail", "ground", scene.body("cart", 1.0, (0.1, 0.1, 0.1)), axis=(1, 0, 0))
    scene.input("push", "rail", limits=limit)
    return scene


def swing_up():
    """Cart and pole of Kelly, An introduction to trajectory optimization, SIAM Review 59, 2017, section 6."""
    scene = gauss.Scene("cart-pole of Kelly")
    base, pole = scene.body("cart", 1.0, (0.1, 0.1, 0.1)), scene.body("pole", 0.3, (0, 0, 0), com=(0, 0, -0.5))
    scene.prismatic("rail", "ground", base, axis=(1, 0, 0))
    scene.revolute("pin", base, pole, axis=(0, -1, 0))
    scene.input("push", "rail", limits=20.0)
    return scene


def four_bar():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.input("motor", "A")
    return scene


REST = {"rail": 0.0, "rail rate": 0.0}


def of_kelly(x, u):
    """Rates of (x, θ, ẋ, θ̇), by hand (Kelly 2017, eq. 6.1 and 6.2)."""
    _, angle, speed, turn = casadi.vertsplit(x)
    sine, cosine = casadi.sin(angle), casadi.cos(angle)
    mass = 1.0 + 0.3 * sine**2
    pushed = (0.5 * 0.3 * sine * turn**2 + u + 0.3 * GRAVITY * cosine * sine) / mass
    turned = -(0.5 * 0.3 * cosine * sine * turn**2 + u * cosine + 1.3 * GRAVITY * sine) / (0.5 * mass)
    return casadi.vertcat(speed, turn, pushed, turned)


def four_bar_by_crank(x, u):
    """Rates of (φ, φ̇) of the four-bar: links as in its file, the loop solved by hand, Lagrange's equation for φ."""
    angle = casadi.SX.sym("angle")
    B = 0.4 * casadi.vertcat(casadi.cos(angle), casadi.sin(angle))
    D = casadi.DM([1.2, 0.0])
    d = D - B
    square = casadi.dot(d, d)
    along = (square + 1.0 - 0.7**2) / 2.0 / square
    height = casadi.sqrt(1.0 / square - along**2)
    arm = along * d + height * casadi.vertcat(-d[1], d[0])  # from B to C
    links = [(1.2, 0.016, B / 2.0), (3.0, 0.25, B + arm / 2.0), (2.2, 0.09, D + (B + arm - D) / 2.0)]
    turns = [angle, casadi.atan2(arm[1], arm[0]), casadi.atan2(*casadi.vertsplit((B + arm - D)[[1, 0]]))]
    inertia = sum(
        m * casadi.sumsqr(casadi.jacobian(place, angle)) + J * casadi.jacobian(turn, angle) ** 2
        for (m, J, place), turn in zip(links, turns, strict=True)
    )
    height = sum(m * place[1] for m, _, place in links)
    terms = casadi.Function(
        "terms", [angle], [inertia, casadi.jacobian(inertia, angle), 9.8 * casadi.jacobian(height, angle)]
    )
    M, slope, weight = terms(x[0])
    return casadi.vertcat(x[1], (u - slope * x[1] ** 2 / 2.0 - weight) / M)


def hermite_simpson(rates, start, end, duration, intervals, guess=0.0):
    """Least ∫ u² dt by compressed Hermite–Simpson collocation (Kelly 2017, section 4)."""
    n, h = len(start), duration / intervals
    problem = casadi.Opti()
    x, u, middle = problem.variable(n, intervals + 1), problem.variable(intervals + 1), problem.variable(intervals)
    cost = 0.0
    for k in range(intervals):
        f0, f1 = rates(x[:, k], u[k]), rates(x[:, k + 1], u[k + 1])
        f = rates((x[:, k] + x[:, k + 1]) / 2.0 + h / 8.0 * (f0 - f1), middle[k])
        problem.subject_to(x[:, k + 1] == x[:, k] + h / 6.0 * (f0 + 4.0 * f + f1))
        cost += h / 6.0 * (u[k] ** 2 + 4.0 * middle[k] ** 2 + u[k + 1] ** 2)
    problem.subject_to(x[:, 0] == start)
    problem.subject_to(x[:, -1] == end)
    problem.set_initial(x, np.linspace(start, end, intervals + 1).T)
    problem.minimize(cost)
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    solution = problem.solve()
    return float(solution.value(cost))


def test_least_time_of_a_double_integrator_is_bang_bang():
    motion = gauss.optimal_motion(cart(), (0.1, 10.0), start=REST, end=REST | {"rail": 1.0}, cost="time")
    assert abs(motion.duration - 2.0) <= EXACT * 2.0 and abs(motion.cost - motion.duration) <= EXACT
    middle = (motion.t[1:] + motion.t[:-1]) / 2.0
    np.testing.assert_allclose(motion.law(middle)[:, 0], np.where(middle < 1.0, 1.0, -1.0), atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4, 6])
def test_least_effort_of_a_double_integrator(order):
    motion = gauss.optimal_motion(cart(100.0), 0.8, start=REST, end=REST | {"rail": 0.5}, intervals=8, order=order)
    assert abs(motion.cost - 12.0 * 0.5**2 / 0.8**3) <= (0.02 if order == 2 else EXACT) * motion.cost
    if order > 2:  # the force is linear in time, its motion a cubic
        times = np.array([0.05, 0.31, 0.77])
        np.testing.assert_allclose(motion.law(times)[:, 0], 6 * 0.5 / 0.8**2 - 12 * 0.5 / 0.8**3 * times, rtol=1e-6)


@pytest.mark.slow
def test_brachistochrone_is_a_cycloid():
    scene = gauss.Scene("brachistochrone", gravity=(0, 0, 0))
    scene.revolute("steer", "ground", scene.body("wheel", 1.0, (1, 1, 1)), axis=(0, 1, 0))
    scene.input("turn", "steer")
    scene.state("speed", rate=lambda t, at: GRAVITY * gauss.math.sin(at.coordinate("steer")))
    scene.state("x", rate=lambda t, at: at.rate("speed") * gauss.math.cos(at.coordinate("steer")))
    scene.state("y", rate=lambda t, at: at.rate("speed") * gauss.math.sin(at.coordinate("steer")))  # downwards
    still = dict.fromkeys(("x", "y", "speed"), 0.0)
    limits = {"steer": (-1.5, 1.6)}
    motion = gauss.optimal_motion(scene, (0.1, 5), start=still, end={"x": 1.0, "y": 0.65}, cost="time", limits=limits)
    turn = brentq(lambda a: (a - np.sin(a)) / (1.0 - np.cos(a)) - 1.0 / 0.65, 0.1, 6.2)
    assert abs(motion.duration - turn * np.sqrt(0.65 / (1.0 - np.cos(turn)) / GRAVITY)) <= EXACT
    fast = motion.t > 0.5 * motion.duration  # at the start, at rest, the slope hardly matters
    np.testing.assert_allclose(motion.v[fast, 0], -turn / 2.0 / motion.duration, rtol=1e-3)  # a cycloid turns uniformly


@pytest.mark.slow
def test_swing_up_of_kelly():
    system = gauss.compile_scene(swing_up())
    start, end = system.state([0.0, 0.0], [0.0, 0.0]), system.state([1.0, np.pi], [0.0, 0.0])
    motion = gauss.optimal_motion(system, 2.0, start=start, end=end, limits={"rail": 2.0})
    expected = hermite_simpson(of_kelly, np.zeros(4), np.array([1.0, np.pi, 0.0, 0.0]), 2.0, 60)
    assert abs(motion.cost - expected) <= DISCRETE * expected
    assert motion.mesh_error <= MESH and motion.kkt <= 1e-6 and motion.residual <= 1e-6
    simulated = motion.simulate(rtol=1e-10, atol=1e-10)
    error = np.abs(np.concatenate([simulated.q[-1] - motion.q[-1], simulated.v[-1] - motion.v[-1]])).max()
    assert error <= 3.0 * motion.simulation_error * max(1.0, *system.scale.rates)
    again = gauss.optimal_motion(system, 2.0, start=start, end=end, guess=motion, intervals=40)
    assert abs(again.cost - motion.cost) <= DISCRETE * motion.cost and again.iterations < motion.iterations


@pytest.mark.slow
def test_a_linkage_moves_as_its_independent_coordinate():
    rest = {"A": 0.0, "A rate": 0.0}
    motion = gauss.optimal_motion(four_bar(), 0.6, start=rest, end=rest | {"A": 3.0})
    expected = hermite_simpson(four_bar_by_crank, np.zeros(2), np.array([3.0, 0.0]), 0.6, 60)
    assert abs(motion.cost - expected) <= DISCRETE * expected
    system = motion.system
    for t, q, v in zip(motion.t, motion.q, motion.v, strict=True):
        closed = system.initial_state(q, v, t, keep=["A"])
        np.testing.assert_allclose(q, closed.q, atol=1e-7)
        np.testing.assert_allclose(v, closed.v, atol=1e-6)


def test_a_wheel_turns_uniformly_against_a_damper():
    scene = gauss.Scene("wheel", gravity=(0, 0, 0))
    scene.revolute("A", "ground", scene.body("rim", 2.0, (0.3, 0.3, 0.3)))
    scene.joint_spring("bearing", "A", damping=0.7)
    scene.input("motor", "A")
    motion = gauss.optimal_motion(scene, 1.5, start={"A": 0.2}, periodic={"A": 2 * np.pi}, intervals=6)
    effort = 0.7 * 2 * np.pi / 1.5
    assert abs(motion.cost - 1.5 * effort**2) <= EXACT * motion.cost
    np.testing.assert_allclose(motion.v[:, 0], 2 * np.pi / 1.5, rtol=1e-6)
    np.testing.assert_allclose(motion.q[[0, -1], 0], [0.2, 0.2 + 2 * np.pi], atol=1e-7)


@pytest.mark.slow
def test_a_period_of_a_damped_linkage():
    scene = four_bar()
    scene.joint_spring("bearing", "A", damping=0.5)
    motion = gauss.optimal_motion(scene, 1.0, start={"A": 0.0}, periodic={"A": 2 * np.pi}, intervals=30)
    turns = (motion.q[-1] - motion.q[0]) / (2 * np.pi)
    np.testing.assert_allclose(turns, [1.0, -1.0, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(motion.v[-1], motion.v[0], atol=1e-6 * np.abs(motion.v[0]).max())
    balance = gauss.energy(motion.simulate(rtol=1e-9, atol=1e-9))
    assert np.abs(balance.balance).max() <= 1e-6 * balance.scale
    steady = np.trapezoid(0.5**2 * motion.v[:, 0] ** 2, motion.t)  # effort of the same motion, were only the damper driven
    assert motion.cost < 4.0 * steady


@pytest.mark.slow
def test_a_ball_joint_turns_about_one_axis():
    scene = gauss.Scene("ball", gravity=(0, 0, 0))
    scene.ball("J", "ground", scene.body("top", 1.0, (0.4, 0.4, 0.4)))
    system = gauss.compile_scene(scene)
    for name in system.coordinates:
        scene.input(f"torque {name}", name)
    system = gauss.compile_scene(scene)
    turn, axis = 1.2, np.array([2.0, -1.0, 2.0]) / 3.0
    end = system.state(np.concatenate([[np.cos(turn / 2)], np.sin(turn / 2) * axis]), np.zeros(3))
    motion = gauss.optimal_motion(system, 0.9, start=system.state(), end=end, intervals=8)
    assert abs(motion.cost - 12.0 * (0.4 * turn) ** 2 / 0.9**3) <= 1e-5 * motion.cost
    np.testing.assert_allclose(np.linalg.norm(motion.q, axis=1), 1.0, atol=1e-9)


def test_a_cost_of_ones_own():
    weighted = gauss.optimal_motion(
        cart(50.0), (0.1, 10.0), start=REST, end=REST | {"rail": 1.0}, cost=lambda t, q, v, u: 36.0 + u[0] ** 2, intervals=8
    )
    # 36 T + 12 / T³ is least where T⁴ = 1
    assert abs(weighted.duration - 1.0) <= 1e-5 and abs(weighted.cost - 48.0) <= 1e-5


@pytest.mark.slow
def test_inputs_of_a_motion_drive_a_simulation():
    motion = gauss.optimal_motion(cart(), 3.0, start=REST, end=REST | {"rail": 1.0}, intervals=10)
    sampled = gauss.simulate(motion.system, 3.0, state=motion.start, control=motion.control, rate=1000, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sampled.q[-1], motion.end.q, atol=2e-3)  # inputs held for a millisecond
    np.testing.assert_allclose(motion["push"](1.0), motion.control(1.0)[0])
    with pytest.raises(ArgumentError, match="push"):
        motion["pusch"]


def with_friction():
    scene = swing_up()
    scene.joint_friction("rail", 1.0, name="brake")
    return scene


GOAL = REST | {"rail": 1.0}
REFUSED = {  # what is refused, and words of the message
    "time is too short": (
        lambda: gauss.optimal_motion(cart(), 1.5, start=REST, end=GOAL),
        SimulationError,
        "'rail' misses 1",
    ),
    "no inputs": (lambda: gauss.optimal_motion(gauss.load("pendulum"), 1.0), SimulationError, "scene.input"),
    "friction": (lambda: gauss.optimal_motion(with_friction(), 1.0), SimulationError, "brake"),
    "start": (lambda: gauss.optimal_motion(cart(), 1.0, start={"rial": 0.0}), ArgumentError, "rail"),
    "end": (lambda: gauss.optimal_motion(cart(), 1.0, end={"rail speed": 0.0}), ArgumentError, "rail rate"),
    "limits": (lambda: gauss.optimal_motion(cart(), 1.0, limits={"pusch": 1.0}), ArgumentError, "push"),
    "periodic": (lambda: gauss.optimal_motion(cart(), 1.0, periodic={"rial": 1.0}), ArgumentError, "rail"),
    "not a number": (lambda: gauss.optimal_motion(cart(), 1.0, end={"rail": np.nan}), ArgumentError, "'rail'"),
    "no duration": (lambda: gauss.optimal_motion(cart(), np.nan), ArgumentError, "duration"),
    "negative duration": (lambda: gauss.optimal_motion(cart(), -1.0), ArgumentError, "duration"),
    "reversed": (lambda: gauss.optimal_motion(cart(), (2.0, 1.0)), ArgumentError, "duration"),
    "fixed time": (lambda: gauss.optimal_motion(cart(), 2.0, cost="time"), ArgumentError, "duration=\\(least"),
    "cost": (lambda: gauss.optimal_motion(cart(), 2.0, cost="effrot"), ArgumentError, "effort"),
    "untraced": (lambda: gauss.optimal_motion(cart(), 2.0, cost=lambda t, q, v, u: float(u[0])), ArgumentError, "cost"),
    "vector cost": (lambda: gauss.optimal_motion(cart(), 2.0, cost=lambda t, q, v, u: [u[0], 1.0]), ArgumentError, "cost"),
    "order": (lambda: gauss.optimal_motion(cart(), 2.0, order=5), ArgumentError, "order"),
    "intervals": (lambda: gauss.optimal_motion(cart(), 2.0, intervals=0), ArgumentError, "intervals"),
    "tolerance": (lambda: gauss.optimal_motion(cart(), 2.0, tolerance=-1.0), GaussError, "tolerance"),
    "guess": (lambda: gauss.optimal_motion(cart(), 2.0, guess=3), ArgumentError, "guess"),
    "beyond": (lambda: gauss.optimal_motion(cart(), 2.0, end={"rail": 3.0}, limits={"rail": 2.0}), ArgumentError, "limits"),
    "no limit": (lambda: gauss.optimal_motion(cart(), 2.0, limits={"push": None}), ArgumentError, "push"),
    "no limits left": (lambda: gauss.optimal_motion(cart(), 2.0, limits={"push": (3.0, 4.0)}), ArgumentError, "push"),
    "open loop": (lambda: gauss.optimal_motion(four_bar(), 1.0, end={"A": 0.3, "D": 3.0}), StateError, "A, D"),
    "other rate": (
        lambda: gauss.optimal_motion(four_bar(), 1.0, start={"A": 0.0, "A rate": 1.0, "D rate": 0.0}),
        StateError,
        "rate",
    ),
}


LOOPS = ("open loop", "other rate")


@pytest.mark.parametrize("what", [what for what in REFUSED if what not in LOOPS])
def test_bad_input_is_refused_by_name(what):
    call, error, words = REFUSED[what]
    with pytest.raises(error, match=words):
        call()


@pytest.mark.slow
@pytest.mark.parametrize("what", LOOPS)
def test_conditions_that_loops_contradict_are_refused(what):
    test_bad_input_is_refused_by_name(what)


@pytest.mark.slow
def test_too_few_refinements_are_named():
    with pytest.raises(SimulationError, match="refinements"):
        gauss.optimal_motion(swing_up(), 2.0, start={"rail": 0.0, "pin": 0.0}, end={"pin": 1.0}, refinements=0, intervals=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "length, time, mass", [(1e9, 1, 1), (1e-9, 1, 1), (1, 1e9, 1), (1, 1e-9, 1), (1, 1, 1e9), (1, 1, 1e-9)]
)
def test_units_do_not_decide_on_the_optimum(length, time, mass):
    """A cart goes 1 length: in the least time T = 2 √(m d / F), and in 2 times for the effort 12 m² d² / T³."""
    cart, force = gauss.Scene("cart", gravity=(0.0, -9.81 * length / time**2, 0.0)), mass * length / time**2
    cart.body("cart", mass, (0.1 * mass * length**2,) * 3, com=(0.0, 0.5 * length, 0.0))
    cart.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    cart.input("push", "rail", limits=4.0 * force)
    rest = {"rail": 0.0, "rail rate": 0.0}
    ends = {"start": rest, "end": rest | {"rail": length}}
    least = gauss.optimal_motion(cart, (0.1 * time, 10.0 * time), cost="time", **ends)
    assert least.duration == pytest.approx(time, rel=1e-6)
    easy = gauss.optimal_motion(cart, 2.0 * time, **ends)
    assert easy.cost == pytest.approx(12.0 / 8.0 * force**2 * time, rel=1e-6)
