"""What designers ask of a linkage, against closed forms, the tables of reference and second routes."""

import numpy as np
import pytest

import gauss
from gauss.errors import LinkageError, SimulationError
from gauss.linkages import kinetic, potential, shaking
from tests.support import linkages, mechanisms

EXACT = 1e-12  # closed forms
TABLE = 1e-9
FOLLOWED = 1e-10  # rad, rad/s at rtol 1e-12; the two formulations of the reference agree to 8e-11
EXTRA = mechanisms.reference("linkage-extra")


def _four_bar(r1, r2, r3, r4, **load):
    linkage = gauss.Linkage("four-bar", gravity=(0, -9.8))
    for name, r in (("crank", r1), ("coupler", r2), ("rocker", r3)):
        linkage.link(name, 1.0, r**2 / 12, (r / 2, 0))
    linkage.revolute("A", "ground", "crank")
    linkage.revolute("B", "crank", "coupler", at=(r1, 0))
    linkage.revolute("C", "rocker", "coupler", at=(r3, 0), child_at=(r2, 0))
    linkage.revolute("D", "ground", "rocker", at=(r4, 0))
    linkage.drive("A", speed=10.0)
    if load:
        linkage.load("rocker", **load)
    return linkage


@pytest.mark.parametrize(
    "lengths, kind, shortest",
    [
        ((0.4, 1.0, 0.7, 1.2), "crank-rocker", "crank"),
        ((0.7, 1.0, 0.4, 1.2), "crank-rocker", "rocker"),
        ((1.0, 0.4, 1.2, 0.7), "double-rocker", "coupler"),
        ((1.0, 0.7, 1.2, 0.4), "double-crank", "ground"),
        ((1.0, 1.2, 0.6, 1.7), "triple-rocker", "rocker"),
        ((0.5, 1.0, 0.5, 1.0), "change point", "crank"),
    ],
)
def test_grashof(lengths, kind, shortest):
    linkage = _four_bar(*lengths)
    found = linkage.grashof()
    assert (found.kind, found.shortest) == (kind, shortest)
    ordered = sorted(lengths)
    assert found.margin == pytest.approx(ordered[1] + ordered[2] - ordered[0] - ordered[3], abs=1e-15)
    turns = linkage.closing_ranges() == [(-np.pi, np.pi)]
    assert turns == (kind in ("double-crank", "change point") or (kind, shortest) == ("crank-rocker", "crank"))


def test_grashof_of_the_example():
    quality = EXTRA["quality"]
    found = gauss.load_linkage("four_bar").grashof()
    assert found.margin == pytest.approx(quality["grashof_margin"], abs=1e-15)
    assert found.shortest == quality["shortest_is"]


@pytest.mark.parametrize("offset, turns", [(0.0, True), (0.7, True), (0.9, False)])
def test_a_slider_crank_turns_if_its_rod_is_long_enough(offset, turns):
    linkage = gauss.load_linkage("slider_crank")
    guide = linkage.joints.pop("D")
    linkage.prismatic("D", guide.parent, guide.child, at=(0.3, offset))
    found = linkage.grashof()
    assert found.margin == pytest.approx(1.2 - 0.4 - offset)
    assert found.kind == ("rotating crank" if turns else "swinging crank")
    assert (linkage.closing_ranges() == [(-np.pi, np.pi)]) == turns


@pytest.mark.parametrize("name", ["shaper", "six_bar", "class_three"])
def test_other_linkages_have_a_class_only_where_it_means_something(name):
    assert (gauss.load_linkage(name).grashof() is None) == (name != "six_bar")


def test_transmission_angle():
    """cos μ = (r_i² + r_j² − |D − B|²) / (2 r_i r_j), least at the folded or stretched crank."""
    linkage, quality = gauss.load_linkage("four_bar"), EXTRA["quality"]
    found = linkage.cycle([0.0, np.pi, 1.0])
    (mu,) = found.transmission().values()
    folded, stretched = quality["transmission_angle_at_crank_folded"], quality["transmission_angle_at_crank_stretched"]
    assert mu[:2] == pytest.approx([folded, np.pi - stretched], abs=EXACT)
    square = abs(1.2 - 0.4 * np.exp(1j)) ** 2
    assert np.cos(mu[2]) == pytest.approx(abs(1.0 + 0.49 - square) / 1.4, abs=EXACT)
    ((least, at),) = linkage.least_transmission().values()
    assert least == pytest.approx(quality["minimum_transmission_angle"], abs=EXACT)
    assert abs(at) == pytest.approx(np.pi, abs=1e-6)  # flat at the minimum: the place carries half the digits
    (kappa,) = found.condition().values()
    rows = [np.array([[1.0, 0.0], [np.cos(m), np.sin(m)]]) for m in mu]
    assert kappa == pytest.approx([np.linalg.cond(row) for row in rows], rel=EXACT)


def test_dead_centres_and_swing():
    linkage = gauss.load_linkage("four_bar")
    dead = linkage.dead_centres("rocker")
    assert dead == pytest.approx(mechanisms.reference("linkage-fourbar")["resisting"]["dead_points"], abs=1e-11)
    assert np.ptp(linkage.cycle(dead).angle("rocker")) == pytest.approx(EXTRA["quality"]["swing"], abs=EXACT)
    assert gauss.load_linkage("slider_crank").dead_centres("D")[-1] == pytest.approx(np.pi, abs=EXACT)
    with pytest.raises(LinkageError, match="slides: none"):
        linkage.dead_centres("ram")


@pytest.mark.parametrize("lengths", [(1.0, 0.5, 1.0, 1.2), (2.0, 0.5, 1.8, 1.0)])
def test_transmission_over_two_ranges_is_found_within_them(lengths):
    linkage = _four_bar(*lengths)
    ranges = linkage.closing_ranges()
    ((least, at),) = linkage.least_transmission().values()
    assert len(ranges) == 2
    assert least >= 0.0  # not nan
    assert any(low <= at <= high for low, high in ranges)


def test_a_linkage_that_closes_nowhere_has_no_dead_centres():
    with pytest.raises(LinkageError, match="closes at no crank angle"):
        _four_bar(10.0, 0.5, 1.0, 1.2).dead_centres("rocker")


def test_work_does_not_depend_on_the_order_of_the_angles():
    linkage = _four_bar(0.4, 1.0, 0.7, 1.2, moment=-100.0, resisting=True)  # it jumps between the angles
    angles = np.array([0.3, 6.0, 1.0])
    order = np.argsort(angles)
    sorted_work = linkage.work(angles[order])
    np.testing.assert_allclose(linkage.work(angles)[order], sorted_work, atol=EXACT * np.abs(sorted_work).max())


def test_coupler_curve():
    """The pin C as a coupler point moves on a circle about D; any other point has the velocity of its two ends' mixture."""
    found = gauss.load_linkage("four_bar").cycle()
    C = found.point("coupler", (1.0, 0.0))
    assert np.hypot(C.position[:, 0] - 1.2, C.position[:, 1]) == pytest.approx(np.full(360, 0.7), abs=EXACT)
    assert C.velocity == pytest.approx(found.point("rocker", (0.7, 0.0)).velocity, abs=1e-11)
    middle = found.point("coupler", (0.5, 0.0)).acceleration
    assert middle == pytest.approx((C.acceleration + found.point("coupler").acceleration) / 2, abs=1e-10)


def test_reactions_in_link_axes():
    found = gauss.load_linkage("shaper").cycle()
    world, link = found.reaction("B"), found.reaction("B", axes="lever")
    turn = np.exp(-1j * found.angle("lever"))
    expected = (world.force @ [1, 1j]) * turn
    assert link.force @ [1, 1j] == pytest.approx(expected, abs=1e-9)
    slide = found.reaction("P23", axes="lever")
    assert np.abs(slide.force[:, 0]).max() <= 1e-10 * np.abs(slide.force).max()  # no friction: normal to the guide
    assert slide.force[:, 1] == pytest.approx(found.reactions["P23"].real, rel=EXACT)
    assert slide.moment == pytest.approx(found.reactions["P23"].imag, abs=EXACT)


def test_work_equals_the_change_of_energy_less_that_of_the_loads():
    """Constant loads on the swinging slider: W = ΔT + ΔV − F Δs."""
    linkage = gauss.load_linkage("six_bar")
    angles = np.linspace(0.2, 5.0, 14)
    found = linkage.cycle(angles)
    T, V, s = kinetic(found.motion), potential(found.motion), found.point("slider", (0.04, 0.02)).position[:, 0]
    assert linkage.work(angles) == pytest.approx(np.diff([T + V - 200.0 * s], prepend=(T + V - 200.0 * s)[0]).cumsum())


def test_flywheel():
    linkage = gauss.load_linkage("four_bar")
    linkage.loads.clear()
    linkage.load("rocker", moment=100.0, resisting=True)
    data, found = EXTRA["flywheel"], linkage.flywheel(EXTRA["flywheel"]["parameters"]["delta"])
    assert found.cycle_work == pytest.approx(data["cycle_work"], rel=TABLE)
    assert found.mean_torque == pytest.approx(data["mean_torque"], rel=TABLE)
    assert found.excess_energy == pytest.approx(data["excess_energy"], rel=TABLE)
    assert found.inertia == pytest.approx(data["flywheel_inertia"], rel=TABLE)


@pytest.mark.slow
def test_flywheel_keeps_the_speed_within_its_fluctuation():
    """Run with the flywheel and the constant mean torque: the speed fluctuates by δ, to first order in δ."""
    delta = 0.02
    linkage = _four_bar(0.4, 1.0, 0.7, 1.2, viscous=2.0)
    wheel = linkage.flywheel(delta)
    reduced = linkage.reduced_inertia(np.linspace(0, 2 * np.pi, 100)).mean()
    motion = linkage.run(20.0, lambda t, angle, speed: wheel.mean_torque, speed=10.0, added_inertia=wheel.inertia, rtol=1e-9)
    last = motion.speed[motion.angle > motion.angle[-1] - 2 * np.pi]
    assert reduced < 0.1 * wheel.inertia
    assert np.ptp(last) / last.mean() == pytest.approx(delta, rel=0.05)
    with pytest.raises(LinkageError, match="δ > 0"):
        linkage.flywheel(0.0)


def test_shaking_force():
    data = EXTRA["shaking"]
    linkage = gauss.load_linkage("four_bar")
    found = linkage.cycle(np.radians(15.0) * np.arange(24))
    force, moment = shaking(found)
    assert linkages.apart(force, np.array(data["force_on_frame_without_weight"])) <= TABLE
    on_ground = {"A": 0.0, "D": 1.2}  # what the pins exert on the frame, the motor's reaction with them
    reactions = {name: -found.reaction(name).force for name in on_ground}
    weight, load = np.array([0.0, -9.8 * 6.4]), -100.0
    assert sum(reactions.values()) == pytest.approx(force + weight, abs=TABLE)
    about_A = sum(x * reactions[name][:, 1] for name, x in on_ground.items()) - found.torque
    centres = [found.point(name, (c, 0)).position[:, 0] for name, c in (("crank", 0.2), ("coupler", 0.5), ("rocker", 0.35))]
    weights = -9.8 * np.array([1.2, 3.0, 2.2]) @ centres
    assert about_A == pytest.approx(moment + weights + load, abs=TABLE)


def test_counterweights_balance_a_four_bar_entirely():
    """Berkof and Lowen 1969: m1 c1 = −m2 r1 (1 − c2/r2), m3 c3 = −m2 r3 c2/r2; here found by least squares."""
    data, linkage = EXTRA["shaking"], gauss.load_linkage("four_bar")
    found = linkage.counterweights("crank", "rocker")
    for link, mass, com in (("crank", 1.2, "balanced_crank_com"), ("rocker", 2.2, "balanced_rocker_com")):
        own = mass * linkage.links[link].com[0]
        assert found.moments[link] == pytest.approx([mass * data[com][0] - own, 0.0], abs=TABLE)
    assert found.after <= 1e-11 * found.before
    balanced = linkage
    for link, moment in found.moments.items():
        balanced = balanced.with_counterweight(link, moment, radius=0.25)
    assert np.abs(shaking(balanced.cycle()).force).max() <= 1e-11 * found.before
    assert balanced.links["crank"].mass == pytest.approx(1.2 + 0.84 / 0.25)
    scene_mass = sum(body.mass for body in balanced.to_scene().bodies.values())
    assert scene_mass == pytest.approx(sum(link.mass for link in balanced.links.values()))


def test_counter_rotors_balance_the_moment_of_an_inline_four_bar_with_a_pendulum_coupler():
    """Berkof 1973: coupler with J2 = m2 c2 (r2 − c2) is two point masses; two counter-rotating discs do the rest."""
    linkage = gauss.load_linkage("four_bar")
    linkage.links["coupler"] = gauss.linkages.PlanarLink("coupler", 3.0, 3.0 * 0.5 * 0.5, (0.5, 0.0))
    for link, moment in linkage.counterweights("crank", "rocker").moments.items():
        linkage = linkage.with_counterweight(link, moment, radius=0.3)
    found = linkage.counter_rotors("crank", "rocker")
    assert found.after <= 1e-11 * found.before
    rocker = linkage.links["rocker"]
    about_D = rocker.inertia + rocker.mass * rocker.com[0] ** 2 + 1.5 * 0.7**2  # with half of the coupler at C
    assert found.inertias["rocker"] == pytest.approx(about_D)
    with pytest.raises(LinkageError, match="crank, rocker have one"):
        linkage.counterweights("coupler")
    with pytest.raises(LinkageError, match="positive length"):
        linkage.with_counterweight("crank", (1.0, 0.0), 0.0)


def _viscous_four_bar():
    linkage = gauss.load_linkage("four_bar")
    linkage.loads.clear()
    linkage.load("rocker", viscous=4.0)
    return linkage


def test_forward_dynamics_against_the_table():
    data = EXTRA["forward_dynamics"]["table"]
    linkage = _viscous_four_bar()
    motion = linkage.run(data["time"][-1], times=data["time"], rtol=1e-12, atol=1e-13)
    assert motion.angle == pytest.approx(data["crank_angle"], abs=FOLLOWED)
    assert motion.speed == pytest.approx(data["crank_speed"], abs=FOLLOWED)
    assert linkages.apart(motion.acceleration, np.array(data["crank_acceleration"])) <= TABLE
    assert linkages.apart(linkage.reduced_inertia(motion.angle) + 0.5, np.array(data["reduced_inertia"])) <= TABLE


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "shaper", "class_three"])
def test_forward_dynamics_by_the_compiled_scene(name):
    """One coordinate against the scene of all bodies, free under the same motor and a viscous and a constant load."""
    linkage = gauss.load_linkage(name)
    output = linkage.chain.links[-1].name
    linkage.load(output, viscous=2.0)
    linkage.drive("A", speed=3.0)
    linkage.motor([0.0, 20.0], [60.0, 0.0])
    (motor,) = linkage.motors
    times = np.linspace(0.0, 0.1, 3)
    motion = linkage.run(times[-1], speed=3.0, times=times, rtol=1e-11)
    scene = linkage.to_scene(torque=lambda t, motion: motor(t, 0.0, motion.rate("A")))
    trajectory = gauss.simulate(scene, times[-1], times=times, rtol=1e-9, atol=1e-10)
    assert trajectory.coordinate("A") == pytest.approx(motion.angle, abs=1e-8)
    assert trajectory.rate("A") == pytest.approx(motion.speed, abs=1e-7)


def test_half_slope_of_the_reduced_inertia():
    """b = ½ dJ_e/dθ, by central differences."""
    linkage, h = gauss.load_linkage("class_three"), 1e-5
    equation = gauss.linkages.ReducedLinkage(linkage.chain)
    for angle in (0.3, 2.0, 5.0):
        slope = np.diff(linkage.reduced_inertia([angle - h, angle + h]))[0] / (4 * h)
        assert equation.terms(angle, 1.0)[1] == pytest.approx(slope, abs=1e-8)


def test_a_motor_follows_its_points():
    motor = gauss.linkages.CrankMotor([0.0, 10.0, 20.0], [100.0, 80.0, 0.0])
    assert [motor(0, 0, w) for w in (0.0, 5.0, 15.0, 25.0, -5.0)] == [100.0, 90.0, 40.0, -40.0, 110.0]


def test_a_run_stops_with_the_reason_where_the_linkage_does_not_close():
    linkage = _four_bar(1.0, 1.2, 0.5, 1.2)
    linkage.drive("A", speed=1.0)
    with pytest.raises(SimulationError, match="it closes from -"):
        linkage.run(20.0, lambda t, angle, speed: 50.0, angle=0.9 * linkage.closing_ranges()[0][1])


def test_laws_of_loads():
    """A law takes the position of its link; the torque follows by virtual work at rest: M1 = −F·dx/dθ."""
    linkage = _four_bar(0.4, 1.0, 0.7, 1.2)
    light = gauss.Linkage("light", gravity=(0, 0))
    light.links.update(linkage.links)
    light.joints.update(linkage.joints)
    light.drive("A", speed=0.0)
    light.load("rocker", at=(0.7, 0.0), law=lambda here: (3.0 * here.crank_angle, here.position.real, here.angle))
    angles = np.array([0.5, 2.0])
    found, unit = light.cycle(angles), light.cycle(angles, speed=1.0)
    C = unit.point("rocker", (0.7, 0.0))
    by_work = 3 * angles * C.velocity[:, 0] + C.position[:, 0] * C.velocity[:, 1]
    by_work += found.angle("rocker") * unit.link("rocker").omega
    assert found.torque == pytest.approx(-by_work, rel=1e-12)
    light.load("rocker", law=lambda here: 5.0)
    with pytest.raises(LinkageError, match="must return Fx, Fy, M"):
        light.cycle(angles)
