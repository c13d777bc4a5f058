"""Files that somebody broke, or meant to break something: every one is read, or refused with the name of the file."""

import importlib.util
import warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gauss
from gauss.errors import FileError, GaussError
from tests.support.files import quietly

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
WHOLE = {
    ".urdf": f"""<robot name="r">
<link name="base"/>
<link name="arm">{INERTIAL}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 1" rpy="0 0.5 0"/><axis xyz="0 0 1"/><limit effort="1" velocity="1" lower="-1" upper="1"/></joint>
</robot>""",
    ".sdf": """<sdf version="1.10"><model name="m">
<link name="arm"><pose>0 0 1 0 0.5 0</pose>
<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>world</parent><child>arm</child>
<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
</model></sdf>""",
    ".xml": """<mujoco><compiler angle="radian"/>
<worldbody><body name="arm" pos="0 0 1" euler="0 0.5 0">
<joint name="j" axis="0 0 1" range="-1 1" damping="0.1"/>
<geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/></body></worldbody>
<actuator><position joint="j" kp="3"/></actuator></mujoco>""",
    ".toml": """name = "arm"
[[body]]
name = "arm"
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[[joint]]
name = "j"
type = "revolute"
parent = "ground"
child = "arm"
at = [0.0, 0.0, 1.0]""",
}
NEEDS = {".xml": "mujoco"}
ODD = [
    "nan",
    "inf",
    "-1e308",
    "1e19",
    "1e999",
    "-0",
    "",
    "0x10",
    "\u0661",
    "9" * 400,
    "&a;",
    "<",
    "\x00",
    "../../etc",
    "true",
]
BROKEN = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def read(folder, ending: str, content: bytes):
    """Scene and system of a file, or None where it is refused; anything but an error of gauss fails the test."""
    path = folder / f"model{ending}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return gauss.compile_scene(gauss.load(path))
        except GaussError as error:
            assert str(error)
            return None


@pytest.fixture(params=WHOLE)
def ending(request):
    needed = NEEDS.get(request.param)
    if needed and importlib.util.find_spec(needed) is None:
        pytest.skip(f"{request.param} is read by {needed}")
    return request.param


def test_whole_files_are_read(ending, tmp_path):
    assert read(tmp_path, ending, WHOLE[ending].encode()).n_v == 1


@pytest.mark.slow
@BROKEN
@given(data=st.data())
def test_a_value_that_somebody_changed(ending, tmp_path, data):
    pieces = WHOLE[ending].replace("=", "= ").replace('"', ' " ').replace(">", "> ").replace("<", " <").split(" ")
    numbers = [k for k, piece in enumerate(pieces) if piece[:1].isdigit() or piece[:1] == "-"]
    pieces[data.draw(st.sampled_from(numbers))] = data.draw(st.sampled_from(ODD) | st.text(max_size=6))
    read(tmp_path, ending, " ".join(pieces).encode("utf-8", "surrogatepass"))


@pytest.mark.slow
@BROKEN
@given(data=st.data())
def test_lines_that_are_lost_doubled_or_swapped(ending, tmp_path, data):
    lines = WHOLE[ending].splitlines()
    order = data.draw(st.lists(st.integers(0, len(lines) - 1), max_size=2 * len(lines)))
    read(tmp_path, ending, "\n".join(lines[k] for k in order).encode())


@pytest.mark.slow
@BROKEN
@given(data=st.data())
def test_bytes_that_are_cut_off_or_put_in(ending, tmp_path, data):
    content = WHOLE[ending].encode()
    begin = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(begin, min(len(content), begin + 20)))
    read(tmp_path, ending, content[:begin] + data.draw(st.binary(max_size=8)) + content[end:])


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><{0} name="&b;"/>'
ROOTS = {".urdf": "robot", ".sdf": "sdf", ".xml": "mujoco"}
HOSTILE = {
    "entities": (lambda root: BOMB.format(root).encode(), "entities"),
    "entities in another encoding": (
        lambda root: f'<?xml version="1.0" encoding="utf-16"?>{BOMB.format(root)}'.encode("utf-16"),
        "entities",
    ),
    "nesting": (lambda root: f"<{root}>".encode() + b"<link>" * 100_000, "nested more than"),
    "size": (lambda root: f"<{root}/>".encode() + b" " * 21_000_000, "larger than"),
    "numbers": (lambda root: f'<{root}><link mass="1e999"/></{root}>'.encode(), "holds 1e999"),
    "another format": (lambda root: b"<html/>", "expected <.*>, got <html>"),
    "no text": (lambda root: bytes(range(256)), "not XML"),
}


@pytest.mark.parametrize("what", HOSTILE)
@pytest.mark.parametrize("ending", ROOTS)
def test_hostile_files_are_refused_whatever_the_format(tmp_path, ending, what):
    content, words = HOSTILE[what]
    path = tmp_path / f"model{ending}"
    path.write_bytes(content(ROOTS[ending]))
    with pytest.raises(FileError, match=words):
        gauss.load(path)


@pytest.mark.parametrize("depth, opened", [(496, True), (497, False)])
def test_files_of_mujoco_are_as_deep_as_its_own_parser_takes(tmp_path, depth, opened):
    path = tmp_path / "model.xml"
    body = '<body><joint/><geom size="0.1"/></body>'
    path.write_text(f"<mujoco><worldbody>{'<frame>' * (depth - 1)}{body}{'</frame>' * (depth - 1)}</worldbody></mujoco>")
    if opened:
        assert len(quietly(path).bodies) == 1
    else:
        with pytest.raises(FileError, match="nested more than"):
            gauss.load(path)


@pytest.mark.parametrize("named", ["/etc/passwd", "file:///etc/passwd", "../../../etc/passwd", "package://../../etc/passwd"])
def test_meshes_elsewhere_are_not_opened(tmp_path, named):
    from gauss.io.visuals import read_visuals

    path = tmp_path / "model.urdf"
    mesh = f'<visual><geometry><mesh filename="{named}"/></geometry></visual>'
    path.write_text(WHOLE[".urdf"].replace('<link name="arm">', f'<link name="arm">{mesh}'))
    with pytest.raises(FileError, match="model.urdf:3: names the file .* outside its own"):
        read_visuals(path)
