"""A scene knows no units: with lengths, times and masses multiplied by any factors it moves as before, in its own units."""

import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import gauss
from gauss.errors import AssemblyError, GaussError
from tests.support.scaled import Units, put, scaled, state_in

SAME = 1e-9  # of coordinates and rates in units of the scene; rounding of factors, and of time, leaves about 1e-12
DURATION, SAMPLES = 0.5, 4  # times and samples of a motion, in units of the scene as it is shipped
STEPPING = {"integrator": "time_stepping", "step": 0.01}
# Every shipped scene: springs, loops, drives, couplings, stops, a rope, dry friction, contacts with friction, rolling.
SHIPPED = {
    "bricard": {},
    "cardan": {},
    "cart_pole": {},
    "double_pendulum": {},
    "double_pendulum_stops": {},
    "four_bar": {},
    "free_body": {},
    "friction_oscillator": {},
    "gear_pair": {},
    "heavy_top": {},
    "newtons_cradle": {},
    "parallelogram": {},
    "pendulum": {},
    "planetary_gears": {},
    "rolling_disk": {},
    "screw_jack": {},
    "slack_rope": {},
    "slider_crank": {},
    "spatial_tree": {},
    "turntable": {},
    "block_on_incline": STEPPING,
    "box_on_plane_4": STEPPING,
    "box_on_plane_8": STEPPING,
    "painleve_rod": STEPPING,
    "puck": {},
    "rolling_ball": STEPPING,
}
EXPONENTS = st.floats(-9.0, 9.0)
FACTORS = [10.0**k for k in (-9, -6, -3, 0, 3, 6, 9)]


def _moved(scene, units: Units, **options):
    """Trajectory of a scene over a duration, its samples and its step in its own units."""
    options |= {"step": options["step"] * units.time} if "step" in options else {}
    times = np.linspace(0.0, DURATION, SAMPLES) * units.time
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gauss.simulate(scene, times[-1], times=times, progress=False, **options)


def _outcome(scene, units: Units, **options):
    """Trajectory, or the error that the scene is refused with."""
    try:
        return _moved(scene, units, **options)
    except GaussError as error:
        return type(error)


def _events(motion, units: Units) -> list:
    return [(event.kind, event.gaps, pytest.approx(event.t / units.time, abs=SAME)) for event in motion.events]


def _agree(one, other, units: Units):
    """Whether a motion is that of the same scene in other units."""
    if isinstance(one, type) or isinstance(other, type):
        assert one is other
        return
    system = one.system
    q, v = state_in(system, units, np.ones_like(one.q), np.ones_like(one.v))
    fastest = 1.0 + np.abs(one.v).max()
    assert np.abs(other.q / q - one.q).max() <= SAME * (1.0 + np.abs(one.q).max())
    assert np.abs(other.v / v - one.v).max() <= SAME * fastest
    assert _events(one, Units()) == [(event.kind, event.gaps, event.t / units.time) for event in other.events]


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
@settings(max_examples=2, deadline=None, derandomize=True)
@given(length=EXPONENTS, time=EXPONENTS, mass=EXPONENTS)
@example(length=9.0, time=-9.0, mass=9.0)
@example(length=-9.0, time=9.0, mass=-9.0)
def test_a_shipped_scene_moves_the_same_in_any_units(name, length, time, mass):
    scene, units = gauss.load(name), Units(10.0**length, 10.0**time, 10.0**mass)
    _agree(_outcome(scene, Units(), **SHIPPED[name]), _outcome(scaled(scene, units), units, **SHIPPED[name]), units)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "free_body", "slider_crank", "box_on_plane_4"])
@settings(max_examples=10, deadline=None, derandomize=True)
@given(length=EXPONENTS, time=EXPONENTS, mass=EXPONENTS)
def test_the_scale_of_a_scene_is_multiplied_with_its_units(name, length, time, mass):
    scene, units = gauss.load(name), Units(10.0**length, 10.0**time, 10.0**mass)
    one, other = (gauss.compile_scene(each).scale for each in (scene, scaled(scene, units)))
    found = [other.length / units.length, other.time / units.time, other.mass / units.mass]
    assert found == pytest.approx([one.length, one.time, one.mass], rel=1e-12)
    assert other.energy / units.energy == pytest.approx(one.energy, rel=1e-12)


def test_the_scale_is_explained():
    system = gauss.compile_scene(gauss.load("four_bar"))
    assert str(system.scale) in system.explain()


def _four_bar(L: float):
    """A four-bar that is drawn assembled."""
    scene = gauss.Scene("four-bar", gravity=(0, -9.81 * L, 0))
    corners = np.array([(0, 0), (0, 0.5), (1.2, 0.9), (1.2, 0)]) * L
    for i in range(3):
        way = corners[i + 1] - corners[i]
        options = {"position": (*corners[i], 0), "rotation": (0, 0, np.arctan2(way[1], way[0]))}
        scene.body(f"b{i}", 1.0, (0, 0, 0.1 * L * L), com=(np.hypot(*way) / 2, 0, 0), **options)
    for i, (a, b) in enumerate((("ground", "b0"), ("b0", "b1"), ("b1", "b2"), ("b2", "ground"))):
        scene.revolute(f"J{i}", a, b, at=(*corners[i], 0))
    scene.start("J0", rate=2.0)
    return scene


@pytest.mark.parametrize("L", [1e-9, 1.0, 1e5, 1e6, 2e6, 1e7, 1e8, 1e12])
def test_a_loop_that_is_drawn_assembled_stays_where_it_is(L):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        start = gauss.compile_scene(_four_bar(L)).initial_state()
    assert np.abs(start.q).max() < 1e-12 and start.v[0] == pytest.approx(2.0, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("L", FACTORS)
def test_a_loop_that_cannot_be_closed_by_a_thousandth_is_refused(L):
    scene = gauss.Scene("open", gravity=(0, 0, 0))
    scene.body("a", 1.0, (0, 0, L * L))
    scene.revolute("A", "ground", "a")
    scene.distance("d", "a", "ground", (L, 0, 0), (3 * L, 0, 0), length=1.999 * L)
    with pytest.raises(AssemblyError, match="'d'"):
        gauss.compile_scene(scene).initial_state()


@pytest.mark.slow
@pytest.mark.parametrize("L", FACTORS)
def test_a_state_that_is_given_is_projected_and_never_exchanged_for_another_pose(L):
    """A crank beyond the reach of its rod: other poses close the loop, but nobody asked for them."""
    system = gauss.compile_scene(_four_bar(L))
    start = system.initial_state()
    assert np.abs(system.projected(system.state(start.q + 1e-7, start.v)).q - start.q).max() < 1e-6
    rng = np.random.default_rng(0)
    for _ in range(5):
        guess = system.state(rng.uniform(-3.0, 3.0, system.n_q))
        try:
            near = system.projected(guess)
        except AssemblyError as error:
            assert error.violations
            continue
        assert np.abs(near.q - system.projected(near).q).max() < 1e-9


def _dropped(L: float, T: float = 1.0, height: float = 1.0, restitution: float = 0.5):
    scene = gauss.Scene("ball", gravity=(0, 0, -9.81 * L / T**2))
    scene.body("b", 1.0)
    scene.prismatic("Z", "ground", "b", axis=(0, 0, 1))
    scene.one_sided("floor", lambda at: at.coordinate("Z"), restitution=restitution)
    scene.start("Z", position=height * L)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("L", [1e-9, 1e-6, 1e-3, 1.0, 1e9])
@pytest.mark.parametrize("T", [1e-6, 1.0, 1e6])
def test_a_ball_bounces_as_often_in_any_units(L, T):
    """Impacts until it rebounds with a millionth of its speed, and rest where the geometric series of flights ends."""
    motion = gauss.simulate(_dropped(L, T), 1.5 * T, progress=False)
    impacts = [event for event in motion.events if event.kind == "impact"]
    rest = [event.t for event in motion.events if event.kind == "closes"]
    exact = np.sqrt(2 / 9.81) * (1 + 2 * 0.5 / (1 - 0.5))
    assert len(impacts) == 23 and rest[0] / T == pytest.approx(exact, abs=1e-6)


@pytest.mark.slow
def test_a_mass_of_atoms_just_above_a_floor_falls():
    scene = gauss.Scene("hover", gravity=(0, 0, -9.81))
    scene.body("b", 1e-24, (1e-42,) * 3)
    scene.prismatic("Z", "ground", "b", axis=(0, 0, 1))
    scene.one_sided("floor", lambda at: at.coordinate("Z"))
    scene.start("Z", position=9e-10)
    motion = gauss.simulate(scene, 1e-4, progress=False)
    assert motion.events[0].kind == "impact"
    assert motion.events[0].t == pytest.approx(np.sqrt(2 * 9e-10 / 9.81), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("L", FACTORS)
def test_starts_inside_of_a_floor_are_refused_by_their_share(L):
    with pytest.raises(GaussError, match="inside of 'floor'"):
        gauss.simulate(_dropped(L, height=-1e-3), 0.1, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "free_body"])
def test_accelerations_are_the_same_in_any_units(name):
    scene, units = gauss.load(name), Units(1e9, 1e-9, 1e9)
    system, other = gauss.compile_scene(scene), gauss.compile_scene(scaled(scene, units))
    start = system.initial_state()
    found = other.accelerations(put(start, system, units))
    _, one = state_in(system, units, np.ones(system.n_q), np.ones(system.n_v))
    exact = system.accelerations(start)
    assert found / one * units.time == pytest.approx(exact, rel=1e-11, abs=1e-11 * np.abs(exact).max())
