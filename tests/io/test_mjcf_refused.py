"""What a MJCF file holds that is not modelled, or is hostile: refused by name, with file and line."""

import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning


def _file(folder, bodies, rest="", head=""):
    path = folder / "model.xml"
    path.write_text(f"<mujoco>{head}\n<worldbody>\n{bodies}\n</worldbody>\n{rest}\n</mujoco>")
    return path


HINGE = '<body name="a"><joint name="h" {}/><geom size="0.1" pos="0.1 0 0"/><site name="s"/></body>'
TWO = HINGE.format("") + '<body name="b"><joint name="k"/><geom size="0.1" pos="0.1 0 0"/><site name="r"/></body>'
BALL = '<body name="a"><joint name="B" type="ball" {}/><geom size="0.1"/></body>'
UNSUPPORTED = {  # bodies, the rest of the file, what the message says, and the line
    "activation of the user": (
        TWO,
        '<actuator>\n<general name="m" joint="h" dyntype="user" actdim="1"/></actuator>',
        "actuator 'm': its activation",
        6,
    ),
    "a turned free joint with friction": (
        '<body name="a" euler="10 0 0"><joint name="F" type="free" frictionloss="1"/><geom size="0.1"/></body>',
        "",
        "frictionloss.* of free joint 'F'",
        3,
    ),
    "a range that a joint shares among actuators": (
        HINGE.format('actuatorfrcrange="-1 1"'),
        '<actuator><motor name="m" joint="h"/><position joint="h"/></actuator>',
        "'m'.*limits the sum of its actuators",
        5,
    ),
    "a tendon of a joint that is limited": (
        HINGE.format('actuatorfrcrange="-1 1"'),
        '<tendon><fixed name="t"><joint joint="h" coef="2"/></fixed></tendon>'
        '<actuator><motor name="m" tendon="t"/></actuator>',
        "'m'.*a joint that it moves limits the sum",
        5,
    ),
    "gravity compensation by actuators that are none": (
        '<body name="a" gravcomp="1"><joint name="h" actuatorgravcomp="true"/><geom size="0.1" pos="0.1 0 0"/></body>',
        "",
        "actuatorgravcomp. of joint 'h'",
        0,
    ),
    "a crank": (
        HINGE.format(""),
        '<actuator><general name="m" cranksite="s" slidersite="s" cranklength="1"/></actuator>',
        "'m'.*only actuators",
        5,
    ),
    "a servo of a ball": (
        BALL.format(""),
        '<actuator><position name="m" joint="B" kp="2"/></actuator>',
        "'m'.*several freedoms",
        5,
    ),
    "a curved spring": (HINGE.format('stiffness="1 2 0"'), "", "stiffness of joint 'h' beyond a constant", 3),
    "a force that follows the motion": (
        HINGE.format(""),
        '<actuator><position name="m" site="s" refsite="s" gear="1 0 0 0 0 0"/></actuator>',
        "'m'.*only actuators",
        5,
    ),
}


@pytest.mark.parametrize("name", UNSUPPORTED)
def test_what_is_not_modelled_is_refused_by_name_and_line(tmp_path, name):
    bodies, rest, words, line = UNSUPPORTED[name]
    with pytest.raises(FileError, match=rf"not modelled: .*{words}" + rf".* \(.*model.xml:{line}\)" * bool(line)):
        gauss.load(_file(tmp_path, bodies, rest))


def test_lines_of_included_files_are_told(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "tip.xml").write_text(
        '<mujocoinclude>\n\n<body name="t"><joint stiffness="1 2"/><geom size="1"/></body></mujocoinclude>'
    )
    path = _file(tmp_path, '<body name="a"><joint/><geom size="1"/><include file="sub/tip.xml"/></body>')
    with pytest.raises(FileError, match=r"stiffness of joint .*tip.xml:3\)"):
        gauss.load(path)


def test_adhesion_needs_contacts(tmp_path):
    path = _file(tmp_path, HINGE.format(""), '<actuator><adhesion name="m" body="a" ctrlrange="0 1"/></actuator>')
    with pytest.warns(NotImportedWarning, match="adhesion, which needs contacts, of actuators m"):
        gauss.load(path)
    with pytest.raises(FileError, match="not modelled: actuator 'm'"):
        gauss.load(path, contacts=True)


def test_files_below_a_root_folder_are_read(tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "tip.xml").write_text("<mujocoinclude><joint/></mujocoinclude>")
    path = _file(tmp_path / "robots", '<body name="a"><geom size="1" pos="1 0 0"/><include file="../tip.xml"/></body>')
    assert list(gauss.load(path, root_folder=tmp_path).joints) == ["joint 0"]
    with pytest.raises(FileError, match=r"model.xml:3: names the file .*tip.xml' outside .*root_folder="):
        gauss.load(path)
    with pytest.raises(FileError, match="and outside root_folder"):
        gauss.load(path, root_folder=tmp_path / "robots")
    with pytest.raises(FileError, match="root_folder: expected a folder"):
        gauss.load(path, root_folder=tmp_path / "none")


def test_includes_that_multiply_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("gauss.io.mjcf.guard.MOST_INCLUDES", 20)
    for k in range(6):
        twice = f'<include file="{k + 1}.xml"/>' * 2
        (tmp_path / f"{k}.xml").write_text(f"<mujocoinclude>{twice}</mujocoinclude>")
    (tmp_path / "6.xml").write_text("<mujocoinclude/>")
    with pytest.raises(FileError, match="more than 20 files are included"):
        gauss.load(_file(tmp_path, "", head='<include file="0.xml"/>'))


def test_mujoco_has_no_equality_of_distances(tmp_path):
    with pytest.raises(FileError, match="(?s)MuJoCo refuses it.*'distance', line 5"):
        gauss.load(_file(tmp_path, TWO, '<equality><distance geom1="a" geom2="b"/></equality>'))


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><mujoco model="&b;"/>'
HOSTILE = {
    "entities": (BOMB, "entities"),
    "nesting": ("<mujoco>" + "<body>" * 5000, "nested more than"),
    "no XML": ("mujoco { }", "not XML"),
    "another format": ("<sdf version='1.9'/>", "expected <mujoco>, got <sdf>"),
    "a mesh elsewhere": ('<mujoco><asset><mesh file="../../etc/passwd"/></asset></mujoco>', "outside its own folder"),
    "a folder elsewhere": (
        '<mujoco><compiler meshdir="/etc"/><asset><mesh file="passwd"/></asset></mujoco>',
        "outside its own folder",
    ),
    "an include elsewhere": ('<mujoco><include file="/etc/passwd"/></mujoco>', "outside its own folder"),
    "an endless include": ('<mujoco><include file="model.xml"/></mujoco>', "includes it again"),
    "a plugin": ('<mujoco><extension><plugin plugin="x"/></extension></mujoco>', "plugin"),
    "a huge number": (
        '<mujoco><worldbody><body><joint/><geom size="0.1" mass="1e999"/></body></worldbody></mujoco>',
        r"model.xml:1: <geom> mass holds 1e999",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(tmp_path, name):
    text, words = HOSTILE[name]
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(FileError, match=words):
        gauss.load(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_seen_in_any_encoding(tmp_path, encoding):
    path = tmp_path / "model.xml"
    path.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>{BOMB}'.encode(encoding))
    with pytest.raises(FileError, match="entities"):
        gauss.load(path)


def test_folders_of_one_file_do_not_open_those_of_another(tmp_path):
    (tmp_path / "inner.xml").write_text('<mujocoinclude><mesh file="passwd"/></mujocoinclude>')
    asset = '<asset><include file="inner.xml"/></asset>'
    (tmp_path / "model.xml").write_text(f'<mujoco><compiler meshdir="/etc"/>{asset}</mujoco>')
    with pytest.raises(FileError, match="inner.xml:1: names the file '/etc/passwd' outside"):
        gauss.load(tmp_path / "model.xml")


COPIED = '<body><geom size="1" mass="1"/></body>'
MULTIPLYING = {
    "replicate": ("", f'<replicate count="1000000000" offset="1 0 0">{COPIED}</replicate>'),
    "nested": ("", f'<replicate count="1000"><replicate count="1000">{COPIED}</replicate></replicate>'),
    "composite": ("", '<composite type="cable" count="1000000 1 1"/>'),
    "size": ('<size nuserdata="2000000000"/>', COPIED),
    "cube": ('<asset><texture name="h" builtin="flat" width="20000"/></asset>', COPIED),
    "hfield": ('<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>', COPIED),
}


@pytest.mark.parametrize("kind", MULTIPLYING)
def test_elements_that_stand_for_very_many_are_refused(tmp_path, kind):
    assets, bodies = MULTIPLYING[kind]
    path = tmp_path / "many.xml"
    path.write_text(f"<mujoco>{assets}<worldbody>{bodies}</worldbody></mujoco>")
    with pytest.raises(FileError, match=r"many\.xml:1: <\w+> (makes|has) .* (elements|numbers)"):
        gauss.load(path)
