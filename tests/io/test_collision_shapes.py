"""Cylinders, ellipsoids, cones and meshes of MJCF, URDF and SDF files as shapes of contact."""

import warnings

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.errors import FileError, NotImportedWarning

FLOAT32 = 1e-7  # [m] MuJoCo keeps vertices of meshes in single precision
ROUNDING = 1e-12
CORNERS = ((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.4))
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
INERTIA = "<mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
SIZES = {
    "sphere": ("<radius>.1</radius>", "Sphere"),
    "box": ("<size>.1 .2 .3</size>", "Box"),
    "cylinder": ("<radius>.1</radius><length>.3</length>", "Cylinder"),
    "capsule": ("<radius>.1</radius><length>.3</length>", "Capsule"),
    "cone": ("<radius>.1</radius><length>.3</length>", "Cone"),
    "ellipsoid": ("<radii>.1 .2 .3</radii>", "Ellipsoid"),
    "mesh": ("<uri>rock.obj</uri><scale>2 2 2</scale>", "ConvexMesh"),
}


def extent(shape) -> np.ndarray:
    """Corners of a shape, sorted."""
    return np.array(sorted(shape.corners.round(9).tolist()))


def test_solids_come_back_from_mujoco(tmp_path):
    scene = gauss.Scene("solids")
    scene.half_space("floor")
    for k, name in enumerate("abc"):
        free_body(scene, name, 0.1, (float(k), 0.0, 1.0))
    scene.cylinder("can", "a", 0.1, 0.3, at=(0.1, 0, 0), axis=(1, 2, 0))
    scene.ellipsoid("egg", "b", (0.1, 0.2, 0.3), rotation=(0.1, 0.2, 0.3))
    scene.mesh("rock", "c", CORNERS, at=(0.0, 0.1, 0.0), rotation=(0.3, 0.0, 0.1))
    scene.contacts_all(friction=0.5)
    back = gauss.load(gauss.save(scene, tmp_path / "solids.xml"), contacts=True)
    assert len(back.contacts) == len(scene.contacts)
    for name in ("can", "egg", "rock"):
        assert type(back.shapes[name]) is type(scene.shapes[name])
        assert extent(back.shapes[name]) == pytest.approx(extent(scene.shapes[name]), abs=FLOAT32)
    again = gauss.load(gauss.save(scene, tmp_path / "solids.toml"))
    assert again.shapes["rock"] == scene.shapes["rock"]


def test_what_mujoco_has_not_is_refused_by_name(tmp_path):
    scene = gauss.Scene("cone")
    scene.half_space("floor")
    free_body(scene, "a", 0.1, (0.0, 0.0, 1.0))
    scene.cone("hat", "a", 0.1, 0.3)
    scene.contacts_all()
    with pytest.raises(FileError, match="hat"):
        gauss.save(scene, tmp_path / "cone.xml")


def test_collisions_of_urdf(tmp_path):
    (tmp_path / "rock.obj").write_text(OBJ)
    (tmp_path / "robot.urdf").write_text("""<robot name="r"><link name="base"><inertial><mass value="1"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin xyz="0 0 1" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>
      <collision><geometry><mesh filename="rock.obj" scale="2 2 2"/></geometry></collision>
      <collision><geometry><mesh filename="gone.obj"/></geometry></collision></link></robot>""")
    with pytest.warns(NotImportedWarning, match=r"base\.3 \(mesh\)"):
        scene = gauss.load(tmp_path / "robot.urdf", collisions=True, root="free")
    can, rock = scene.shapes["base"], scene.shapes["base.2"]
    assert (can.radius, can.length) == (0.1, 0.4)
    assert can.axes[:, 2] == pytest.approx((1, 0, 0), abs=ROUNDING)
    assert extent(rock) == pytest.approx(np.array(sorted((2 * np.array(CORNERS)).tolist())), abs=FLOAT32)


@pytest.mark.parametrize("kind", SIZES)
def test_collisions_of_sdf(tmp_path, kind):
    (tmp_path / "rock.obj").write_text(OBJ)
    sizes, name = SIZES[kind]
    (tmp_path / "world.sdf").write_text(f"""<sdf version="1.9"><world name="w">
      <model name="g"><static>true</static><link name="l"><collision name="c"><geometry><plane><normal>0 0 1</normal></plane>
      </geometry></collision></link></model>
      <model name="m"><pose>0 0 2 0 0 0</pose><link name="b"><inertial>{INERTIA}</inertial>
      <collision name="c"><pose>0 0 .1 0 0 0</pose><geometry><{kind}>{sizes}</{kind}></geometry></collision></link></model>
      </world></sdf>""")
    with warnings.catch_warnings():
        warnings.simplefilter("error", NotImportedWarning)
        scene = gauss.load(tmp_path / "world.sdf", collisions=True)
    assert {type(shape).__name__ for shape in scene.shapes.values()} == {"HalfSpace", name}
    assert len(scene.contacts_all()) == 1
    assert scene.shapes["m::b.c"].at == (0.0, 0.0, 0.1)
