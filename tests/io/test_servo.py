"""Servos in scene files, shipped scenes with servos, and what the command line makes of them."""

import dataclasses

import numpy as np
import pytest

import gauss
from gauss import servo
from gauss.codegen import Function, Graph, Kernel, forward
from gauss.errors import FileError, SceneError
from gauss.io.catalog import servo_files
from gauss.scene.profiles import PROFILES, Move, Polynomial, Ramp, Sine, from_table, to_table
from tests.support.files import call

SHIPPED = ("cable_robot", "crane", "inverted_pendulum", "line_arm", "rod_on_support", "two_mass_tether")
EXAMPLES = [
    Ramp(0.3, -1.2),
    Sine(0.4, 0.7, mean=1.0, phase=0.2),
    Move(-1.0, 2.0, duration=1.5, begin=0.25),
    Polynomial((1.0, 0.0, -2.0, 0.5)),
]


@pytest.mark.parametrize("profile", EXAMPLES, ids=lambda p: p.kind)
def test_profiles_are_the_same_in_numbers_symbols_and_tables(profile):
    graph = Graph()
    t = graph.symbol("t")
    traced = Kernel(Function("profile", [t], [profile(t)]))
    for time in (-0.5, 0.25, 0.9, 1.75, 3.0):
        assert traced([time])[0] == pytest.approx(float(profile(time)), abs=1e-14)
    assert from_table(to_table(profile)) == profile
    assert {kind.__name__.lower() for kind in map(type, EXAMPLES)} == set(PROFILES)


def test_a_move_is_four_times_smooth():
    """Position and four derivatives are those of rest at both ends."""
    graph = Graph()
    t = graph.symbol("t")
    chain = [Move(1.0, 3.0, duration=2.0, begin=1.0)(t)]
    for _ in range(4):
        chain.append(forward([chain[-1]], [t], [1.0])[0])
    kernel = Kernel(Function("move", [t], chain))
    for time, value in ((1.0, 1.0), (1.0 + 1e-4, 1.0), (3.0 - 1e-4, 3.0), (3.0, 3.0), (9.0, 3.0)):
        assert kernel([time]) == pytest.approx([value, 0, 0, 0, 0], abs=0.5)  # the fourth grows by 945 per second
    assert kernel([2.0])[:2] == pytest.approx([2.0, 2.0 / 2.0 * 315 / 128], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_servos_hold_what_they_say(name):
    held = gauss.load(f"servo/{name}")
    assert servo.realisable(held)
    run = servo.simulate(held, 2.5, times=np.linspace(0, 2.5, 11), rtol=1e-10, atol=1e-12, progress=False)
    assert np.abs(run.residuals).max() <= 1e-12
    found = servo.energy(run)
    assert np.abs(found.balance).max() <= 1e-8 * found.scale
    assert run.motion.stats.worst_error <= 1e-9
    assert run.motion.stats.plan.dynamics == "compiled" and run.motion.stats.handed_over is None


def test_rod_on_a_support_by_its_closed_form():
    """A uniform rod kept inclined: the support accelerates with g tan θ."""
    run = servo.simulate(gauss.load("servo/rod_on_support"), 1.0, progress=False)
    assert run.motion.coordinate("track")[-1] == pytest.approx(9.81 * np.tan(0.15) / 2, rel=1e-9)


@pytest.mark.slow
def test_the_same_table_is_a_contact_or_a_servo(tmp_path):
    """[[prescribed]] is kept by whatever force that takes; [[servo.prescribed]] by the actuators alone."""
    text = servo_files()["servo/inverted_pendulum"].read_text()
    contact = text[: text.index("[[servo.motor]]")].replace("[[servo.prescribed]]", "[[prescribed]]")
    (tmp_path / "contact.toml").write_text(contact)
    scene = gauss.load(tmp_path / "contact.toml")
    assert isinstance(scene, gauss.Scene)
    again = gauss.load(gauss.save(scene, tmp_path / "again.toml"))
    assert again == scene
    ideal = gauss.simulate(scene, 1.0, progress=False)
    driven = servo.simulate(gauss.load("servo/inverted_pendulum"), 1.0, progress=False)
    assert ideal.coordinate("pin")[-1] == pytest.approx(driven.motion.coordinate("pin")[-1], abs=1e-7)
    assert abs(ideal.coordinate("rail")[-1] - driven.motion.coordinate("rail")[-1]) > 0.1


BASE = """
[[body]]
name = "cart"
mass = 1.0
[[joint]]
name = "rail"
type = "prismatic"
parent = "ground"
child = "cart"
"""
MISTAKES = {
    "unknown table": ('[[servo.moter]]\nname = "m"', "unknown table 'moter'. Did you mean 'motor'"),
    "unknown key": ('[[servo.motor]]\nname = "m"\nkoordinate = "rail"', "unknown key 'koordinate'.*'coordinate'"),
    "no relation": ('[[servo.motor]]\nname = "m"\ncoordinate = "rail"', "at least one relation"),
    "unknown joint": (
        '[[servo.prescribed]]\nname = "p"\njoint = "rial"\nposition = 0.0',
        "no joint 'rial'. Did you mean 'rail'",
    ),
    "unknown coordinate": (
        '[[servo.motor]]\nname = "m"\ncoordinate = "x"\n[[servo.prescribed]]\njoint = "rail"\nposition = 0.0',
        "no coordinate 'x'",
    ),
    "unknown profile": (
        '[[servo.prescribed]]\njoint = "rail"\nposition = { profile = "sinus", amplitude = 1 }',
        "no profile 'sinus'. Did you mean 'sine'",
    ),
    "profile without a field": (
        '[[servo.prescribed]]\njoint = "rail"\nposition = { profile = "sine", amplitude = 1 }',
        "frequency",
    ),
    "negative duration": (
        '[[servo.prescribed]]\njoint = "rail"\nposition = { profile = "move", start = 0, end = 1, duration = -1 }',
        "duration: expected a positive",
    ),
    "unknown field of a profile": (
        '[[servo.prescribed]]\njoint = "rail"\nposition = { profile = "ramp", sped = 1 }',
        "unknown key 'sped'.*'speed'",
    ),
    "code in a law": ('[[servo.prescribed]]\njoint = "rail"\nposition = "lambda t: t"', "rail"),
    "weights as a list": (
        '[[servo.weights]]\nm = 1.0\n[[servo.prescribed]]\njoint = "rail"\nposition = 0.0',
        r"\[servo.weights\] with single brackets",
    ),
    "weight of nothing": (
        '[servo.weights]\nm = 1.0\n[[servo.prescribed]]\njoint = "rail"\nposition = 0.0',
        "no effort 'm'",
    ),
    "not a table": ("servo = 3", "write tables below it"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_files_are_refused_with_the_place(mistake, tmp_path):
    text, words = MISTAKES[mistake]
    path = tmp_path / "scene.toml"
    path.write_text(text + BASE if text == "servo = 3" else BASE + text)
    with pytest.raises(FileError, match=words) as caught:
        gauss.load(path)
    assert str(path) in str(caught.value)


def test_profiles_are_frozen_and_checked():
    with pytest.raises(SceneError, match="amplitude"):
        Sine("large", 1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        EXAMPLES[0].speed = 2.0


@pytest.mark.slow
def test_command_line_runs_servos(tmp_path):
    motion, figure = tmp_path / "motion.npz", tmp_path / "figure.png"
    arguments = ("run", "servo/crane", "--duration", 4, "--samples", 21, "--output", motion, "--plot", figure, "--check")
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert "relative degree" in result.output or "index reduction" in result.output
    assert "effort 'rope tension'" in result.output and "agreement" in result.output
    archive = np.load(motion)
    assert list(archive["effort_names"]) == ["trolley force", "rope tension"]
    assert archive["efforts"].shape == archive["effort_work"].shape == archive["gaps"].shape == (21, 2)
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_command_line_draws_what_was_reached_before_the_hold_was_lost(tmp_path):
    text = servo_files()["servo/inverted_pendulum"].read_text()
    text = text.replace('profile = "sine", amplitude = 0.3, frequency = 0.4', 'profile = "ramp", speed = 1.0')
    path, figure = tmp_path / "falls.toml", tmp_path / "figure.png"
    path.write_text(text)
    result = call("run", path, "--duration", 4, "--plot", figure)
    assert isinstance(result.exception, servo.UnrealisableError) and "lose their hold" in str(result.exception)
    assert figure.exists() and "hold" in result.output


@pytest.mark.slow
def test_command_line_explains_and_lists_servos():
    assert "index reduction" in call("explain", "servo/crane").output
    listed = call("models").output
    assert all(f"servo/{name}" in listed for name in SHIPPED)
    started = call("run", "servo/line_arm", "--duration", 0.1, "--start", "shoulder=-1.2", "--speed", "shoulder=0.1")
    assert started.exit_code == 0, started.output
    assert isinstance(call("run", "servo/crane", "--backend", "kkt").exception, FileError)
