"""Prescribed speeds that jump, against closed forms and motions restarted by hand."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import PPoly, make_interp_spline

import gauss
from gauss import math as gm
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError
from gauss.scene.profiles import Move, Polynomial, Ramp, Sine
from tests.support import mechanisms

EXACT = 1e-8  # of the largest coordinate or rate: what a motion with a jump may be off by at rtol 1e-12, or the same step
BALANCE = 1e-9  # of the largest energy
MASS, BOB, INERTIA, LENGTH = 2.0, 1.0, 0.01, 1.0

ADAPTIVE = [{"integrator": name} for name in ("dop853", "dopri5", "radau5", "scipy_dop853", "scipy_lsoda")]
ADAPTIVE += [{"rtol": 1e-6, "atol": 1e-6, "exact": 1e-4}, {"stabilisation": "baumgarte"}]
ADAPTIVE += [{"stabilisation": "none"}, {"backend": "recursion", "rtol": 1e-5, "atol": 1e-5, "exact": 1e-3}]
FIXED = [{"integrator": name, "step": 0.004} for name in ("rk4", "semi_implicit_euler")]
FIXED += [{"integrator": "rk4", "step": 0.05, "backend": "recursion"}]
POSITIONS = [{"integrator": name, "step": 0.01} for name in ("verlet", "gauss4", "gauss6", "generalised_alpha")]
POSITIONS += [{"integrator": name, "step": 0.01} for name in ("variational_midpoint", "energy_momentum")]
POSITIONS += [{"integrator": "ida", "exact": 1e-7}, {"stabilisation": "partitioning"}]
POSITIONS += [{"integrator": "radau5", "stabilisation": "ggl"}]


def called(settings: dict) -> str:
    """Name of a case."""
    return " ".join(f"{key}={value}" for key, value in settings.items())


def cart(**law) -> gauss.System:
    """A cart that is driven, and a bob that hangs from it."""
    scene = gauss.Scene("cart")
    scene.body("cart", MASS)
    scene.body("bob", BOB, (INERTIA,) * 3, com=(0, 0, -LENGTH))
    scene.prismatic("x", "ground", "cart", axis=(1, 0, 0))
    scene.revolute("swing", "cart", "bob", axis=(0, 1, 0))
    scene.drive("x", **law)
    return gauss.compile_scene(scene)


def slider(build=None, **law) -> gauss.System:
    """A mass on a line that is driven, without gravity."""
    scene = gauss.Scene("slider", gravity=(0, 0, 0))
    scene.body("b", MASS)
    scene.prismatic("P", "ground", "b", axis=(1, 0, 0))
    scene.drive("P", **law)
    if build is not None:
        build(scene)
    return gauss.compile_scene(scene)


def restarted(piece, times, speeds, settings) -> tuple[np.ndarray, list[float]]:
    """Last state of motions of the cart at constant speeds, one after the other, and the impulses between them by hand.

    An impulse at the pivot of the bob leaves its angular momentum about the pivot as it is.
    """
    state, impulses = None, []
    for (begin, end), speed in zip(pairwise(times), speeds, strict=True):
        system = piece(begin, speed, state)
        if state is None:
            state = system.initial_state()
        else:
            cosine, jump = np.cos(state.q[1]), speed - state.v[0]
            turned = LENGTH * cosine * jump * BOB / (INERTIA + BOB * LENGTH**2)
            impulses.append((MASS + BOB) * jump - BOB * LENGTH * cosine * turned)
            state = gauss.State(begin, state.q, np.array([speed, state.v[1] + turned]))
        motion = gauss.simulate(system, end - begin, state=state, **settings)
        state = motion.state(-1)
    return np.concatenate([state.q, state.v]), impulses


def compared(motion: gauss.Trajectory, expected: np.ndarray, exact: float):
    """Hold the last state of a motion against what is expected."""
    found = np.concatenate([motion.q[-1], motion.v[-1]])
    assert np.abs(found - expected).max() <= exact * max(1.0, np.abs(expected).max())


def balanced(motion: gauss.Trajectory) -> float:
    """Energy balance relative to the largest energy."""
    found = gauss.energy(motion)
    return np.abs(found.balance).max() / max(found.scale, 1e-300)


def square(t):
    """One and minus one by turns, for half a second each."""
    phase = 2.0 * t - 2.0 * np.floor(t)
    return gm.where(phase < 1.0, 1.0, -1.0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # of the coarse ones
@pytest.mark.parametrize("settings", [*ADAPTIVE, *FIXED], ids=called)
def test_square_wave_beside_a_pendulum(settings):
    """Speeds that jump three times: every integrator makes the motion that it makes from jump to jump."""
    settings = dict(settings)
    exact = settings.pop("exact", EXACT)
    times, speeds = [0.0, 0.5, 1.0, 1.5, 1.75], [1.0, -1.0, 1.0, -1.0]
    expected, impulses = restarted(lambda t, speed, state: cart(speed=speed), times, speeds, settings)
    motion = gauss.simulate(cart(speed=square), times[-1], **settings)
    compared(motion, expected, exact)
    assert [event.kind for event in motion.events] == ["impact"] * 3
    assert np.abs(np.array([event.t for event in motion.events]) - times[1:-1]).max() <= 1e-14
    found = np.array([event.impulses["drive of x"][0] for event in motion.events])
    assert np.abs(found - impulses).max() <= exact * np.abs(impulses).max()
    assert np.abs([event.loss for event in motion.events]).max() <= 1e-13


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # of the coarse ones
@pytest.mark.parametrize("settings", [*ADAPTIVE, *FIXED, *POSITIONS], ids=called)
def test_kink_of_a_position_beside_a_pendulum(settings):
    """A position |t − 1| is a speed that jumps from −1 to 1."""
    settings = dict(settings)
    exact = settings.pop("exact", EXACT)

    def piece(begin, speed, state):
        return cart(displacement=lambda t: 1.0 + speed * t if begin == 0.0 else speed * (t - begin))

    expected, impulses = restarted(piece, [0.0, 1.0, 2.0], [-1.0, 1.0], settings)
    motion = gauss.simulate(cart(displacement=lambda t: abs(t - 1.0)), 2.0, **settings)
    compared(motion, expected, exact)
    assert motion.events[0].impulses["drive of x"][0] == pytest.approx(impulses[0], rel=exact)


AT_END = [
    {},
    {"integrator": "radau5"},
    {"integrator": "scipy_dop853"},
    {"integrator": "rk4", "step": 1e-3},
    {"verify": True},
]


@pytest.mark.slow
@pytest.mark.parametrize("settings", AT_END, ids=called)
@pytest.mark.parametrize("times", [None, np.array([0.5, 1.25, 1.5]), np.array([0.25, 1.25])], ids=["steps", "end", "before"])
def test_a_jump_at_the_end_is_an_impact(settings, times):
    """The last state is the one just after it, from which a motion can go on; its energy is booked."""
    system = cart(speed=square)
    motion = gauss.simulate(system, 1.5, times=times, **settings)
    assert balanced(motion) <= BALANCE
    reaches = times is None or times[-1] == 1.5
    jumps = [0.5, 1.0, 1.5] if reaches else [0.5, 1.0]
    assert [event.t for event in motion.events] == pytest.approx(jumps, abs=1e-14)
    if reaches:
        assert motion.t[-1] == 1.5 and motion.v[-1, 0] == pytest.approx(square(1.5), abs=1e-15)
        onward = gauss.simulate(system, 0.25, state=motion.state(-1), **settings)
        whole = gauss.simulate(system, 1.75, **settings)
        assert not onward.events and np.abs(onward.v[-1] - whole.v[-1]).max() <= EXACT


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"integrator": "radau5"}, {"integrator": "rk4", "step": 1e-3}], ids=called)
@pytest.mark.parametrize("times", [None, np.linspace(0.0, 1.75, 8)], ids=["every step", "samples"])
def test_energy_balance_is_closed(settings, times):
    """The work of the impulses is that of the drive; samples at a jump show what is just after."""
    motion = gauss.simulate(cart(speed=square), 1.75, times=times, **settings)
    assert balanced(motion) <= BALANCE
    if times is not None:
        assert (motion.t == times).all()
        assert (motion.v[:, 0] == [square(t) for t in times]).all()
    else:
        assert np.diff(motion.t).min() > 0.0


def test_time_and_samples_of_a_fixed_step_that_falls_on_the_jump():
    """Steps that end at the jump, and steps that cross it, show the same."""
    system = slider(speed=lambda t: gm.where(t < 1.0, 0.5, 0.0))
    for step in (0.125, 0.3):
        motion = gauss.simulate(system, 2.0, integrator="rk4", step=step, times=[0.5, 1.0, 1.7])
        assert motion.t.tolist() == [0.5, 1.0, 1.7]
        assert motion.q.ravel() == pytest.approx([0.25, 0.5, 0.5], abs=1e-14)
        assert motion.v.ravel() == pytest.approx([0.5, 0.0, 0.0], abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "radau5", "taylor", "scipy_lsoda"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-12])
def test_a_coarse_tolerance_does_not_matter_to_what_is_prescribed(integrator, rtol):
    """A mass that stops after a second has gone half a metre, whatever the tolerance."""
    system = slider(speed=lambda t: gm.where(t < 1.0, 0.5, 0.0))
    motion = gauss.simulate(system, 2.0, integrator=integrator, rtol=rtol, atol=rtol, verify=integrator == "dop853")
    assert motion.q[-1, 0] == pytest.approx(0.5, abs=1e-13)
    assert motion.events[0].impulses == {"drive of P": pytest.approx((-0.5 * MASS,))}
    assert gauss.energy(motion).drives[-1] == pytest.approx(-0.25 * MASS * 0.5, abs=1e-13)  # the mass is stopped


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"integrator": "rk4", "step": 0.001}], ids=called)
def test_crank_of_a_four_bar(settings):
    """One freedom: where the crank is follows from its speed, and the impulse from the kinetic energy."""
    scene = mechanisms.four_bar()
    scene.starts.clear()
    scene.drive("A", speed=lambda t: gm.where(t < 0.5, 2.0, 6.0))
    system = gauss.compile_scene(scene)
    motion = gauss.simulate(system, 1.0, times=[0.25, 0.5 - 1e-9, 0.5 + 1e-9, 1.0], **settings)
    assert motion.coordinate("A") - motion.system.initial_state().q[system.joint("A").q] == pytest.approx(
        [0.5, 1.0, 1.0, 4.0], abs=1e-8
    )
    found = gauss.energy(motion)
    assert balanced(motion) <= BALANCE
    gained = found.kinetic[2] - found.kinetic[1]
    assert motion.events[0].impulses["drive of A"][0] == pytest.approx(gained / 4.0, rel=1e-6)  # ½ p (ω⁻ + ω⁺) = ΔT
    assert motion.v[2] == pytest.approx(3.0 * motion.v[1], rel=1e-6)  # what one freedom allows


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"integrator": "time_stepping", "step": 0.01}], ids=called)
def test_limited_drive_slips(settings):
    """A drive of 1 N takes a mass of 2 kg from rest to 0.25 m/s in half a second, and as long to stop it after its jump."""
    system = slider(speed=lambda t: gm.where(t < 1.0, 0.25, 0.0), limit=1.0)
    motion = gauss.simulate(system, 2.0, **settings)
    assert motion.q[-1, 0] == pytest.approx(0.25, abs=EXACT)
    assert np.abs(gauss.drive_forces(motion, "P")).max() <= 1.0 + 1e-9
    assert balanced(motion) <= BALANCE
    if not settings:
        assert [event.kind for event in motion.events] == ["holds", "slips", "holds"]
        assert np.array([event.t for event in motion.events]) == pytest.approx([0.5, 1.0, 1.5], abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"integrator": "time_stepping", "step": 0.01}], ids=called)
@pytest.mark.parametrize(
    "law", [{"speed": lambda t: gm.where(t < 1.0, 0.0, 1.0)}, {"displacement": lambda t: gm.maximum(t - 1.0, 0.0)}]
)
def test_a_contact_passes_the_impulse_on(settings, law):
    """A block of 3 kg that lies before the driven mass is pushed with it, and bears its part of the impulse."""

    def block(scene):
        scene.body("c", 3.0)
        scene.prismatic("Q", "ground", "c", axis=(1, 0, 0))
        scene.one_sided("gap", lambda at: at.coordinate("Q") - at.coordinate("P"), restitution=0.5)

    motion = gauss.simulate(slider(block, **law), 2.0, **settings)
    assert motion.q[-1] == pytest.approx([1.0, 1.0], abs=EXACT)
    impact = next(event for event in motion.events if event.kind == "impact")
    assert impact.gaps == ("drive of P",)
    assert impact.impulses["drive of P"] == pytest.approx((MASS + 3.0,))
    assert balanced(motion) <= BALANCE


@pytest.mark.slow
def test_what_stands_against_a_jump_is_named():
    """A driven mass that would have to go into its stop; a wall that jumps into a mass."""
    system = slider(lambda scene: scene.stop("P", 0.0, 1.0), speed=lambda t: gm.where(t < 1.0, 0.0, -1.0))
    with pytest.raises(SimulationError, match="drive of P"):
        gauss.simulate(system, 2.0)

    def wall(scene):
        scene.body("c", 3.0)
        scene.prismatic("Q", "ground", "c", axis=(1, 0, 0))
        scene.one_sided("wall", lambda at: at.coordinate("Q") - gm.where(at.t < 1.0, -1.0, 1.0))

    with pytest.raises(SimulationError, match="wall"):
        gauss.simulate(slider(wall, speed=0.1), 2.0)


@pytest.mark.slow
def test_a_jump_at_the_start_is_an_impact_there():
    """A speed that is there from just after the start on; the start itself is shown as it was."""
    system = slider(speed=lambda t: gm.where(t > 0.0, 0.5, 0.0))
    for settings in ({}, {"integrator": "rk4", "step": 0.3}, {"integrator": "scipy_dop853"}):
        for times in (None, [0.0, 1.0, 2.0], [1.0, 2.0]):
            motion = gauss.simulate(system, 2.0, times=times, **settings)
            assert motion.q[-1, 0] == pytest.approx(1.0, abs=1e-13)
            assert times is None or motion.t.tolist() == times
            assert len(motion.events) == 1
            assert motion.t[0] > 0.0 or motion.v[0, 0] == 0.0
            if motion.t[0] == 0.0:
                assert balanced(motion) <= BALANCE


@pytest.mark.slow
def test_a_guide_and_a_shift_of_gears_are_impacts():
    """A point that is guided along a kink; a velocity constraint whose ratio jumps loses energy, as a clutch does."""
    scene = gauss.Scene("guided", gravity=(0, 0, 0))
    scene.body("a", MASS)
    scene.prismatic("P", "ground", "a", axis=(1, 0, 0))
    scene.guide("hand", "a", path=lambda t: np.array([abs(t - 1.0) - 1.0, 0.0, 0.0]), along=[(1, 0, 0)])
    motion = gauss.simulate(scene, 2.0)
    assert motion.q[-1, 0] == pytest.approx(0.0, abs=1e-12)
    assert motion.events[0].impulses["hand"] == pytest.approx((2.0 * MASS,))

    scene = gauss.Scene("shift", gravity=(0, 0, 0))
    for name, joint in (("a", "A"), ("b", "B")):
        scene.body(name, 1.0, (1.0, 1.0, 1.0))
        scene.revolute(joint, "ground", name, axis=(0, 0, 1))
    ratio = lambda t: gm.where(t < 1.0, 1.0, 2.0)  # noqa: E731
    scene.constrain("gear", velocity=lambda at: at.rate("B") - ratio(at.t) * at.rate("A"))
    scene.start("A", rate=1.0)
    motion = gauss.simulate(scene, 2.0)
    assert motion.v[-1] == pytest.approx([0.6, 1.2])  # (1, 1) + p (−2, 1), on b = 2 a
    assert motion.events[0].loss == pytest.approx(1.0 - 0.9)
    assert balanced(motion) <= BALANCE


@pytest.mark.slow
def test_laws_without_jumps_have_none():
    """Splines, profiles of files and steep laws cross their switching times as before."""
    knots = np.linspace(0.0, 2.0, 41)
    smooth = PPoly.from_spline(make_interp_spline(knots, 1e3 * np.sin(3.0 * knots), k=3))
    laws = [Move(0.0, 1.0, 0.5, 0.5), Ramp(1.0, 2.0), Sine(1.0, 3.0), Polynomial((1.0, 2.0, -3.0)), smooth]
    laws += [lambda t: gm.where(t < 1.0, 0.0, (t - 1.0) ** 2), lambda t: 1e3 + gm.where(t < 1.0, t * t, 2.0 * t - 1.0)]
    for law in laws:
        system = slider(displacement=law)
        assert not switching(system, Laws(system), system.initial_state(), 2.0).jumps
        assert not gauss.simulate(system, 2.0).events


def test_a_broken_line_has_an_impact_at_every_knot():
    """A polyline of displacements, in small units: the jumps are relative to the speeds of the scene."""
    knots, values = np.array([0.0, 0.5, 1.0, 1.5, 2.0]), 1e-9 * np.array([0.0, 1.0, -1.0, 2.0, 2.0])
    system = slider(displacement=PPoly.from_spline(make_interp_spline(knots, values, k=1)))
    motion = gauss.simulate(system, 2.0)
    impulses = [event.impulses["drive of P"][0] for event in motion.events]
    assert impulses == pytest.approx(MASS * np.diff(np.diff(values) / 0.5), rel=1e-7)
    assert motion.q[-1, 0] == pytest.approx(values[-1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [{"integrator": "dop853", "times": [0.0, 1.0, 1.75]}, {"step": 0.0125, "steps": 140, "every": 140}]
)
def test_rollouts(settings):
    """Motions of a batch are made one by one, and say so."""
    system = cart(speed=square)
    start = system.initial_state()
    found = gauss.rollout(system, [start.q, start.q + [0.0, 0.3]], [start.v] * 2, **settings)
    assert found.repeated == (0, 1)
    own = {"integrator": "rk4", "step": 0.0125} if "step" in settings else {}
    for k, q in enumerate(found.q[:, 0]):
        alone = gauss.simulate(system, 1.75, state=gauss.State(0.0, q, start.v), **own)
        assert np.abs(found.q[k, -1] - alone.q[-1]).max() <= EXACT
    jumping = cart(displacement=lambda t: gm.where(t < 1.0, 0.0, 1.0))
    with pytest.raises(SimulationError, match="drive of x"):
        gauss.rollout(jumping, [start.q], [[0.0, 0.0]], **settings)


@pytest.mark.slow
def test_sweeps():
    """Members of a sweep are right; one whose position jumps fails with the reason."""
    scene = cart(speed=square).scene
    found = gauss.sweep(scene, {"bob.mass": [1.0, 2.0]}, 1.75, samples=3, rtol=1e-12, atol=1e-12, progress=False)
    alone = gauss.simulate(scene, 1.75)
    assert np.abs(found.q.values[0, -1] - alone.q[-1]).max() <= EXACT
    assert (found.status.values == 1).all()
    with pytest.raises(SimulationError, match="drive of x"):
        gauss.sweep(cart(displacement=lambda t: gm.where(t < 1.0, 0.0, 1.0)).scene, {"bob.mass": [1.0]}, 2.0, progress=False)


def test_impulses_are_kept_in_files(tmp_path):
    """A motion that is written and read again knows its impulses."""
    motion = gauss.simulate(slider(speed=lambda t: gm.where(t < 1.0, 0.5, 0.0)), 2.0)
    kept = np.load(gauss.save(motion, tmp_path / "motion.npz"))
    assert kept["event_impulses"][0] == '{"drive of P": [-1.0]}'


@pytest.mark.slow
@pytest.mark.parametrize("key", ["speed", "displacement"])
@pytest.mark.parametrize("options", [{}, {"integrator": "rk4", "step": 0.1}])
def test_two_prescribed_motions_that_part_at_a_jump_are_refused(key, options):
    parting = {
        "speed": (lambda t: 1.0 + 0.0 * t, lambda t: gm.where(t < 0.5, 1.0, 2.0)),
        "displacement": (lambda t: 1.0 * t, lambda t: t + gm.maximum(t - 0.5, 0.0)),
    }[key]
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    for number, law in enumerate(parting):
        scene.drive("x", **{key: law}, name=f"drive {number}")
    with pytest.raises(gauss.GaussError, match="t = 0.5 s: the prescribed speed of 'drive 1' jumps.*prescribed twice"):
        gauss.simulate(scene, 1.0, progress=False, **options)
