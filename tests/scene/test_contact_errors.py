"""Mistakes in unilateral constraints: each is refused with its name and the expectation."""

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, SceneError, SimulationError, StateError
from tests.support.contacts import touching, two_loose_bodies

pytestmark = pytest.mark.slow

MISTAKES = {
    "restitution above one": (lambda s: s.stop("S", highest=1.0, restitution=1.5), SceneError, "0 to 1, got 1.5"),
    "no stop": (lambda s: s.stop("S"), SceneError, "lowest=, highest= or both"),
    "stops the wrong way": (lambda s: s.stop("S", 1.0, -1.0), SceneError, "must be below"),
    "unknown joint": (lambda s: s.stop("T", 1.0), SceneError, "no joint 'T'"),
    "stop of a free joint": (lambda s: s.stop("A", 1.0), SceneError, "6 freedoms"),
    "two points": (
        lambda s: (
            s.points("p", "a", [(0, 0, 0)]),
            s.points("q", "b", [(0, 0, 1)]),
            s.contact("c", "p", "q"),
            gauss.compile_scene(s),
        ),
        SceneError,
        "two points never touch",
    ),
    "no points": (lambda s: s.points("p", "a", []), SceneError, "list of points"),
    "flat box": (lambda s: s.box("b", "a", (1, 0, 1)), SceneError, "three edges > 0"),
    "no radius": (lambda s: s.sphere("b", "a", 0), SceneError, "radius.*positive"),
    "no such shape": (
        lambda s: (s.sphere("ball", "a", 1), s.contact("c", "ball", "bal")),
        SceneError,
        "no shape 'bal'.*ball",
    ),
    "no such body": (lambda s: s.sphere("ball", "c", 1), SceneError, "no body or frame 'c'"),
    "one shape": (lambda s: (s.sphere("ball", "a", 1), s.contact("c", "ball", "ball")), SceneError, "name two"),
    "no rule": (
        lambda s: touching("half-space", "half-space")(s),
        SceneError,
        "two half-spaces meet almost everywhere",
    ),
    "gap of two numbers": (
        lambda s: (s.one_sided("c", lambda at: at.position("a")), gauss.compile_scene(s)),
        SceneError,
        "one number",
    ),
    "gap of nothing": (
        lambda s: (s.one_sided("c", lambda at: at.t), gauss.compile_scene(s)),
        SceneError,
        "depends on no body",
    ),
    "name taken": (lambda s: (s.stop("S", 1.0, name="x"), s.rope("x", "a", "b", length=1)), SceneError, "'x'.*taken"),
    "no such contact": (
        lambda s: gauss.contact_forces(gauss.simulate(s, 0.01, progress=False), "flor"),
        StateError,
        "no unilateral constraint 'flor'",
    ),
    "start inside": (
        lambda s: (s.stop("S", 0.1, name="x"), gauss.simulate(s, 0.1)),
        SimulationError,
        "0.1 .*inside of 'x.lowest'",
    ),
    "fixed step": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, integrator="rk4", step=0.1)),
        SimulationError,
        "events",
    ),
    "inverse dynamics of what is closed": (
        lambda s: (
            s.stop("S", 0.0, name="x"),
            gauss.inverse_dynamics(system := gauss.compile_scene(s), system.initial_state(), np.zeros(13), ["S"]),
        ),
        StateError,
        "forces are unknown",
    ),
    "Baumgarte": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, stabilisation="baumgarte")),
        SimulationError,
        "'baumgarte'.*are projected",
    ),
    "implicit": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, integrator="radau5")),
        SimulationError,
        "'radau5' does not locate the events",
    ),
    "many at once": (
        lambda s: (
            s.stop("S", -0.1),
            gauss.rollout(system := gauss.compile_scene(s), [system.reference.q], np.zeros((1, 13)), steps=1, step=0.1),
        ),
        SimulationError,
        "is unilateral",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make(two_loose_bodies())


def test_contacts_are_explained_and_refused_where_they_have_no_counterpart(tmp_path):
    scene = gauss.load("box_on_plane_8")
    assert "stand (8 gap" in gauss.compile_scene(scene).explain()
    with pytest.raises(FileError, match="'feet': MuJoCo has no points"):
        gauss.save(gauss.load("box_on_plane_4"), tmp_path / "box.xml")
    comparison = gauss.crosscheck(scene)
    assert comparison.passed and "stand" in str(comparison)
