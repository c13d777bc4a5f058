"""Every link of rotors inside a scene: motions, torques and events of the network, and each of them driving a four-bar."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.plan import motion_plan
from gauss.errors import SceneError, SimulationError
from gauss.math import cos, sin
from gauss.rotors import Constant, Dry, Linear, Network, TorqueFunction, Viscous, simulate, to_scene
from gauss.scene import Clutch, LossyGear
from gauss.system import ContactMode

MOTIONS = 1e-8  # speeds over the largest; both integrated at 1e-10, torn apart at events
TORQUES = 1e-7  # friction drives turn an error of speed into one of torque thirty times as large
EVENTS = 1e-7  # s: a grip lets go, a flow turns when it is off by 1e-9 of the force
BALANCE = 1e-8  # of the largest energy
TIGHT = {"rtol": 1e-10, "atol": 1e-10, "progress": False}


def _pair(driver=30.0, driven=None) -> Network:
    network = Network("pair")
    network.shaft("out", 0.8, speed=driven, angle=0.1)
    network.shaft("in", 0.1, speed=driver)
    return network


def _swings(size: float, rate: float):
    return TorqueFunction(lambda t, angle, speed: size * cos(rate * t))


def _clutch():
    network = _pair(driver=60.0, driven=20.0)
    network.clutch(
        "link", "out", "in", {"time": [0.0, 0.1, 0.6, 0.7], "torque": [0.0, 60.0, 60.0, 2.0]}, static=1.2, ratio=2.0
    )
    network.torque("in", Linear(1.0, 120.0))
    network.torque("out", Dry(3.0))
    return network, 0.8


def _limiter():
    network = _pair(driver=50.0, driven=50.0)
    network.torque_limiter("link", "out", "in", 20.0, static=1.1)
    network.torque("in", TorqueFunction(lambda t, angle, speed: 40.0 * sin(8.0 * t)))
    return network, 0.6


def _freewheel():
    network = _pair(driver=50.0, driven=25.0)
    network.one_way("link", "out", "in", ratio=2.0)
    network.torque("in", _swings(40.0, 9.0))
    network.torque("out", Viscous(0.5))
    return network, 0.8


def _lossy_gear():
    network = _pair()
    network.gear("link", "out", "in", -3.0, efficiency=0.9, back_efficiency=0.8)
    network.torque("in", _swings(20.0, 8.0))
    return network, 0.6


def _slipping_gear():
    network = _pair()
    network.gear("link", "out", "in", 3.0, slip=0.05)
    network.torque("in", Linear(0.5, 100.0))
    network.torque("out", Viscous(0.4))
    return network, 0.5


def _stuck_train():
    """Dry load, bearings and losses stop two stages, hold them, and let them go."""
    network = _pair(driver=5.0)
    network.shaft("mid", 0.2)
    network.gear("first", "mid", "in", 3.0, efficiency=0.9)
    network.gear("link", "out", "mid", -2.0, efficiency=0.85, back_efficiency=0.7)
    network.torque("in", TorqueFunction(lambda t, angle, speed: -4.0 + 20.0 * t))
    network.torque("out", Dry(14.0))
    return network, 0.45


def _self_locking():
    network = _pair()
    network.gear("link", "out", "in", 10.0, efficiency=0.6, back_efficiency=0.0)
    network.torque("in", Constant(-8.0), until=0.3)
    network.torque("out", Constant(-30.0))
    return network, 0.4


def _friction_drive():
    """Slips, sticks at zero slip up to a threshold, and loses torque in both."""
    network = _pair(driven=18.0)
    network.friction_drive("link", "out", "in", 1.5, (40.0, 1.2, 0.04), efficiency=0.9)
    network.torque("in", _swings(12.0, 6.0))
    network.torque("out", Viscous(0.1))
    return network, 0.6


def _backlash():
    network = _pair(driver=5.0, driven=5.0)
    network.spring("link", "out", "in", 2.0, stiffness=200.0, damping=1.5, backlash=0.2)
    network.torque("in", _swings(5.0, 6.0))
    network.torque("out", Viscous(0.2))
    return network, 0.5


LINKS = {
    "clutch": (_clutch, ("lock", "slip")),
    "torque limiter": (_limiter, ("slip",)),
    "freewheel": (_freewheel, ("release", "engage")),
    "lossy gear": (_lossy_gear, ("power reversal",)),
    "constant slip": (_slipping_gear, ()),
    "stuck train": (_stuck_train, ("stall", "start")),
    "self-locking": (_self_locking, ("power reversal",)),
    "friction drive": (_friction_drive, ("lock", "slip")),
    "backlash": (_backlash, ("contact", "separate")),
}
SAME = {"lock": "holds", "engage": "holds", "stall": "holds", "slip": "slips", "release": "slips", "start": "slips"}


@pytest.mark.slow
@pytest.mark.parametrize("name", LINKS)
def test_the_scene_moves_as_the_network(name):
    make, kinds = LINKS[name]
    network, duration = make()
    times = np.linspace(0.0, duration, 13)
    ours = simulate(network, duration, times=times, rtol=1e-11, atol=1e-11)
    assert {event.kind for event in ours.events} >= set(kinds)  # the case tests what it is meant to
    theirs = gauss.simulate(to_scene(network), duration, times=times, **TIGHT)
    size = np.abs(ours.speeds).max()
    for shaft in network.shafts:
        assert np.abs(theirs.rate(shaft) - ours.speed(shaft)).max() <= MOTIONS * size
    for event in ours.events:
        if event.kind in kinds:
            alike = [found.t for found in theirs.events if SAME.get(event.kind, event.kind) == found.kind]
            assert np.abs(np.array(alike) - event.time).min() <= EVENTS, event
    energies = gauss.energy(theirs)
    assert np.abs(energies.balance).max() <= BALANCE * energies.scale
    moving = ~ours.stuck.any(axis=1)  # what stands still by friction and losses shares its torques in many ways
    for link in set(network.links) & set(theirs.system.scene.set_valued | theirs.system.scene.losses):
        expected = ours.torque(link)
        off = np.abs(gauss.set_valued_forces(theirs, link) - expected)[moving]
        assert off.max() <= TORQUES * np.abs(expected).max()


FOUR_BAR = {
    "clutch": lambda n: n.clutch("link", "crank shaft", "motor", 4.0, ratio=4.0),
    "torque limiter": lambda n: n.torque_limiter("link", "crank shaft", "motor", 6.0, ratio=4.0, static=1.2),
    "freewheel": lambda n: n.one_way("link", "crank shaft", "motor", ratio=4.0),
    "lossy gear": lambda n: n.gear("link", "crank shaft", "motor", 4.0, efficiency=0.8, back_efficiency=0.7),
    "constant slip": lambda n: n.gear("link", "crank shaft", "motor", 4.0, slip=0.04),
    "friction drive": lambda n: n.friction_drive("link", "crank shaft", "motor", 4.0, (6.0, 0.1, 0.04), efficiency=0.9),
    "backlash": lambda n: n.spring("link", "crank shaft", "motor", 4.0, stiffness=300.0, damping=1.0, backlash=0.02),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FOUR_BAR)
def test_every_link_drives_a_four_bar(name):
    """A motor behind the link; what the scene says of its energy closes, and what is lost is lost in the link."""
    network = Network("motor")
    network.shaft("motor", 0.01)
    network.shaft("crank shaft", 0.05)
    FOUR_BAR[name](network)
    linkage = gauss.load_linkage("four_bar")
    speed = linkage.drives[0].speed
    network.torque("motor", Linear(0.05, 6.0 * speed))
    scene = to_scene(network, linkage.to_scene(torque=0.0), on={"crank shaft": "A"})
    scene.start("motor", position=0.0, rate=4.0 * speed * (0.96**-1 if name == "constant slip" else 1.0))
    found = gauss.simulate(scene, 0.04, times=np.linspace(0.0, 0.04, 4), **TIGHT)
    assert np.ptp(found.rate("A")) > 1e-3  # it turns unevenly
    energies = gauss.energy(found)
    assert np.abs(energies.balance).max() <= BALANCE * energies.scale
    assert (np.diff(energies.dissipated) >= -BALANCE * energies.scale).all()
    if name in ("lossy gear", "constant slip", "friction drive"):
        assert energies.dissipated[-1] > 1e-4 * energies.scale


@pytest.mark.slow
def test_a_freewheel_that_is_overtaken_engages_by_an_impact():
    scene = gauss.Scene("wheels", gravity=(0, 0, 0))
    for name, inertia, rate in (("driver", 2.0, 10.0), ("driven", 3.0, 1.0)):
        scene.body(name, 1.0, (2.0, 2.0, inertia))
        scene.revolute(name, "ground", name)
        scene.start(name, rate=rate)
    scene.freewheel("wheel", "driven", "driver", ratio=2.0)
    found = gauss.simulate(scene, 0.1, progress=False)
    # the impulse P acts as P on the driven, −P/2 on the driver: 3 (ω − 1) = P, 2 (2 ω − 10) = −P/2
    omega = 43.0 / 11.0
    assert found.rate("driven")[-1] == pytest.approx(omega, rel=1e-12)
    assert found.rate("driver")[-1] == pytest.approx(2.0 * omega, rel=1e-12)
    assert found.events[0].kind == "impact" and found.events[0].gaps == ("wheel",)
    assert found.events[0].loss == pytest.approx(0.5 * (2 * 100 + 3 - 3 * omega**2 - 2 * 4 * omega**2), rel=1e-12)
    energies = gauss.energy(found)
    assert np.abs(energies.balance).max() <= 1e-12 * energies.scale


def _two() -> gauss.Scene:
    scene = gauss.Scene("two")
    for name in "AB":
        scene.body(name, 1.0, (1.0, 1.0, 1.0))
        scene.revolute(name, "ground", name)
    return scene


MISTAKES = {
    "no joint": (lambda s: s.clutch("c", "A", "C", 1.0), "no joint 'C'"),
    "one joint": (lambda s: s.freewheel("c", "A", "A"), "freewheel 'c': driven and driver are both 'A'"),
    "ratio": (lambda s: s.clutch("c", "A", "B", 1.0, ratio=0.0), "other than 0"),
    "hold": (lambda s: s.clutch("c", "A", "B", 5.0, hold=4.0), "hold 4 is below torque 5"),
    "law without hold": (lambda s: s.clutch("c", "A", "B", lambda t, motion: 1.0), "say what it holds at rest"),
    "efficiency": (lambda s: s.lossy_gear("g", "A", "B", 2.0, efficiency=1.2), "efficiencies are at most 1"),
    "energy from nothing": (lambda s: s.lossy_gear("g", "A", "B", 2.0, slip=0.1, back_efficiency=0.95), "would make energy"),
    "stiffness": (lambda s: s.elastic_link("e", "A", "B", backlash=0.1, damping=1.0), "backlash needs a stiffness"),
    "no matrices": (lambda s: (s.lossy_gear("g", "A", "B", 2.0, 0.9), _assembled(s)), "g: friction.*losses are no rows"),
}


def _assembled(scene):
    system = gauss.compile_scene(scene)
    return gauss.assemble(system, system.initial_state())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    make, words = MISTAKES[mistake]
    with pytest.raises(SceneError, match=words):
        make(_two())


@pytest.mark.parametrize("integrator", ["rk4", "time_stepping"])
def test_fixed_steps_are_refused_by_name(integrator):
    scene = _two()
    scene.lossy_gear("gear", "A", "B", 2.0, 0.9)
    with pytest.raises(SimulationError, match="gear"):
        gauss.simulate(scene, 0.1, integrator=integrator, step=0.01, progress=False)


def test_a_system_without_losses_is_what_it_was():
    """η = 1 and ε = 0 make a lossy gear an ideal one, that is no obstacle to machine code."""
    scene = _two()
    scene.lossy_gear("gear", "A", "B", -2.0)
    scene.drive("B", torque=3.0)
    found = gauss.simulate(scene, 0.5, progress=False)
    assert found.rate("A")[-1] == pytest.approx(-0.5 * 3.0 * 0.5 / 1.25, rel=1e-12)
    assert found.stats.plan.driver == "compiled loop"
    assert not scene.nonsmooth and isinstance(scene.relations["gear"], LossyGear)


def test_explain_and_advise_know_losses():
    scene = _two()
    scene.lossy_gear("gear", "A", "B", 2.0, 0.9)
    system = gauss.compile_scene(scene)
    assert motion_plan(system).driver == "events"
    found = gauss.advise(system)
    assert found.method == "dop853" and "losses" in found.reason


def test_a_file_keeps_them(tmp_path):
    scene = _two()
    scene.clutch("clutch", "A", "B", 3.0, ratio=2.0, hold=4.0)
    scene.freewheel("wheel", "A", "B", -1.5)
    scene.lossy_gear("gear", "A", "B", 2.0, 0.9, slip=0.02)
    scene.elastic_link("teeth", "A", "B", 2.0, stiffness=50.0, backlash=0.1)
    assert gauss.load(gauss.save(scene, tmp_path / "links.toml")) == scene


def test_contact_modes_are_keys():
    one, other = ContactMode(set_valued={"a": 0}), ContactMode().but(set_valued={"a": 0})
    assert hash(one) == hash(other) and one == other and one != one.but(set_valued={"a": 1})
    assert Clutch("c", "A", "B", 2.0).bounds(0.0) == (-2.0, 2.0)
