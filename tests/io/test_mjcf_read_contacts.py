"""Contacts and stops read from MJCF files: distances of MuJoCo, which geoms may touch, and what is said of the rest."""

import warnings

import mujoco
import numpy as np
import pytest

import gauss
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError, NotImportedWarning
from tests.support.files import quietly

GEOMS = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1" friction="0.3 0 0"/>
  <body name="one" pos="0 0 2"><freejoint name="moves one"/>
    <geom name="box" type="box" size="0.3 0.2 0.1" pos="0.1 0 0" euler="10 20 30" mass="1" friction="0.5 0 0"/>
    <geom name="rod" type="capsule" size="0.05 0.4" pos="0 0.3 0" euler="90 0 0" mass="1" condim="1"/></body>
  <body name="two" pos="0 0 4"><freejoint name="moves two"/>
    <geom name="ball" type="sphere" size="0.2" mass="1"/>
    <geom name="tile" type="box" size="0.2 0.2 0.05" pos="0 0 0.5" mass="1" priority="1" friction="0.1 0 0"/>
    <body name="tail"><joint name="hinge" axis="0 1 0" limited="true" range="-30 40"/>
      <geom name="whip" type="capsule" size="0.04" fromto="0.4 0 0 0.9 0 0" mass="1"/>
      <geom name="drum" type="cylinder" size="0.1 0.1" pos="1 0 0" mass="1"/></body></body>
</worldbody></mujoco>"""
ACROSS = [("box", "tile"), ("rod", "ball"), ("box", "whip"), ("rod", "tile"), ("rod", "whip"), ("box", "ball")]
SEARCHED = 1e-5  # m: distances of MuJoCo's iteration for convex shapes


@pytest.fixture
def path(tmp_path):
    """Path of the file."""
    file = tmp_path / "geoms.xml"
    file.write_text(GEOMS)
    return file


def test_what_may_touch_is_what_mujoco_lets_touch(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error", NotImportedWarning)
        scene = gauss.load(path, contacts=True, limits="stops")
    pairs = {frozenset(name.split(" on ")) for name in scene.contacts if " on " in name}
    moving = [frozenset((a, b)) for a in ("box", "rod") for b in ("ball", "tile", "whip", "drum")]
    grounded = [frozenset(("floor", name)) for name in ("box", "rod", "ball", "tile", "whip", "drum")]
    assert pairs == {*moving, *grounded}  # not of one body, nor of a body and its parent
    friction = {frozenset(name.split(" on ")): getattr(contact, "friction", 0.0) for name, contact in scene.contacts.items()}
    assert friction[frozenset(("floor", "box"))] == 0.5  # the larger
    assert friction[frozenset(("floor", "tile"))] == 0.1  # of the higher priority
    assert friction[frozenset(("rod", "ball"))] == 1.0  # condim 3 of one is enough
    stop = scene.contacts["stop of hinge"]
    assert np.rad2deg([stop.lowest, stop.highest]) == pytest.approx([-30, 40])


@pytest.mark.slow
@pytest.mark.peer
def test_gaps_are_the_distances_of_mujoco(path):
    scene = quietly(path, contacts=True)
    for name in [name for name in scene.contacts if "drum" in name]:  # its distances are no closed forms
        del scene.contacts[name]
    system, model = gauss.compile_scene(scene), mujoco.MjModel.from_xml_path(str(path))
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    names = [name for name, contact in scene.contacts.items() for _ in contact.sides(scene)]
    looked = 0
    for _ in range(30):
        mujoco.mj_resetData(model, data)
        data.qpos[:] += rng.normal(size=model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        q = np.concatenate([data.qpos[:3] - [0, 0, 2], data.qpos[3:7], data.qpos[7:10] - [0, 0, 4], data.qpos[10:]])
        width = gaps(kinematics(system, system.state(q))).width
        for pair in ACROSS:
            name = next(name for name in scene.contacts if set(name.split(" on ")) == set(pair))
            ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom) for geom in pair]
            distance = mujoco.mj_geomDistance(model, data, *ids, 10.0, None)
            if distance > 0.0:
                looked += 1
                least = min(w for w, owner in zip(width, names, strict=True) if owner == name)
                assert least == pytest.approx(distance, abs=SEARCHED)
    assert looked > 100


@pytest.mark.slow
def test_a_box_dropped_from_a_file_comes_to_rest_on_its_face(tmp_path):
    file = tmp_path / "box.xml"
    file.write_text("""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
      <body name="box" pos="0 0 0.15"><freejoint name="moves"/>
      <geom name="sides" type="box" size="0.2 0.2 0.1" mass="2"/></body>
    </worldbody></mujoco>""")
    scene = quietly(file, contacts=True)
    motion = gauss.simulate(scene, 0.3, integrator="time_stepping", step=1e-3, progress=False)
    assert motion.body("box").position[-1, 2] == pytest.approx(0.1, abs=1e-9)


def test_mistakes_are_named(path):
    with pytest.raises(FileError, match="limits: expected 'start' or 'stops'"):
        gauss.load(path, limits="stop")
    with pytest.raises(FileError, match="unknown option 'contact'"):
        gauss.load(path, contact=True)
