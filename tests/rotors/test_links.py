"""Links of rotors one by one: worms, lossy gears, clutches, limiters, freewheels, backlash, thin friction drives."""

import numpy as np
import pytest

from gauss.rotors import Dry, Linear, Network, TorqueFunction, Viscous, simulate
from tests.support.rotor_networks import two_shafts

TIGHT = {"rtol": 1e-12, "atol": 1e-12}
BALANCE = 1e-9  # of the input energy


def test_self_locking_worm_holds_its_load():
    """η̄ = 0: no load on the driven side moves the driver; the wheel carries it all."""
    network = two_shafts(20.0, efficiency=0.45, back_efficiency=0.0)
    network.torque("out", -50.0)
    network.torque("in", Linear(0.2, 100.0), until=1.0)
    motion = simulate(network, 4.0)
    assert [e.kind for e in motion.events][-1] == "stuck"
    assert (motion.speeds[-1] == 0).all() and motion.stuck[-1].all()
    assert motion.torque("link")[-1] == pytest.approx(50.0)


def test_stuck_train_sets_out_where_friction_ends():
    """Lossy gear at rest: holds between back-driving and forward limits, and leaves at the forward one."""
    network = two_shafts(2.0, efficiency=0.8)
    network.torque("out", -40.0)
    back, forward = 40.0 / 2.0 * (2.0 - 1.0 / 0.8), 40.0 / 2.0 / 0.8
    network.torque("in", lambda t, angle, speed: back + 1.0 + 2.0 * t)
    motion = simulate(network, 6.0, **TIGHT)
    (start,) = [e.time for e in motion.events if e.kind == "start"]
    assert start == pytest.approx((forward - back - 1.0) / 2.0, abs=1e-9)
    held = motion.t < start
    assert motion.stuck[held].all() and (motion.speeds[held] == 0).all()
    assert motion.torque("link")[held] == pytest.approx(40.0)
    assert (motion.speeds[-1] > 0).all()


def test_load_that_drives_a_train_back_is_not_held():
    """Below the back-driving limit the load wins from the start."""
    network = two_shafts(2.0, efficiency=0.8)
    network.torque("out", -40.0)
    network.torque("in", 40.0 / 2.0 * (2.0 - 1.0 / 0.8) - 1.0)
    assert (simulate(network, 1.0).speeds[-1] < 0).all()


def test_clutch_slips_locks_and_is_torn_loose():
    network = Network("clutch")
    network.shaft("engine", 0.3, speed=100.0)
    network.shaft("car", 2.0)
    network.clutch("clutch", "car", "engine", {"time": [0.5, 1.0], "torque": [0.0, 80.0]}, static=1.2)
    network.torque("engine", Linear(1.0, 150.0))
    network.torque("car", Dry(20.0))
    network.torque("car", -400.0, begin=6.0, until=6.2)
    motion = simulate(network, 10.0, **TIGHT)
    kinds = {e.kind: e.time for e in reversed(motion.events)}
    assert kinds["start"] == pytest.approx(0.5 + 0.5 * 20.0 / 80.0, abs=1e-9)  # when the clutch carries the dry load
    locked = (motion.t > kinds["lock"]) & (motion.t < 6.0)
    assert motion.speed("engine")[locked] == pytest.approx(motion.speed("car")[locked], rel=1e-12)
    assert (np.abs(motion.torque("clutch")[locked]) <= 96.0).all()
    assert 6.0 < kinds["slip"] < 6.2
    assert motion.speed("engine")[-1] == pytest.approx(motion.speed("car")[-1], rel=1e-12)
    energy = motion.energy()
    assert np.abs(energy.balance).max() <= BALANCE * energy.input[-1]


def test_torque_limiter_lets_through_no_more():
    network = Network("limiter")
    network.shaft("in", 0.2, speed=50.0)
    network.shaft("out", 0.5, speed=50.0)
    network.torque_limiter("hub", "out", "in", torque=30.0)
    network.torque("in", Linear(10.0, 50.0))
    network.torque("out", Dry(60.0), begin=0.5, until=0.7)
    motion = simulate(network, 3.0)
    assert np.abs(motion.torque("hub")).max() <= 30.0 * (1 + 1e-12)
    assert [e.kind for e in motion.events if e.element == "hub"] == ["slip", "lock"]


def test_freewheel_pushes_and_is_overrun():
    network = Network("bicycle")
    network.shaft("wheel", 2.0)
    network.shaft("pedal", 0.1)
    network.one_way("freewheel", "wheel", "pedal")
    network.torque("pedal", TorqueFunction(lambda t, angle, speed: 10.0 * np.sin(3.0 * t) - 1.0 * speed), role="motor")
    network.torque("wheel", Viscous(0.1))
    motion = simulate(network, 6.0, **TIGHT)
    assert (motion.torque("freewheel") >= -1e-9).all()
    assert (motion.speed("wheel") >= motion.speed("pedal") - 1e-9).all()
    assert {"engage", "release"} <= {e.kind for e in motion.events}
    energy = motion.energy()
    assert np.abs(energy.balance).max() <= BALANCE * energy.input[-1]


@pytest.mark.slow
def test_backlash_is_crossed_freely_and_its_sides_never_pull():
    network = Network("backlash")
    network.shaft("out", 0.5)
    network.shaft("in", 0.1)
    network.spring("teeth", "out", "in", stiffness=2000.0, damping=1.0, backlash=0.02)
    network.torque("in", TorqueFunction(lambda t, angle, speed: 10.0 * np.sin(20.0 * t)), role="motor")
    network.torque("out", Viscous(0.2))
    motion = simulate(network, 1.0, **TIGHT)
    twist = motion.angle("in") - motion.angle("out")
    torque = motion.torque("teeth")
    assert (torque[np.abs(twist) < 0.01 - 1e-12] == 0).all()
    assert (torque * np.sign(twist) >= -1e-8).all()
    assert torque.max() > 10 and torque.min() < -10
    first = next(e.time for e in motion.events if e.kind == "contact")
    # until then the free pinion turns by ∬ 10 sin(20 t)/0.1
    assert 5.0 * (first - np.sin(20.0 * first) / 20.0) == pytest.approx(0.01, rel=1e-9)
    energy = motion.energy()
    assert np.abs(energy.balance).max() <= BALANCE * energy.input[-1]


@pytest.mark.slow
def test_thin_curve_tends_to_the_gear():
    """C → 0 at the same limit: the friction drive becomes rigid, first order in C."""
    speeds = []
    for C in (1e-2, 1e-3):
        network = two_shafts(1.5, curve=(400.0, 400.0 * C, C), speeds=(60.0, 90.0), efficiency=0.98)
        network.torque("in", 10.0)
        network.torque("out", Viscous(0.1))
        speeds.append(simulate(network, 0.5).speed("out")[-1])
    rigid = two_shafts(1.5, speeds=(60.0, 90.0), efficiency=0.98)
    rigid.torque("in", 10.0)
    rigid.torque("out", Viscous(0.1))
    limit = simulate(rigid, 0.5).speed("out")[-1]
    errors = np.abs(np.array(speeds) - limit)
    assert errors[1] < 2e-2 and errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
