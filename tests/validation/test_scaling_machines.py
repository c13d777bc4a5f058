"""Servos, rotors, linkages, sweeps, implicit steps and what is asked of a motion know no units: the same in any."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import gauss
from gauss import math, rotors, servo
from gauss.errors import StateError
from gauss.linkages import Linkage
from gauss.servo import Motor, Servo, ServoRelation
from gauss.system.passes import repeated
from tests.support.reductions import stages
from tests.support.rotor_networks import scaled_network
from tests.support.scaled import Units, scaled, state_in
from tests.support.servos import cart_pendulum

SAME = 1e-9  # of coordinates, rates and torques in units of the scene
EXPONENTS = st.floats(-9.0, 9.0)
FACTORS = [10.0**k for k in (-9, 0, 9)]
# Factors together, of length, time and mass; one of these choices a test, for each compiles code of its own.
UNITS = st.sampled_from([Units(1e9, 1e-9, 1e9), Units(1e-9, 1e9, 1e-9), Units(1e9, 1e9, 1e-9), Units(1e-9, 1e-9, 1e9)])
few = settings(max_examples=1, deadline=None, derandomize=True)


def _own(system, units: Units, q, v):
    """Coordinates and rates (…, n_q + n_v) in the scene's own units."""
    return np.concatenate([part / unit for part, unit in zip((q, v), _factors(system, units), strict=True)], axis=-1)


def _factors(system, units: Units):
    return state_in(system, units, np.ones(system.n_q), np.ones(system.n_v))


def _close(one, other):
    assert np.abs(np.asarray(other) - one).max() <= SAME * (1.0 + np.abs(one).max())


def _leaning(units: Units) -> servo.Tracking:
    lean = ServoRelation("lean", lambda t, motion: motion.coordinate("pin") - 0.2 * math.sin(t / units.time) ** 2)
    held = Servo(scaled(cart_pendulum(), units), [lean], [Motor("motor", "rail")])
    return servo.simulate(held, 0.5 * units.time, times=np.array([0.25, 0.5]) * units.time, progress=False)


@pytest.mark.slow
@few
@given(units=UNITS)
def test_a_servo_holds_its_relations_the_same_in_any_units(units):
    one, other = _leaning(Units()), _leaning(units)
    system = one.motion.system
    _close(_own(system, Units(), one.motion.q, one.motion.v), _own(system, units, other.motion.q, other.motion.v))
    _close(one.efforts, other.efforts * units.length / units.energy)


@pytest.mark.parametrize("L", FACTORS)
def test_a_relation_out_of_reach_by_a_thousandth_is_refused(L):
    scene = gauss.Scene("arm", gravity=(0, 0, 0))
    scene.body("arm", 1.0, (0, 0, L * L), com=(L, 0, 0))
    scene.revolute("A", "ground", "arm")
    scene.frame("tip", "arm", (L, 0, 0))
    scene.start("A", position=0.3)
    reach = ServoRelation("reach", lambda t, motion: motion.position("tip")[0] - 1.001 * L)
    with pytest.raises(StateError, match="'reach' cannot be met"):
        servo.initial_state(Servo(scene, [reach], [Motor("motor", "A")]))


def _sprung() -> rotors.Network:
    """At rest: nothing but torques tells how fast it will be."""
    network = rotors.Network("from rest")
    network.shaft("a", 1.0)
    network.shaft("b", 2.0)
    network.spring("s", "b", "a", stiffness=50.0, damping=1.0)
    network.torque("a", rotors.Constant(3.0))
    network.torque("b", rotors.Dry(1.0))
    return network


# Not hoist and harvester, whose laws (DC motor, diesel, tables) have fields of other units.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["gear_runup", "stall", "friction_chain", "from rest"])
@pytest.mark.parametrize("method", ["dop853", "radau"])
@few
@given(time=EXPONENTS, energy=EXPONENTS)
@example(time=9.0, energy=-9.0)
@example(time=-9.0, energy=18.0)
def test_rotors_turn_the_same_in_any_units(name, method, time, energy):
    network, T, E = _sprung() if name == "from rest" else gauss.load_rotors(name), 10.0**time, 10.0**energy
    runs = []
    for t, e in ((1.0, 1.0), (T, E)):
        times = np.array([0.1, 0.2]) * t
        runs.append(rotors.simulate(scaled_network(network, t, e), times[-1], times=times, method=method, compiled=False))
    one, other = runs
    _close(one.angles, other.angles)
    _close(one.speeds, other.speeds * T)
    assert [(event.kind, event.element) for event in one.events] == [(event.kind, event.element) for event in other.events]


def _in_lengths(linkage: Linkage, L: float) -> Linkage:
    """The same linkage with all lengths multiplied."""
    made = Linkage(linkage.name, tuple(np.array(linkage.gravity) * L))
    for link in linkage.links.values():
        made.add(replace(link, inertia=link.inertia * L * L, com=tuple(np.array(link.com) * L)))
    for joint in linkage.joints.values():
        made.add(replace(joint, at=tuple(np.array(joint.at) * L), child_at=tuple(np.array(joint.child_at) * L)))
    for load in linkage.loads:
        at = None if load.at is None else tuple(np.array(load.at) * L)
        made.add(replace(load, force=tuple(np.array(load.force) * L), moment=load.moment * L * L, at=at))
    made.add(linkage.drives[-1])
    for joint, mode in linkage.modes.items():
        made.mode(joint, mode)
    for link, pose in linkage.poses.items():
        made.pose(link, (*(np.array(pose[:2]) * L), pose[2]))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "class_three"])
@pytest.mark.parametrize("L", [1e-9, 1e9])
def test_linkages_move_the_same_in_any_lengths(name, L):
    linkage = gauss.load_linkage(name)
    crank = linkage.drives[-1].start + np.linspace(0.0, 2.0, 3)
    one, other = linkage.cycle(crank), _in_lengths(linkage, L).cycle(crank)
    _close(one.torque, other.torque / L**2)


def _swept(units: Units) -> np.ndarray:
    masses = np.array([0.5, 2.0]) * units.mass
    scene = scaled(gauss.load("cart_pole"), units)
    found = gauss.sweep(scene, {"cart.mass": masses}, 0.3 * units.time, samples=3, progress=False)
    return _own(gauss.compile_scene(scene), units, found.q.values, found.v.values)


def _rolled_out(units: Units) -> np.ndarray:
    system = gauss.compile_scene(scaled(gauss.load("cart_pole"), units))
    start, (q, v) = system.initial_state(), _factors(system, units)
    q0, v0 = start.q + np.array([[0.0, 0.0], [0.1, 0.2]]) * q, start.v + np.array([[0.0, 0.0], [0.3, -1.0]]) * v
    times = np.linspace(0.0, 0.3, 3) * units.time
    found = gauss.rollout(system, q0, v0, integrator="dop853", times=times)
    return _own(system, units, found.q, found.v)


@pytest.mark.slow
@pytest.mark.parametrize("made", [_swept, _rolled_out])
@few
@given(units=UNITS)
def test_many_motions_are_the_same_in_any_units(made, units):
    _close(made(Units()), made(units))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["radau5", "generalised_alpha", "energy_momentum", "gauss4"])
@few
@given(units=UNITS)
def test_implicit_steps_are_the_same_in_any_units(integrator, units):
    """Unknowns are angles and places at once; an absolute size of either would stop the iteration too early."""
    ends = []
    for own in (Units(), units):
        step = {} if integrator == "radau5" else {"step": 0.01 * own.time}
        motion = gauss.simulate(
            scaled(gauss.load("cart_pole"), own), 0.1 * own.time, integrator=integrator, progress=False, **step
        )
        ends.append(_own(motion.system, own, motion.q[-1], motion.v[-1]))
    _close(*ends)


@pytest.mark.slow
@few
@given(units=UNITS)
def test_what_is_asked_of_a_motion_is_the_same_in_any_units(units):
    """Instants of crossings, and rates of the linearised motion, by which an integrator is recommended."""
    found = []
    for own in (Units(), units):
        advice = gauss.advise(gauss.compile_scene(scaled(gauss.load("cart_pole"), own)))
        pendulum = scaled(gauss.load("pendulum"), own)
        motion = gauss.simulate(pendulum, 2.0 * own.time, times=np.linspace(0, 2, 9) * own.time, progress=False)
        instants = [
            state.t / own.time for state in gauss.crossings(motion, lambda motion: motion.rate(motion.system.joints[0].name))
        ]
        found.append((advice.method, advice.fastest * own.time, instants))
    (method, fastest, instants), (other, faster, later) = found
    assert method == other and fastest == pytest.approx(faster, rel=1e-6) and instants
    assert instants == pytest.approx(later, abs=SAME)


@pytest.mark.parametrize("L", FACTORS)
@pytest.mark.parametrize("aside", [0.0, 1e-3])
def test_hinges_are_one_where_their_axes_are_beside_the_size_of_the_door(L, aside):
    """Two hinges on one axis leave the door free; with axes apart by a thousandth of its width they hold it."""
    scene = gauss.Scene("door", gravity=(0, 0, 0))
    scene.body("door", 1.0, (L * L,) * 3, com=(L, 0, 0))
    scene.revolute("low", "ground", "door", at=(0, 0, -L))
    scene.revolute("high", "ground", "door", at=(aside * L, 0, L))
    assert bool(stages(gauss.compile_scene(scene))[repeated].why) == (not aside)


def _alone(**body) -> gauss.Scene:
    scene = gauss.Scene("alone", gravity=(0, 0, 0))
    scene.body("b", 2.0, **body)
    return scene


def _turning(com: float, rate: float, gravity: float = 0.0) -> gauss.Scene:
    scene = gauss.Scene("turning", gravity=(0, -gravity, 0))
    scene.body("b", 1.0, (0, 0, 1.0 if not com else com * com), com=(com, 0, 0))
    scene.revolute("A", "ground", "b")
    scene.start("A", rate=rate)
    return scene


def _free() -> gauss.Scene:
    scene = _alone(inertia=(2.0, 2.0, 2.0))
    scene.free("F", "ground", "b")
    return scene


SCALES = {  # scene: its length [m] and time [s]
    "one free body": (_free(), 1.0, 1.0),
    "only turning": (_turning(0.0, 4.0), 1.0, 0.25),
    "micrometres": (_turning(1e-6, 0.0, 9.81), 1e-6, np.pi * np.sqrt(1e-6 / 9.81)),
    "an orbit": (_turning(1.5e11, 2e-7), 1.5e11, 5e6),
}


@pytest.mark.parametrize("name", SCALES)
def test_the_scale_is_explained_wherever_it_comes_from(name):
    scene, length, time = SCALES[name]
    system = gauss.compile_scene(scene)
    assert (system.scale.length, system.scale.time) == pytest.approx((length, time), rel=1e-12)
    assert str(system.scale) in system.explain()
