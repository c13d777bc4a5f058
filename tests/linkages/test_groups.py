"""Groups against the tables of reference, and against Gauss's principle on the same linkage as a scene."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gauss
from gauss.linkages import cycle_kernel, power_balance, scene_state, work
from gauss.linkages.crank_ranges import near
from tests.support import linkages, mechanisms

TABLE = 1e-9  # absolute, relative above 1: what the tables ask for; they agree to about 1e-13
ROUTES = 1e-9  # the same, between groups and Gauss's principle; states are exact to 1e-13, conditions below 10
POWER = 1e-9  # of the largest term of a power balance


def _columns(found, names):
    """What a table of reference calls its columns → our numbers."""
    links = {number: found.link(name) for number, name in names.items()}
    columns = {"M1": found.torque}
    for number, moving in links.items():
        columns |= {
            f"link_{number}_angle": found.angle(names[number]),
            f"link_{number}_speed": moving.omega + np.zeros(len(found)),
            f"link_{number}_acceleration": moving.alpha + np.zeros(len(found)),
        }
    for joint in found.chain.joints:
        reaction = found.reactions[joint.name] + np.zeros(len(found))
        columns |= {f"R_{joint.name}_{key}": part for key, part in zip("xy", (reaction.real, reaction.imag), strict=True)}
        columns |= {f"R_{joint.name}_{key}": part for key, part in zip("nm", (reaction.real, reaction.imag), strict=True)}
        if joint.kind == "prismatic":
            number = next(n for n, name in names.items() if name == joint.child)
            for key, part in zip(("position", "speed", "acceleration"), found.slide(joint.name), strict=True):
                columns[f"slide_{number}_{key}"] = part + np.zeros(len(found))
    return columns


def _compare(table, found, names, but=("crank_angle", "work")):
    columns = _columns(found, names)
    for key, expected in table.items():
        if key not in but:
            assert linkages.apart(columns[key], np.array(expected)) <= TABLE, key


@pytest.mark.parametrize("name", linkages.SHIPPED)
@pytest.mark.parametrize("part", ["table", "accelerated"])
def test_tables_of_reference(name, part):
    """Every row of every table: positions, rates, accelerations, all reactions, torque."""
    file, names = linkages.SHIPPED[name]
    data = mechanisms.reference(file)
    linkage = gauss.load_linkage(name)
    acceleration = data[part].get("acceleration", 0.0)
    table = data[part].get("table", data[part])
    _compare(table, linkage.cycle(table["crank_angle"], acceleration=acceleration), names)


@pytest.mark.parametrize("name", linkages.SHIPPED)
def test_work_of_the_tables(name):
    table = mechanisms.reference(linkages.SHIPPED[name][0])["table"]
    assert linkages.apart(gauss.load_linkage(name).work(table["crank_angle"]), np.array(table["work"])) <= TABLE


@pytest.mark.parametrize("name, load", [("four_bar", {"moment": 100.0}), ("slider_crank", {"force": (1000.0, 0.0)})])
def test_resisting_loads(name, load):
    """The other reading of the loads: they oppose the motion, and the motor works."""
    file, names = linkages.SHIPPED[name]
    data = mechanisms.reference(file)["resisting"]
    linkage = gauss.load_linkage(name)
    (old,) = linkage.loads
    linkage.loads.clear()
    linkage.load(old.link, **load, resisting=True)
    _compare(data["table"], linkage.cycle(data["table"]["crank_angle"]), names)
    assert linkage.work()[-1] == pytest.approx(data["cycle_work"], rel=1e-12)


def test_class_three_against_the_table():
    """Reference from Newton and the Gauss route, checked by Pinocchio to 2e-11."""
    data = mechanisms.reference("linkage-extra")["class_III"]["table"]
    linkage = gauss.load_linkage("class_three")
    found = linkage.cycle(data["crank_angle"])
    _compare(data, found, linkages.CLASS_THREE, but=("crank_angle", "ternary_x", "ternary_y"))
    p = found.link("ternary").p
    assert linkages.apart(p.real, np.array(data["ternary_x"])) <= TABLE
    assert linkages.apart(p.imag, np.array(data["ternary_y"])) <= TABLE


EVERY = [*linkages.SHIPPED, "class_three"]


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_groups_and_gauss_agree_on_every_example(name):
    """One scene, carried from angle to angle by the closed forms, all 24 rows, both ways of turning."""
    linkage = gauss.load_linkage(name)
    (driver,) = linkage.drives
    linkage.drive(driver.joint, speed=-driver.speed, acceleration=17.0)
    system = gauss.compile_scene(linkage.to_scene())
    found = linkage.cycle(np.radians(15.0) * np.arange(24), speed=-driver.speed, acceleration=17.0)
    assert max(linkages.difference(found, system, index, 0.0) for index in range(len(found))) <= ROUTES


def _random(groups):
    return given(
        kinds=groups(st.sampled_from(linkages.KINDS)),
        seed=st.integers(0, 2**32 - 1),
        direction=st.floats(-np.pi, np.pi),
        backwards=st.booleans(),
    )


@pytest.mark.slow
@settings(max_examples=1000)
@_random(lambda kind: st.lists(kind, min_size=1, max_size=2))
@pytest.mark.filterwarnings("ignore::gauss.errors.NearSingularWarning")  # candidates that are then drawn again
def test_groups_and_gauss_agree_on_random_linkages(kinds, seed, direction, backwards):
    """Any groups on any carriers, joints either way round, loads everywhere, gravity at any angle, cranks both ways."""
    assert _difference(kinds, seed, direction, backwards) <= ROUTES


@pytest.mark.slow
@settings(max_examples=20)
@_random(lambda kind: st.lists(kind, min_size=3, max_size=5))
@pytest.mark.filterwarnings("ignore::gauss.errors.NearSingularWarning")
def test_groups_and_gauss_agree_on_long_chains(kinds, seed, direction, backwards):
    """Each group may magnify accelerations by its condition squared: small ones carry the rounding of large ones."""
    assert _difference(kinds, seed, direction, backwards, linkages.largest) <= ROUTES


def _difference(kinds, seed, direction, backwards, scale=None):
    gravity = 9.8 * np.exp(1j * direction)
    linkage, found = linkages.random_linkage(np.random.default_rng(seed), kinds, gravity, backwards)
    balance = power_balance(found)
    assert abs(balance.residual[0]) <= POWER * max(map(abs, (balance.motor[0], balance.loads[0], balance.change[0], 1.0)))
    system = gauss.compile_scene(linkage.to_scene(torque=0.0))
    return linkages.difference(found, system, 0, found.crank_angle[0], scale)


@pytest.mark.parametrize("name", EVERY)
def test_rates_are_derivatives(name):
    """Velocities and accelerations against central differences of positions over the crank angle."""
    linkage = gauss.load_linkage(name)
    (driver,) = linkage.drives
    h, angles = 1e-4, np.linspace(0.1, 6.0, 17)
    before, at, after = (linkage.cycle(angles + step, acceleration=0.0) for step in (-h, 0.0, h))
    for link in at.chain.links:
        x = [found.point(link.name, (0.3, -0.2)).position for found in (before, at, after)]
        point = at.point(link.name, (0.3, -0.2))
        scale = driver.speed / h
        assert np.abs((x[2] - x[0]) / 2 * scale - point.velocity).max() <= 1e-6 * driver.speed  # error h² f‴/6
        second = (x[2] - 2 * x[1] + x[0]) * scale**2
        assert np.abs(second - point.acceleration).max() <= 1e-5 * driver.speed**2  # rounding ε/h² and h² f⁗/12


@pytest.mark.parametrize("name", EVERY)
def test_power_balance_over_a_cycle(name):
    found = gauss.load_linkage(name).cycle(np.linspace(0.0, 2 * np.pi, 721), acceleration=5.0)
    balance = power_balance(found)
    scale = max(np.abs(part).max() for part in balance[:3])
    assert np.abs(balance.residual).max() <= POWER * scale


def test_six_equations_of_a_group():
    """The whole 6 × 6 system of the RRR group in its order of unknowns: the same reactions."""
    found = gauss.load_linkage("four_bar").cycle(np.linspace(0.0, 6.0, 13))
    i, j = found.link("coupler"), found.link("rocker")
    G_i, G_j = i.point(0.5), j.point(0.35)
    pins = {"B": i.point(0), "C": i.point(1.0), "D": j.point(0)}
    for k in range(len(found)):
        matrix, right = np.zeros((6, 6)), np.zeros(6)
        arms = {(0, "B"): 1, (0, "C"): 1, (1, "C"): -1, (1, "D"): 1}
        for (link, pin), sign in arms.items():
            arm, column = pins[pin][k] - (G_i, G_j)[link][k], 2 * "BCD".index(pin)
            block = np.array([[1, 0], [0, 1], [-arm.imag, arm.real]])
            matrix[3 * link : 3 * link + 3, column : column + 2] = sign * block
        for link, (moving, G, m, J, M) in enumerate([(i, G_i, 3.0, 0.25, 0.0), (j, G_j, 2.2, 0.09, -100.0)]):
            f = m * (moving.acceleration(G)[k] + 9.8j)
            right[3 * link : 3 * link + 3] = f.real, f.imag, J * moving.alpha[k] - M
        reactions = np.concatenate([found.reaction(pin).force[k] for pin in "BCD"])
        assert linkages.apart(reactions, np.linalg.solve(matrix, right)) <= TABLE


@pytest.mark.slow
def test_a_simulated_scene_meets_the_groups():
    """gauss.simulate on the prescribed crank, gauss.drive_forces and gauss.reactions: user's route, no closed form."""
    linkage = gauss.load_linkage("six_bar")
    trajectory = gauss.simulate(linkage.to_scene(), 0.3, times=np.linspace(0.0, 0.3, 7), rtol=1e-10, atol=1e-12)
    found = linkage.cycle(10.0 * trajectory.t)
    assert linkages.apart(gauss.drive_forces(trajectory, "A"), found.torque) <= 1e-8  # positions projected to 1e-13 only
    with pytest.warns(gauss.errors.NonUniqueReactionWarning):
        force = gauss.reactions(trajectory, "C").force
    assert linkages.apart(force[:, :2], found.reaction("C").force) <= 1e-8


def test_state_of_another_scene_is_refused():
    found = gauss.load_linkage("four_bar").cycle([0.0])
    system = gauss.compile_scene(gauss.load_linkage("shaper").to_scene())
    with pytest.raises(gauss.errors.LinkageError, match="other joints"):
        scene_state(system, found, 0)


def test_work_runs_backwards_as_well():
    """The same crank angles in the opposite order: the opposite work, for loads that depend on position only."""
    chain = gauss.load_linkage("four_bar").chain
    angles = np.linspace(0.3, 4.0, 9)
    there, back = work(chain, angles), work(chain, angles[::-1])
    assert linkages.apart(back[-1], -there[-1]) <= TABLE


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_machine_code_and_numpy_are_one(name):
    """The same source as SIMD code: torque and all reactions; resisting and viscous loads with it."""
    linkage = gauss.load_linkage(name)
    output = linkage.chain.links[-1].name
    linkage.load(output, force=(3.0, 5.0), resisting=True, viscous=0.7)
    angles = linkage.sweep(100)
    found = linkage.cycle(angles, acceleration=-12.0)
    inputs = [angles, found.motion.crank_speed, np.full(angles.size, -12.0)]
    inputs += [row for pose in near(linkage.chain, angles).values() for row in pose]
    torque, *reactions = cycle_kernel(linkage.chain)(np.array(inputs))
    assert linkages.apart(torque, found.torque) <= TABLE
    for k, expected in enumerate(found.reactions.values()):
        assert linkages.apart(reactions[2 * k] + 1j * reactions[2 * k + 1], expected) <= TABLE
