"""Files that were made to do harm: each is refused with its place; none is waited for without end, or ends Python."""

import os
import struct

import pytest

import gauss
from gauss.errors import FileError
from tests.support.files import quietly

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
BODY = '<body name="b"><joint axis="0 1 0"/><geom size="0.1"/></body>'
ENTITIES = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
ATTACH = '<frame><attach model="x" body="b" prefix="p{}"/></frame>'
TOML = """[[body]]
name = "b"
mass = 1.0
inertia = [1, 1, 1]
[[joint]]
name = "J"
type = "ball"
parent = "ground"
child = "b"
"""


def link(name):
    return f'<link name="{name}">{INERTIAL}</link>'


def joint(name, parent, child, more=""):
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 0 1"/>{more}</joint>'
    )


def urdf(text, head="", root="<robot name='r'>"):
    return f"{head}{root}{text}</robot>"


ROBOT = link("a") + link("b") + joint("J", "a", "b")
CHAIN = "".join(f'<link name="{k}"/>' for k in range(3100)) + "".join(joint(f"J{k}", k, k + 1) for k in range(3099))
MIMICS = [joint(f"J{k}", k, k + 1, f'<mimic joint="J{(k + 1) % 3}"/>') for k in range(3)]


def mjcf(body, more=""):
    return f"<mujoco>{more}<worldbody>{body}</worldbody></mujoco>"


def mesh(file):
    return mjcf('<body><joint/><geom type="mesh" mesh="m"/></body>', f'<asset><mesh name="m" file="{file}"/></asset>')


def attaching(file, times=1):
    return mjcf("".join(map(ATTACH.format, range(times))), f'<asset><model name="x" file="{file}"/></asset>')


def family(folder):
    """Files each of which attaches the next ten times."""
    for k in range(9):
        (folder / f"a{k}.xml").write_text(attaching(f"a{k + 1}.xml", 10).replace("<frame>", '<frame name="b">'))
    (folder / "a9.xml").write_text(mjcf(BODY))


def ring(folder):
    for one, other in ("bc", "cb"):
        (folder / f"{one}.xml").write_text(f'<mujocoinclude><include file="{other}.xml"/></mujocoinclude>')


def beside(name, text):
    return lambda folder: (folder / name).write_text(text)


def pipe(name):
    return lambda folder: os.mkfifo(folder / name)


def linked(name, target):
    return lambda folder: (folder / name).symlink_to(target)


def nothing(folder):
    """No file beside."""


# Name of the file, its content (None: none), what is made beside it, what the message says.
HOSTILE = {
    "a pipe": ("r.urdf", None, pipe("r.urdf"), "pipe or device"),
    "a pipe as a scene": ("s.toml", None, pipe("s.toml"), "pipe or device"),
    "a device without end": ("s.toml", None, linked("s.toml", "/dev/zero"), "pipe or device"),
    "a device as a model": ("m.xml", None, linked("m.xml", "/dev/zero"), "pipe or device"),
    "a device as a world": ("w.sdf", None, linked("w.sdf", "/dev/zero"), "pipe or device"),
    "a pipe as a mesh": ("m.xml", mesh("m.stl"), pipe("m.stl"), "m.xml:1: names 'm.stl', a pipe or device"),
    "a device as a mesh": ("m.xml", mesh("m.stl"), linked("m.stl", "/dev/zero"), "m.xml:1: .*outside its own folder"),
    "a folder": ("f.urdf", None, lambda folder: (folder / "f.urdf").mkdir(), "a folder"),
    "a link to itself": ("l.urdf", None, linked("l.urdf", "l.urdf"), "cannot be read"),
    "an include that links to itself": (
        "m.xml",
        mjcf(BODY, '<include file="l.xml"/>'),
        linked("l.xml", "l.xml"),
        "m.xml:1: .*links lead round in a circle",
    ),
    "a mesh that links elsewhere": ("m.xml", mesh("m.stl"), linked("m.stl", "/etc/hostname"), "m.xml:1: .*outside"),
    "a folder that links elsewhere": ("m.xml", mesh("d/m.stl"), linked("d", "/etc"), "m.xml:1: .*outside"),
    "a mesh above": ("m.xml", mesh("../../m.stl"), nothing, "m.xml:1: .*outside"),
    "an included world": (
        "w.sdf",
        '<sdf version="1.9"><world name="w"><include><uri>../../../../../../../../etc/passwd</uri></include></world></sdf>',
        nothing,
        "w.sdf:1: ",
    ),
    "includes in a circle": ("a.xml", mjcf(BODY, '<include file="b.xml"/>'), ring, "c.xml:1: includes b.xml, .*again"),
    "a model that attaches itself": ("m.xml", attaching("m.xml"), nothing, "m.xml:1: attaches m.xml, .*again"),
    "models that attach ten others each": ("a.xml", attaching("a0.xml"), family, "more than 50000 elements are attached"),
    "an attached mesh elsewhere": ("m.xml", attaching("s.xml"), beside("s.xml", mesh("../m.stl")), "s.xml:1: .*outside"),
    "an attached model with a plugin": (
        "m.xml",
        attaching("s.xml"),
        beside("s.xml", mjcf(BODY, '<extension><plugin plugin="p"/></extension>')),
        "s.xml:1: <extension> asks for a plugin",
    ),
    "an attached model of many": (
        "m.xml",
        attaching("s.xml"),
        beside("s.xml", mjcf(f'<replicate count="100000">{BODY}</replicate>')),
        "s.xml:1: <replicate> makes",
    ),
    "an attached model elsewhere": ("m.xml", attaching("../s.xml"), nothing, "m.xml:1: .*outside"),
    "an attached file that is none": ("m.xml", attaching("s.xml"), beside("s.xml", "<html/>"), "expected <mujoco>"),
    "entities": ("r.urdf", urdf(ROBOT, ENTITIES), nothing, "r.urdf:1: .*entities"),
    "entities of a model": ("m.xml", ENTITIES + mjcf(BODY), nothing, "m.xml:1: .*entities"),
    "elements without end": ("r.urdf", urdf("<link>" * 10_000), nothing, "nested more than"),
    "attributes without end": (
        "r.urdf",
        urdf(ROBOT, root="<robot name='r' " + " ".join(f"a{k}=''" for k in range(2000)) + ">"),
        nothing,
        "r.urdf:1: <robot> has 2001 attributes",
    ),
    "links without end": ("r.urdf", urdf(CHAIN), nothing, "more than 3000 links"),
    "arrays without end": ("s.toml", "x = " + "[" * 10_000, nothing, "nested too deep|not a TOML file"),
    "digits without end": ("s.toml", TOML.replace("1.0", "9" * 10_000), nothing, "not a TOML file"),
    "a height field of 1e9": (
        "m.xml",
        mjcf(
            f'<geom type="hfield" hfield="h"/>{BODY}',
            '<asset><hfield name="h" nrow="31623" ncol="31623" size="1 1 1 1"/></asset>',
        ),
        nothing,
        "m.xml:1: <hfield> has 1e.09 numbers",
    ),
    "a mesh of 4e9 triangles in 50 bytes": (
        "m.xml",
        mesh("m.stl"),
        lambda folder: (folder / "m.stl").write_bytes(bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50)),
        "m.xml",
    ),
    "an infinite mass": ("r.urdf", urdf(ROBOT.replace('"1"', '"1e400"', 1)), nothing, "r.urdf:1"),
    "a mass with a comma": ("r.urdf", urdf(ROBOT.replace('"1"', '"1,5"', 1)), nothing, "r.urdf:1"),
    "a hexadecimal mass": ("r.urdf", urdf(ROBOT.replace('"1"', '"0x10"', 1)), nothing, "r.urdf:1"),
    "digits of another script": ("r.urdf", urdf(ROBOT.replace('"1"', '"１"', 1)), nothing, "r.urdf:1"),
    "an encoding of several bytes": ("r.urdf", urdf(ROBOT, '<?xml version="1.0" encoding="utf-7"?>'), nothing, "UTF-8"),
    "an unknown encoding": ("m.xml", f'<?xml version="1.0" encoding="x-none"?>{mjcf(BODY)}', nothing, "UTF-8"),
    "a zero in a name": ("r.urdf", urdf(ROBOT).replace("'r'", "'r\0'"), nothing, "not XML"),
    "a zero in a scene": ("s.toml", TOML.replace('"J"', '"J\0"'), nothing, "not a TOML file"),
    "a name twice": ("m.xml", mjcf(BODY.replace("name=", 'name="c" name=')), nothing, "not XML: duplicate attribute"),
    "no name": ("r.urdf", urdf(ROBOT.replace('"a"', '""')), nothing, "r.urdf:1: <link> has no name"),
    "links in a circle": ("r.urdf", urdf(ROBOT + joint("K", "b", "a")), nothing, "r.urdf:1: .*in a circle"),
    "a joint that mimics itself": (
        "r.urdf",
        urdf(link("a") + link("b") + joint("J", "a", "b", '<mimic joint="J"/>')),
        nothing,
        "r.urdf:1: joint 'J' mimics",
    ),
    "joints that mimic one another": (
        "r.urdf",
        urdf("".join(link(k) for k in range(4)) + "".join(MIMICS)),
        nothing,
        "r.urdf:1: joint 'J2' mimics 'J0', which mimics it",
    ),
    "bodies on one another": ("s.toml", TOML.replace('"b"\n', '"b"\non = "b"\n', 1), nothing, "s.toml: body 'b'"),
    "a tag that calls": ("robot.urdf", urdf(ROBOT), beside("robot.yaml", "!!python/name:os.system"), "robot.yaml:1: .*tags"),
    "aliases": ("robot.urdf", urdf(ROBOT), beside("robot.yaml", "a: &a [x]\nb: [*a, *a]"), "robot.yaml:1: .*aliases"),
    "a key that is a list": (
        "robot.urdf",
        urdf(ROBOT),
        beside("robot.yaml", "? [a]\n: b\n"),
        "robot.yaml:1: a key",
    ),
    "a program": ("r.xacro", urdf("${open('/etc/passwd').read()}"), nothing, "xacro=True"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_with_their_place(name, tmp_path):
    file, content, make, words = HOSTILE[name]
    if content is not None:
        (tmp_path / file).write_text(content, encoding="utf-8")
    make(tmp_path)
    with pytest.raises(FileError, match=f"(?s){tmp_path}/.*({words})"):
        gauss.load(tmp_path / file)


@pytest.mark.parametrize("name", ["entities", "elements without end", "attributes without end"])
def test_what_the_guard_finds_is_no_matter_of_encoding(name, tmp_path):
    file, content, *_ = HOSTILE[name]
    (tmp_path / file).write_text(content)
    with pytest.raises(FileError, match=f"^{tmp_path}/{file}:1: "):
        gauss.load(tmp_path / file)


def test_models_that_are_attached_are_read(tmp_path):
    (tmp_path / "s.xml").write_text(mjcf(BODY))
    (tmp_path / "m.xml").write_text(attaching("s.xml", 3))
    assert len(quietly(tmp_path / "m.xml").bodies) == 3
    (tmp_path / "r.urdf").write_text(urdf(ROBOT))
    (tmp_path / "m.xml").write_text(attaching("r.urdf"))
    assert list(quietly(tmp_path / "m.xml").joints) == ["p0J"]


def test_a_scene_may_begin_with_a_byte_order_mark(tmp_path):
    (tmp_path / "s.toml").write_text(TOML, encoding="utf-8-sig")
    assert list(gauss.load(tmp_path / "s.toml").bodies) == ["b"]
