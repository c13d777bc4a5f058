"""Analysis of rotor networks: steady operation, run-up, vibrations, and what explain says."""

import numpy as np
import pytest

from gauss.errors import SceneError, StateError
from gauss.rotors import (
    Constant,
    Dry,
    Kloss,
    Linear,
    Network,
    Periodic,
    Quadratic,
    Viscous,
    campbell,
    eigenmodes,
    explain,
    operating_points,
    run_up_time,
    simulate,
)
from tests.support.rotor_networks import FALLING, reference


def _hoist(load: float) -> Network:
    """Induction motor with a load of constant torque: two operating points below the pull-out torque."""
    network = Network("hoist")
    network.shaft("motor", 0.5)
    network.torque("motor", Kloss(100.0, 0.2, 150.0))
    network.torque("motor", Constant(-load))
    return network


def test_all_points_of_an_induction_motor():
    """2 M_k s s_k/(s² + s_k²) = M has the slips s_k (m ± √(m² − 1)), m = M_k/M; the smaller one is stable."""
    m = 100.0 / 60.0
    slips = 0.2 * (m + np.array([1.0, -1.0]) * np.sqrt(m * m - 1))
    points = operating_points(_hoist(60.0))
    assert [p.speed("motor") for p in points] == pytest.approx(150.0 * (1 - slips), rel=1e-10)
    assert [p.stable for p in points] == [False, True]
    assert all(p.input == pytest.approx(60.0 * p.speed("motor")) for p in points)


def test_no_point_above_the_pull_out_torque():
    forward = [p for p in operating_points(_hoist(101.0)) if p.speed("motor") > 0]
    assert not forward


def test_falling_branch_has_an_unstable_point_between_stall_and_drive():
    network = Network("falling")
    network.shaft("out", 0.8)
    network.shaft("in", 0.4)
    network.friction_drive("link", "out", "in", 1.0, FALLING)
    network.torque("out", Dry(30.0))
    network.torque("in", Linear(50.0, 100.6))
    stall, unstable, drive = operating_points(network)
    assert [p.stable for p in (stall, unstable, drive)] == [True, False, True]
    assert stall.stuck[0] and stall.slip("link") == pytest.approx(1.0)
    # 8 x/(x² + 0.01) = 30 on both sides of the peak
    roots = np.sort(np.roots([30.0, -8.0, 0.3]))
    assert [drive.slip("link"), unstable.slip("link")] == pytest.approx(roots, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["friction-chain", "parallel"])
def test_motion_ends_in_the_stable_point(name):
    network, _ = reference(name)
    for torque in [t for t in network.torques.values() if t.timed]:
        del network.torques[torque.name]
    points = [p for p in operating_points(network) if p.stable]
    last = simulate(network, 15.0, times=[15.0]).speeds[-1]
    assert min(np.abs(p.speeds - last).max() for p in points) <= 1e-4 * last.max()
    for p in points:
        lost = p.slip_loss.sum() + p.mesh_loss.sum()
        assert p.input == pytest.approx(p.useful + p.bearings + lost, rel=1e-9)
        assert (p.slip_loss >= 0).all() and (p.mesh_loss >= 0).all() and 0 < p.efficiency < 1


@pytest.mark.slow
def test_periodic_torques_count_with_their_mean():
    network = _hoist(40.0)
    network.torque("motor", Periodic((-10.0, -20.0, -30.0)))
    plain = operating_points(_hoist(60.0))
    assert [p.speed("motor") for p in operating_points(network)] == pytest.approx([p.speed("motor") for p in plain])


def test_run_up_of_a_linear_motor():
    """J ω̇ = k (ω_0 − ω): 95 % after ln 20 · J/k."""
    network = Network("run-up")
    network.shaft("motor", 0.5)
    network.torque("motor", Linear(2.0, 100.0))
    motion = simulate(network, 6.0)
    assert run_up_time(motion, "motor", 95.0) == pytest.approx(np.log(20.0) * 0.25, rel=1e-4)
    with pytest.raises(StateError, match="never reaches 120 rad/s.*Simulate longer"):
        run_up_time(motion, "motor", 120.0)


def _elastic(ratio: float = 2.0) -> Network:
    network = Network("elastic")
    network.shaft("engine", 1.0)
    network.shaft("pinion", 0.2)
    network.shaft("propeller", 5.0)
    network.spring("shaft", "pinion", "engine", stiffness=4000.0, damping=0.5)
    network.gear("gear", "propeller", "pinion", ratio)
    return network


def test_two_masses_and_a_spring():
    """f = √(k (1/J_1 + 1/J_2))/2π with the propeller referred to the pinion; the node lies between."""
    modes = eigenmodes(_elastic())
    J_2 = 0.2 + 5.0 / 4.0
    assert modes.frequencies == pytest.approx([0.0, np.sqrt(4000.0 * (1 / 1.0 + 1 / J_2)) / (2 * np.pi)], rel=1e-12)
    assert modes.shapes[:, 0] == pytest.approx([1.0, 1.0, 0.5])
    assert modes.shapes[:, 1] == pytest.approx([1.0, -1 / J_2, -0.5 / J_2])


def test_modes_of_a_state_have_the_clutch_that_sticks_in_it():
    """Two discs on a spring, the second clutched to a third: f = √(k (1/J_1 + 1/(J_2 + J_3)))/2π once it sticks."""
    network = Network("clutch")
    for name, inertia in (("one", 1.0), ("two", 0.5), ("three", 2.0)):
        network.shaft(name, inertia)
    network.spring("spring", "two", "one", stiffness=500.0, damping=2.0)
    network.clutch("clutch", "three", "two", 200.0)
    network.torque("one", 5.0)
    modes = eigenmodes(network, simulate(network, 1.0))
    expected = np.sqrt(500.0 * (1 / 1.0 + 1 / 2.5)) / (2 * np.pi)
    assert modes.frequencies == pytest.approx([0.0, expected], abs=1e-6 * expected)
    assert modes.shapes[1] == pytest.approx(modes.shapes[2]) and "sticking: clutch" in modes.state
    assert len(eigenmodes(network).frequencies) == 3


@pytest.mark.parametrize("n", [3, 6])
def test_chain_of_equal_discs(n):
    """Free chain: ω_k = 2 √(k/J) sin(k π/2n)."""
    network = Network("discs")
    for j in range(n):
        network.shaft(f"d{j}", 0.5)
        if j:
            network.spring(f"s{j}", f"d{j}", f"d{j - 1}", stiffness=300.0)
    expected = 2 * np.sqrt(300.0 / 0.5) * np.sin(np.arange(n) * np.pi / (2 * n)) / (2 * np.pi)
    assert eigenmodes(network).frequencies == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_free_vibration_has_the_eigenfrequency():
    network = _elastic()
    f = eigenmodes(network).frequencies[1]
    network.torque("engine", 50.0, until=0.01)
    motion = simulate(network, 0.6, times=np.linspace(0.02, 0.6, 600))
    twist = motion.speed("engine") - motion.speed("pinion")
    ups = motion.t[1:][(twist[:-1] < 0) & (twist[1:] >= 0)]
    assert np.diff(ups).mean() == pytest.approx(1 / f, rel=1e-3)


def test_campbell_table_meets_the_orders():
    network = _elastic()
    network.torque("engine", Viscous(0.1))
    network.torque("propeller", Quadratic(0.01))
    f = eigenmodes(network).frequencies[1]
    speeds = np.linspace(20.0, 400.0, 20)
    table = campbell(network, "engine", speeds, orders=(1, 2))
    assert table.frequencies[:, 0] == pytest.approx(f, rel=1e-3)
    assert (np.diff(table.damping[:, 0]) > 0).all()  # the propeller damps more the faster it turns
    assert {order for order, _, _ in table.crossings} == {1.0, 2.0}
    for order, speed, frequency in table.crossings:
        assert order * speed == pytest.approx(2 * np.pi * f, rel=1e-3) and frequency == pytest.approx(f, rel=1e-3)
    with pytest.raises(SceneError, match="other than 0"):
        campbell(network, "engine", [0.0, 10.0])


def test_slip_damps_less_at_higher_speed():
    """The slope of a friction drive, A/(C ω), falls with the speed."""
    network = _elastic()
    network.shaft("fan", 2.0)
    network.friction_drive("drive", "fan", "propeller", 1.0, (200.0, 6.0, 0.03))
    table = campbell(network, "engine", [50.0, 100.0, 200.0])
    rates = 2 * np.pi * table.frequencies[:, -1] * table.damping[:, -1]
    assert (np.diff(rates) != 0).all() and np.isfinite(table.frequencies[:, -1]).all()


def test_explain_says_the_reduced_equation_with_numbers():
    network, data = reference("gear-runup")
    text = explain(network)
    assert "1 coordinate instead of 3" in text
    assert f"= {data['table']['J_pr'][0]:.9g} kg m²" in text
    assert "(1 − ε(l0))/i(l0)" in text and "/(i(l1)·η(l1))" in text and "becomes η̄" in text
    assert "l1: friction drive, s2 → s1, i = 1.25" in explain(reference("friction-chain")[0])


@pytest.mark.slow
def test_clutch_that_holds_has_a_point_and_one_that_cannot_slips():
    """Below its torque the clutch turns as one; above, the motor runs away from a load that stalls."""
    for load, speed in ((30.0, 150.0 - 30.0 / 2.0), (60.0, 0.0)):
        network = Network("clutch")
        network.shaft("motor", 0.5)
        network.shaft("load", 1.0)
        network.clutch("clutch", "load", "motor", torque=40.0)
        network.torque("motor", Linear(2.0, 150.0))
        network.torque("load", Dry(load))
        points = operating_points(network)
        assert speed == pytest.approx(max(p.speed("load") for p in points), abs=1e-9)
        if load > 40.0:
            (stalled,) = points
            assert stalled.torques == pytest.approx([40.0]) and stalled.speed("motor") == pytest.approx(150.0 - 20.0)


def test_train_held_altogether_is_a_point_of_rest():
    """A self-locking worm behind a motor that is off: nothing moves, and nothing is free to leave."""
    network = Network("worm")
    network.shaft("motor", 0.1)
    network.shaft("wheel", 2.0)
    network.gear("worm", "wheel", "motor", 30.0, efficiency=0.6, back_efficiency=0.0)
    network.torque("wheel", -100.0)
    network.torque("motor", Viscous(0.01))
    (point,) = operating_points(network)
    assert point.stuck.all() and point.stable and (point.speeds == 0).all()


def test_speed_that_nothing_announced_is_found():
    network = Network("free")
    network.shaft("wheel", 1.0)
    network.torque("wheel", 50.0)
    network.torque("wheel", Viscous(0.5))
    assert [p.speed("wheel") for p in operating_points(network)] == pytest.approx([100.0])
