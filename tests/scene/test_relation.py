"""Constraints beyond the joints: mistakes are refused by name, files keep what they can hold."""

import numpy as np
import pytest

import gauss
from gauss.errors import SceneError
from tests.support.mechanisms import three_bodies

MISTAKES = {
    "to itself": (lambda s: s.distance("d", "a", "a"), "both ends are on 'a'"),
    "no body": (lambda s: s.distance("d", "a", "bb"), "no body or frame 'bb'.*Did you mean 'b'"),
    "name taken": (lambda s: s.distance("C", "a", "b"), "taken"),
    "length": (lambda s: s.distance("d", "a", "b", length=0.0), "must be positive"),
    "law": (lambda s: s.distance("d", "a", "b", length=lambda t: [t, t]), "must return 1 number"),
    "curve": (lambda s: s.on_curve("c", "a", "b", curve=(1, 2)), "must be a function of a point"),
    "teeth": (lambda s: s.gear("g", "a", "b", (12, 0)), "teeth must be positive"),
    "ring": (lambda s: s.gear("g", "a", "b", (12, 12), internal=True), "differ inside a ring"),
    "crown": (lambda s: s.rolling("r", "a", "b", 0.1, crown=0.2), "larger than the radius"),
    "small bowl": (lambda s: s.rolling("r", "a", "b", 0.1, on_radius=-0.05), "bowl that is larger"),
    "radius": (lambda s: s.rolling("r", "a", "b", -0.1), "positive"),
    "profile": (lambda s: s.cam("c", "C.angle1", "S", profile=3), "function or a spline"),
    "cam of many": (lambda s: s.cam("c", "C", "S", np.sin), "C.angle1, C.angle2"),
    "belt": (lambda s: s.belt("b", "S", "S", (1, -1)), "radii must be positive"),
    "nothing to meet": (lambda s: s.constrain("c"), "give position= or velocity="),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_are_refused(case):
    make, words = MISTAKES[case]
    scene, before = three_bodies(), three_bodies()
    with pytest.raises(SceneError, match=words):
        make(scene)
    assert scene == before


UNBUILDABLE = {
    "an if": (lambda s: s.constrain("c", lambda at: 1.0 if at.t > 0 else 0.0), "cannot be traced.*gauss.math"),
    "a velocity asked for": (lambda s: s.constrain("c", lambda at: at.velocity("a")), "give it as velocity="),
    "nothing bound": (lambda s: s.constrain("c", lambda at: at.t), "depends on no body and no joint"),
    "a body that is not": (lambda s: s.constrain("c", lambda at: at.position("x")), "no body or frame 'x'"),
    "no reference distance": (lambda s: s.distance("c", "slider", "ground"), "coincide at the reference"),
    "parallel": (lambda s: s.angle("c", "slider", "ground"), "parallel"),
    "one axis": (lambda s: s.gear("c", "slider", "ground", (1, 2)), "one axis"),
    "skew axes": (lambda s: s.gear("c", "a", "b", (1, 2), other_axis=(1, 0, 0)), "must intersect"),
}


@pytest.mark.parametrize("case", UNBUILDABLE)
def test_constraints_that_mean_nothing_are_refused(case):
    make, words = UNBUILDABLE[case]
    scene = three_bodies()
    make(scene)
    with pytest.raises(gauss.GaussError, match=words):
        gauss.compile_scene(scene)


def test_constraints_are_kept_in_files(tmp_path):
    scene = three_bodies()
    scene.distance("rod", "a", "tip", at=(0.3, -0.2, 0.5), other_at=(-0.4, 0.1, 0.2))
    scene.gear("mesh", "a", "b", (12, 30), internal=True)
    scene.rolling("contact", "c", "ground", 0.3, crown=0.1, axis=(1, 0, 0))
    scene.angle("square", "a", "b", angle=0.5)
    again = gauss.load(gauss.save(scene, tmp_path / "scene.toml"))
    assert again.relations == scene.relations
    scene.constrain("own", lambda at: at.coordinate("S"))
    with pytest.raises(gauss.GaussError, match="'own' is written in Python functions"):
        gauss.save(scene, tmp_path / "own.toml")
