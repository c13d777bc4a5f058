"""Robots of other packages: files of robot_descriptions that are on disk, xacro where it is trusted."""

import sys
from types import ModuleType

import pytest

import gauss
from gauss.errors import FileError, MissingPackageError

URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint></robot>"""
CACHE = """class Repository:
    cache_path = "folder"
REPOSITORIES = {"one": Repository, "two": Repository}
def clone_to_cache(name, commit=None):
    raise AssertionError("nothing is fetched")
"""
ROBOT = """from os import path
from ._cache import clone_to_cache
ROOT = clone_to_cache("one", commit=None)
URDF_PATH = path.join(ROOT, "r.urdf")
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of descriptions, and the folder of its cache, which is empty."""
    folder = tmp_path / "site" / "robot_descriptions"
    folder.mkdir(parents=True)
    for name, text in (("__init__", ""), ("_cache", CACHE), ("arm_description", ROBOT)):
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    before = {name: sys.modules.pop(name) for name in list(sys.modules) if name.startswith("robot_descriptions")}
    yield tmp_path / "cache" / "folder"
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        del sys.modules[name]
    sys.modules.update(before)


@pytest.mark.parametrize("name", ["arm", "arm_description"])
def test_descriptions_on_disk_are_read(package, name):
    package.mkdir(parents=True)
    (package / "r.urdf").write_text(URDF)
    assert list(gauss.load(f"description:{name}").joints) == ["j"]
    assert len(gauss.load(f"description:{name}", root="free").joints) == 2


def test_nothing_is_fetched(package):
    with pytest.raises(FileError, match="not on disk.*robot_descriptions pull arm_description"):
        gauss.load("description:arm")
    with pytest.raises(FileError, match="Did you mean 'arm_description'"):
        gauss.load("description:armm")


def test_the_extra_is_named(monkeypatch):
    for name in ("robot_descriptions", "xacro"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingPackageError, match="extra 'descriptions'"):
        gauss.load("description:arm")
    with pytest.raises(MissingPackageError, match="extra 'xacro'"):
        gauss.load("robot.urdf.xacro", xacro=True)


class Expanded:
    """Document that xacro makes."""

    def __init__(self, text: str):
        self.text = text

    def toxml(self) -> str:
        """Text of the document."""
        return self.text


@pytest.fixture
def expands(monkeypatch):
    """Package xacro whose files expand to URDF; the mappings that it was called with."""
    called, module = [], ModuleType("xacro")

    def process_file(path, mappings):
        called.append(mappings)
        if "bad" in path:
            raise ValueError("no macro")
        return Expanded(URDF.replace("base", mappings.get("prefix", "") + "base").replace("1", mappings.get("mass", "1")))

    module.process_file = process_file
    monkeypatch.setitem(sys.modules, "xacro", module)
    return called


def test_xacro_is_evaluated_where_it_is_trusted(expands, tmp_path):
    with pytest.raises(FileError, match="a program.*xacro=True"):
        gauss.load(tmp_path / "robot.urdf.xacro")
    assert not expands
    assert list(gauss.load(tmp_path / "robot.urdf.xacro", xacro=True).joints) == ["j"]
    scene = gauss.load(tmp_path / "robot.urdf.xacro", xacro={"prefix": "my_", "mass": 2}, root="free")
    assert scene.bodies["my_base"].mass == 0 and scene.bodies["arm"].mass == 2 and len(expands) == 2


def test_what_xacro_refuses_or_makes_is_told(expands, tmp_path):
    with pytest.raises(FileError, match="bad.xacro: xacro cannot expand it: ValueError: no macro"):
        gauss.load(tmp_path / "bad.xacro", xacro=True)
    with pytest.raises(FileError, match=r"robot.xacro, expanded: robot.urdf:1: <mass>"):
        gauss.load(tmp_path / "robot.xacro", xacro={"mass": "heavy"})
