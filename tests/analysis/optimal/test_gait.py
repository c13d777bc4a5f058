"""Gaits with impacts: the compass-like walker of Goswami, Thuilot and Espiau (Int. J. Robotics Research 17(12), 1998).

Two legs of 1 m with 5 kg in their middles, 10 kg at the hip, on a slope of 3°. The independent answer is a shooting of
equations by hand; the start of this gait is also quoted in the literature, to four digits.
"""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import gauss
from gauss.errors import ArgumentError

M_LEG, M_HIP, L, A, B, SLOPE, G = 5.0, 10.0, 1.0, 0.5, 0.5, np.deg2rad(3.0), 9.8
QUOTED = [
    0.2187,
    -0.3234,
    -1.0918,
    -0.3772,
]  # legs that stand and swing, and their rates, after the impact, from the vertical
PRINTED = 1e-4  # digits of the quoted figures
SAME = 1e-8  # of two computations of one gait
pytestmark = pytest.mark.slow


def walker():
    """Legs as a chain from the standing foot; y is normal to the ground, x points downhill."""
    scene = gauss.Scene("walker", gravity=(G * np.sin(SLOPE), -G * np.cos(SLOPE), 0.0))
    hip = M_HIP + M_LEG  # with the standing leg, about their common centre of mass
    com = (M_HIP * L + M_LEG * A) / hip
    turning = M_HIP * (L - com) ** 2 + M_LEG * (A - com) ** 2
    stance = scene.body("stance", hip, (turning, 0.0, turning), com=(0.0, com, 0.0))
    swing = scene.body("swing", M_LEG, (0.0, 0.0, 0.0), position=(0.0, L, 0.0), com=(0.0, -B, 0.0))
    scene.revolute("foot", "ground", stance)
    scene.revolute("hip", stance, swing, at=(0.0, L, 0.0))
    scene.input("motor", "hip", limits=100.0)
    return scene


def across(r, w):
    return r[0] * w[1] - r[1] * w[0]


def struck(angles, rates):
    """Rates of the legs after the impact: momentum about the new foot, and of the old leg about the hip (eq. 5).

    Each point is a sum of lengths along legs, (leg, length); a leg at θ points to (−sin θ, cos θ) from foot to hip.
    """
    sin, cos = gauss.math.sin, gauss.math.cos

    def place(parts):
        return sum(d * np.array([-sin(angles[k]), cos(angles[k])]) for k, d in parts)

    def speed(parts, given):
        return sum(d * given[k] * np.array([-cos(angles[k]), -sin(angles[k])]) for k, d in parts)

    # from the new foot (leg 1) and from the old one (leg 0): masses of leg 0, hip, leg 1
    new = [(M_LEG, [(1, L), (0, -B)]), (M_HIP, [(1, L)]), (M_LEG, [(1, A)])]
    old = [[(0, A)], [(0, L)], [(0, L), (1, -B)]]

    def momenta(given, paths):
        whole = sum(m * across(place(at), speed(path, given)) for (m, at), path in zip(new, paths, strict=True))
        return whole, M_LEG * across(place([(0, -B)]), speed(paths[0], given))

    before = momenta(rates, old)
    columns = [momenta(unit, [at for _, at in new]) for unit in ((1.0, 0.0), (0.0, 1.0))]
    (a, c), (b, d) = columns
    det = a * d - b * c
    return [(d * before[0] - b * before[1]) / det, (a * before[1] - c * before[0]) / det]


def reset(q, v):
    """The legs change their parts."""
    old, new = struck([q[0], q[0] + q[1]], [v[0], v[0] + v[1]])
    return [q[0] + q[1], -q[1]], [new, old - new]


def rates(_, x):
    """By hand: Lagrange's equations of the two angles."""
    (s, n, ds, dn), coupling = x, M_LEG * L * B
    M = np.array([[M_LEG * A**2 + (M_HIP + M_LEG) * L**2, -coupling * np.cos(s - n)], [0.0, M_LEG * B**2]])
    M[1, 0] = M[0, 1]
    weight = lambda angle: G * np.sin(angle + SLOPE)  # noqa: E731  (g along −x of a leg at the angle)
    pull = np.array([-(M_LEG * A + (M_HIP + M_LEG) * L) * -weight(s - 2.0 * SLOPE), M_LEG * B * -weight(n - 2.0 * SLOPE)])
    force = pull + coupling * np.sin(s - n) * np.array([dn**2, -(ds**2)])
    return [ds, dn, *np.linalg.solve(M, force)]


@cache
def by_hand():
    """Start after the impact (4,), and period, of the gait."""

    def step(x):
        feet = lambda t, y: y[0] + y[1]  # noqa: E731
        found = solve_ivp(rates, (0.0, 1.0), x, method="DOP853", rtol=1e-13, atol=1e-13, events=feet, dense_output=True)
        late = np.flatnonzero(found.t_events[0] > 0.5)[0]
        t, (s, n, ds, dn) = found.t_events[0][late], found.y_events[0][late]
        old, new = struck([s, n], [ds, dn])
        return np.array([n, s, new, old], dtype=float), t

    angle = (QUOTED[0] - QUOTED[1]) / 2.0
    start = lambda z: np.array([z[0], -z[0], z[1], z[2]])  # noqa: E731
    found = root(lambda z: (step(start(z))[0] - start(z))[[0, 2, 3]], [angle, *QUOTED[2:]], tol=1e-13)
    return start(found.x), step(start(found.x))[1]


def test_the_gait_by_hand_is_the_quoted_one():
    start, _ = by_hand()
    vertical = start - [SLOPE, SLOPE, 0.0, 0.0]
    assert vertical == pytest.approx(QUOTED, abs=PRINTED)


def test_a_gait_of_least_effort_is_the_passive_one():
    pytest.importorskip("casadi")
    start, period = by_hand()
    system = gauss.compile_scene(walker())
    angle, rate = 0.25, [-1.0, 0.6]  # not the gait
    guess = gauss.simulate(system, 0.7, state=system.state([angle, -2.0 * angle], rate), progress=False)
    found = gauss.optimal_motion(
        system,
        (0.5, 1.0),
        start={},
        periodic=True,
        reset=reset,
        meets=lambda q, v: 2.0 * q[0] + q[1],
        limits={"foot": (-1.0, 1.0)},
        guess=guess,
        tolerance=1e-9,
    )
    s, n, ds, dn = start
    assert found.duration == pytest.approx(period, abs=SAME)
    assert np.concatenate([found.q[0], found.v[0]]) == pytest.approx([s, n - s, ds, dn - ds], abs=SAME)
    assert found.cost <= SAME


def test_a_rimless_wheel_rolls_as_in_closed_form():
    """Speed before an impact by energy, ½ v² (1 − cos² 2α) = 2 g l sin α sin γ / l² (McGeer, IJRR 9(2), 1990)."""
    pytest.importorskip("casadi")
    scene, turn = gauss.Scene("wheel", gravity=(G * np.sin(SLOPE), -G * np.cos(SLOPE), 0.0)), np.pi / 6.0
    scene.revolute("A", "ground", scene.body("hub", 2.0, (0.0, 0.0, 0.0), com=(0.0, L, 0.0)))
    scene.input("motor", "A")
    system = gauss.compile_scene(scene)
    found = gauss.optimal_motion(
        system,
        (0.1, 2.0),
        start={},
        end={"A": -turn / 2.0},
        periodic=True,
        reset=lambda q, v: ([q[0] + turn], [np.cos(turn) * v[0]]),
        guess=gauss.simulate(system, 0.4, state=system.state([turn / 2.0], [-1.5]), progress=False),
        tolerance=1e-9,
    )
    speed = np.sqrt(4.0 * G / L * np.sin(turn / 2.0) * np.sin(SLOPE)) / np.sin(turn)
    assert found.v[-1, 0] == pytest.approx(-speed, abs=SAME)
    assert found.cost <= SAME


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"reset": reset}, "periodic="),
        ({"periodic": True, "reset": 3}, "reset: expected a function"),
        ({"periodic": True, "reset": lambda q, v: (q, q, q)}, "expected 4 numbers"),
        ({"meets": lambda q, v: float(q[0])}, "meets cannot be traced"),
    ],
)
def test_bad_resets_are_named(given, words):
    pytest.importorskip("casadi")
    with pytest.raises(ArgumentError, match=words):
        gauss.optimal_motion(walker(), (0.5, 1.0), **given)
