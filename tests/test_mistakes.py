"""Forty mistakes of a first day: each gets one clear message of gauss, with the remedy."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss import rotors
from gauss.errors import ArgumentError, BackendError, FileError, GaussError, SceneError, SimulationError, StateError

FILES = {
    "typo.toml": 'name = "x"\n[[body]]\nname = "a"\nmas = 1.0\n',
    "section.toml": 'name = "x"\n[[bodies]]\nname = "a"\nmass = 1.0\n',
    "single.toml": 'name = "x"\n[body]\nname = "a"\nmass = 1.0\n',
    "text.toml": 'name = "x"\n[[body]]\nname = "a"\nmass = "1 kg"\n',
    "broken.toml": "name = x\n",
    "broken.urdf": '<robot name="r"><link name="a"/>',
}


def door():
    scene = gauss.Scene("door")
    scene.body("leaf", 5.0, (0.4, 0.4, 0.02), com=(0.5, 0, 0))
    scene.revolute("hinge", "ground", "leaf")
    return scene


def with_handle():
    scene = door()
    scene.body("handle", 0.1, (1e-4, 1e-4, 1e-4))
    scene.fixed("weld", "leaf", "handle")
    return scene


def open_loop():
    """Two cranks 5 m apart and a rod of 1 m between them."""
    scene = gauss.Scene("loop", gravity=(0, 0, 0))
    for name, x in (("left", 0.0), ("right", 5.0)):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), position=(x, 0, 0))
        scene.revolute(f"hinge {name}", "ground", name, at=(x, 0, 0))
    scene.distance("rod", "left", "right", length=1.0, at=(0.5, 0, 0), other_at=(-0.5, 0, 0))
    return scene


def driven(law):
    scene = door()
    scene.drive("hinge", torque=law)
    return scene


def called(law):
    return lambda: gauss.simulate(driven(law), 0.1, rtol=1e-6, atol=1e-6)


def fails(*given):
    raise ValueError("no table for that")


def late(t):
    return 1.0 if float(t) < 0.02 else fails()


def pushed(force):
    def run():
        scene = door()
        scene.force("wind", "leaf", force)
        gauss.simulate(scene, 0.1)

    return run


def turned(law):
    return lambda: door().drive("hinge", angle=law)


def walled(gap, **settings):
    def run():
        scene = door()
        scene.one_sided("wall", gap)
        gauss.simulate(scene, 0.1, **settings)

    return run


def rubbed(limit):
    def run():
        scene = door()
        scene.joint_friction("hinge", limit)
        gauss.simulate(scene, 0.1)

    return run


def tied(position):
    def run():
        scene = door()
        scene.constrain("tie", position)
        gauss.compile_scene(scene)

    return run


def spun(law):
    def run():
        network = rotors.Network("fan")
        network.shaft("rotor", 1.0)
        network.torque("rotor", law, name="motor")
        rotors.simulate(network, 0.1)

    return run


WALL = {"integrator": "time_stepping", "step": 0.01}


def motion():
    return gauss.simulate(door(), 1e-3)


def swept(vary, **settings):
    return lambda: gauss.sweep(door(), vary, 0.1, **settings)


MISTAKES = {
    "family of nothing": (lambda: gauss.load("n_pendulum", n=0), SceneError, "n = 0.*at least 1"),
    "wrong path": (lambda: gauss.load("models/four_bra.toml"), FileError, "no such file"),
    "wrong path of a robot": (lambda: gauss.load("nowhere.urdf"), FileError, "no such file"),
    "wrong name": (lambda: gauss.load("fourbar"), FileError, "Did you mean 'four_bar'"),
    "wrong robot": (lambda: gauss.load("robot:pandas"), FileError, "Did you mean 'panda'"),
    "wrong format": (lambda: gauss.load("scene.json"), FileError, r"expected .toml or .urdf"),
    "a scene for a path": (lambda: gauss.load(door()), ArgumentError, "load: expected a str or Path, got a Scene"),
    "typo in a key": (lambda: gauss.load("typo.toml"), FileError, "'mas'. Did you mean 'mass'"),
    "typo in a section": (lambda: gauss.load("section.toml"), FileError, "'bodies'. Did you mean 'body'"),
    "single brackets": (lambda: gauss.load("single.toml"), FileError, r"\[\[body\]\] with double brackets"),
    "number as text": (lambda: gauss.load("text.toml"), FileError, r"mass: expected a non-negative number in \[kg\]"),
    "broken TOML": (lambda: gauss.load("broken.toml"), FileError, "not a TOML file.*line 1"),
    "broken URDF": (lambda: gauss.load("broken.urdf"), FileError, "not XML"),
    "option of another thing": (lambda: gauss.load("four_bar", root="free"), FileError, "are for robots"),
    "degrees for radians, a pose": (lambda: door().body("b", 1.0, rotation=(90, 0, 0)), SceneError, "np.deg2rad"),
    "degrees as text": (lambda: door().start("hinge", "30 deg"), SceneError, "rad or m"),
    "inertia about the wrong point": (
        lambda: door().body("rod", 1.0, (0.01, 0.01, 0.5)),
        SceneError,
        "triangle inequality.*about the centre of mass",
    ),
    "a loop that does not close": (lambda: gauss.simulate(open_loop(), 1.0), StateError, "rod"),
    "torque on a fixed joint": (lambda: with_handle().drive("weld", torque=1.0), SceneError, "cannot move"),
    "motion of a fixed joint": (lambda: with_handle().drive("weld", angle=1.0), SceneError, "cannot move"),
    "drive of a body": (lambda: door().drive("leaf", torque=1.0), SceneError, "no joint 'leaf'.*Known: hinge"),
    "complex torque": (lambda: driven(1j), SceneError, "expected a number in .*got 1j"),
    "generator for a torque": (lambda: driven(x for x in range(3)), SceneError, "expected a number in .*generator"),
    "law without time": (lambda: driven(lambda: 1.0), SceneError, "law.t, motion."),
    "law without a return": (lambda: gauss.simulate(driven(lambda t: None), 0.1), SimulationError, "drive of hinge"),
    "law with nan": (lambda: gauss.simulate(driven(lambda t: np.nan), 0.1), SimulationError, "finite numbers are needed"),
    "law with text": (called(lambda t: "x"), SimulationError, "'drive of hinge'.*returned 'x'; 1 finite"),
    "law with a complex number": (called(lambda t: 1j), SimulationError, "'drive of hinge'.*returned 1j; 1 finite"),
    "law with too many numbers": (called(lambda t: [1.0, 2.0]), SimulationError, "'drive of hinge'.*1 finite"),
    "law with nothing among numbers": (
        called(lambda t, m: [m.rate("hinge"), None]),
        SimulationError,
        "'drive of hinge'.*1 finite",
    ),
    "law that raises": (called(fails), SimulationError, "'drive of hinge': at t = 0 s.*no table for that"),
    "law that raises later": (called(late), SimulationError, r"'drive of hinge': at t = 0\.0[2-9].*no table for that"),
    "law of an unknown joint": (called(lambda t, m: m.rate("hing")), SimulationError, "'drive of hinge'.*mean 'hinge'"),
    "law of three arguments": (called(lambda t, m, x: 1.0), SceneError, "'drive of hinge'.*takes 3"),
    "force of one number": (pushed(lambda t: 1.0), SimulationError, "'wind'.*returned 1.0; 3 finite"),
    "force of lists": (pushed(lambda t: [[1.0, 2.0], 3.0]), SimulationError, "'wind'.*3 finite"),
    "angle that is text": (turned(lambda t: "x"), SceneError, "'drive of hinge'.*1 number"),
    "angle that is nothing": (turned(lambda t: None), SceneError, "'drive of hinge'.*1 number"),
    "gap that is text": (walled(lambda at: "x"), SceneError, "'wall'.*must return numbers, got 'x'"),
    "gap that is nothing": (walled(lambda at: None), SceneError, "'wall'.*must return numbers, got None"),
    "gap that raises": (walled(fails), SceneError, "'wall'.*no table for that"),
    "gap of an unknown joint": (walled(lambda at: at.coordinate("hing")), GaussError, "'wall'.*mean 'hinge'"),
    "gap with nan": (walled(lambda at: at.coordinate("hinge") * np.nan), SimulationError, "'wall'.*finite"),
    "gap with nan, stepped": (walled(lambda at: at.coordinate("hinge") * np.nan, **WALL), StateError, "'wall'.*finite"),
    "limit that is text": (rubbed(lambda t: "x"), SimulationError, "'friction of hinge'.*returned 'x'; 1 finite"),
    "limit that raises": (rubbed(lambda t: fails(t)), SimulationError, "'friction of hinge'.*no table for that"),
    "limit of the motion": (rubbed(lambda t, motion: 1.0), SceneError, r"'friction of hinge'.*limit\(t\)"),
    "constraint of text": (tied(lambda at: [at.coordinate("hinge"), "x"]), SceneError, "'tie'.*got 'x'"),
    "torque that is nothing": (spun(lambda t, angle, speed: None), GaussError, "'motor'.*returned None; 1 finite"),
    "torque that raises": (spun(fails), GaussError, "'motor'.*no table for that"),
    "name for a scene": (lambda: gauss.simulate("four_bar", 1.0), ArgumentError, r"got 'four_bar'.*gauss.load\(name\)"),
    "name to compile": (lambda: gauss.compile_scene("four_bar"), ArgumentError, r"gauss.load\(name\)"),
    "negative duration": (lambda: gauss.simulate(door(), -1), SimulationError, "duration: expected a positive number"),
    "duration as text": (lambda: gauss.simulate(door(), "2 s"), SimulationError, "expected a positive number, got '2 s'"),
    "loose tolerance": (lambda: gauss.simulate(door(), 1, rtol=10), SimulationError, "rtol: .* below 1, .*got 10"),
    "breaks as text": (lambda: gauss.simulate(door(), 1, breaks="0.5"), SimulationError, "breaks: .*times .s., got '0.5'"),
    "breaks that are no numbers": (
        lambda: gauss.simulate(door(), 1, breaks=[True]),
        SimulationError,
        "breaks: expected times",
    ),
    "times as texts": (lambda: gauss.simulate(door(), 1, times=["0.5"]), SimulationError, r"numbers .s., got \['0.5'\]"),
    "sample that is not there": (lambda: motion().state(1000), StateError, "index of a sample, .*got 1000"),
    "sample by a fraction": (lambda: motion().state(0.5), StateError, "index of a sample, .*got 0.5"),
    "typo in an argument": (lambda: gauss.simulate(door(), 1, intgrator="rk4"), ArgumentError, "mean 'integrator'"),
    "typo in an argument of a drive": (lambda: door().drive("hinge", torqe=1.0), ArgumentError, "mean 'torque'"),
    "typo in an argument of a body": (lambda: door().body("b", 1.0, poition=(0, 0, 1)), ArgumentError, "mean 'position'"),
    "typo in an argument of a shaft": (lambda: rotors.Network("n").shaft("a", inerta=1.0), ArgumentError, "mean 'inertia'"),
    "typo in an argument of a sweep": (swept({}, sample=3), ArgumentError, "mean 'samples'"),
    "unknown integrator": (lambda: gauss.simulate(door(), 1, integrator="rk45"), SimulationError, "Did you mean 'rk4'"),
    "no step": (lambda: gauss.simulate(door(), 1, integrator="rk4"), SimulationError, "give step= .s."),
    "missing solver": (lambda: gauss.simulate(door(), 1, backend="gurobi"), BackendError, "pip install"),
    "times beyond the end": (lambda: gauss.simulate(door(), 1, times=[0, 2]), SimulationError, "between 0 and the duration"),
    "number of times": (lambda: gauss.simulate(door(), 1, times=100), SimulationError, "increasing times"),
    "list for a state": (lambda: gauss.simulate(door(), 1, state=[0.1]), ArgumentError, r"State: system.initial_state\(\)"),
    "text for times": (lambda: gauss.simulate(door(), 1, times="now"), SimulationError, "increasing numbers .s., got 'now'"),
    "text for a crossing": (lambda: gauss.crossings(motion(), lambda x: "a"), SimulationError, "gave 'a'; expected"),
    "check in no states": (
        lambda: gauss.crosscheck(door(), states=0),
        SimulationError,
        "states: expected a positive",
    ),
    "check within nothing": (
        lambda: gauss.crosscheck(door(), tolerance=0.0),
        SimulationError,
        "tolerance: .* positive",
    ),
    "negative seed": (lambda: gauss.crosscheck(door(), seed=-1), SimulationError, "seed: .* not negative"),
    "derivatives in nothing": (lambda: gauss.derivatives(gauss.compile_scene(door()), None), ArgumentError, "a State"),
    "state of another size": (lambda: gauss.compile_scene(door()).state([0, 0]), StateError, "expected 1 finite numbers"),
    "unknown body": (lambda: motion().body("leav"), StateError, "Did you mean 'leaf'"),
    "unknown joint": (lambda: gauss.reactions(motion(), "hing"), StateError, "Did you mean 'hinge'"),
    "scene for a motion": (lambda: gauss.to_dataset(door()), ArgumentError, r"gauss.simulate\(scene, .* returns one"),
    "scene for a system": (lambda: gauss.mobility(door()), ArgumentError, r"gauss.compile_scene\(scene\) makes one"),
    "effort of what is not driven": (lambda: gauss.drive_forces(motion(), "hinge"), StateError, "add a drive"),
    "unknown ending": (lambda: gauss.save(motion(), "motion.mat"), FileError, "written as .npz or .csv"),
    "folder that is not there": (lambda: gauss.save(motion(), "none/motion.npz"), FileError, "there is no folder 'none'"),
    "path and motion swapped": (lambda: gauss.save("motion.npz", motion()), ArgumentError, "got a Trajectory"),
    "name for a scene, swept": (lambda: gauss.sweep("door", {}, 1.0), ArgumentError, r"gauss.load\(name\)"),
    "typo in what is varied": (swept({"leef.mass": [1.0]}), SceneError, "Did you mean 'leaf'"),
    "vector varied as a whole": (swept({"leaf.com": [0.1]}), SceneError, r"leaf.com\[0\] to \[2\], or .x, .y, .z"),
    "every value refused": (swept({"leaf.mass": [-1.0]}), SimulationError, "no member .* mass: expected a non-negative"),
    "sweep into a file": (swept({"leaf.mass": [1.0]}, path="sweep.nc"), FileError, "to_netcdf"),
    "sweep that is not there": (lambda: gauss.load_sweep("sweep.zarr"), FileError, "no such folder"),
}


@pytest.mark.disk  # only the folder is another one
@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gets_one_clear_message(mistake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    make, kind, words = MISTAKES[mistake]
    with pytest.raises(GaussError, match=words) as raised:
        make()
    assert isinstance(raised.value, kind)


@pytest.mark.slow
def test_where_tests_watch_the_types_gauss_does_it_itself():
    """The floors whose annotations are checked while tests run are asked in a process of their own."""
    code = """
import gauss
from gauss import rotors
scene = gauss.load("pendulum")
for function in (gauss.energy, gauss.solve):
    try:
        function(scene)
    except gauss.GaussError as error:
        print(error)
forces = gauss.reactions, gauss.drive_forces, gauss.constraint_forces, gauss.contact_forces
for function in (*forces, gauss.assemble, gauss.Kinematics):
    try:
        function(scene, "A")
    except gauss.GaussError as error:
        print(error)
try:
    gauss.compile_scene(scene).accelerations([0.1])
except gauss.GaussError as error:
    print(error)
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[1])
    said = ran.stdout.splitlines()
    assert len(said) == 9, ran.stderr
    assert all("got a Scene." in line and ("returns one" in line or "makes one" in line) for line in said[:8])
    assert "expected a State, got a list" in said[8]


def test_forty_are_walked_through():
    assert len(MISTAKES) >= 40
