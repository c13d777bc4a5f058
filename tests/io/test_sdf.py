"""SDFormat: the same mechanism however its poses are said, with its loops; what is not modelled by file and line."""

import warnings
from math import cos, degrees, pi, sin

import numpy as np
import pytest

import gauss
from gauss import rotations
from gauss.errors import FileError, NotImportedWarning
from gauss.scene.toml import toml_text
from gauss.system import State, random_state
from gauss.system.frames import relative
from tests.support.mechanisms import four_bar

KINDS = ("revolute", "prismatic", "ball", "universal", "screw", "fixed")
SAME = 1e-10  # relative: the same numbers, but for rounding of the poses that are composed


def _rpy(R):
    """Roll, pitch and yaw of a rotation: the unique ones where the pitch is less than a right angle."""
    return np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])


def _pose(R, p, **attributes):
    said = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<pose{said}>{' '.join(repr(float(x)) for x in (*p, *_rpy(R)))}</pose>"


def _vector(values):
    return " ".join(repr(float(x)) for x in values)


def _sdf(scene) -> str:
    """A scene as SDFormat, joints placed in the model frame, axes in the world."""
    parts = []
    for body in scene.bodies.values():
        J, R = body.principal()
        moments = "".join(f"<{tag}>{float(x)!r}</{tag}>" for tag, x in zip(("ixx", "iyy", "izz"), J, strict=True))
        inertial = f"<inertial>{_pose(R, body.com)}<mass>{body.mass!r}</mass><inertia>{moments}</inertia></inertial>"
        parts.append(f'<link name="{body.name}">{_pose(*relative(scene, "ground", body.name))}{inertial}</link>')
    for joint in scene.joints.values():
        R, p = np.eye(3), np.array(joint.at)
        if joint.frame != "world":
            R, origin = relative(scene, "ground", joint.frame)
            p = origin + R @ p
        turned = R @ joint.axes()
        axes = [turned[:, 2], turned[:, 0]][: {"universal": 2, "ball": 0, "fixed": 0}.get(joint.kind, 1)]
        said = "".join(
            f"<axis{n or ''}><xyz expressed_in='__model__'>{_vector(axis)}</xyz></axis{n or ''}>"
            for n, axis in zip((0, 2), axes, strict=False)
        )
        ends = "".join(
            f"<{tag}>{'world' if end == 'ground' else end}</{tag}>"
            for tag, end in (("parent", joint.parent), ("child", joint.child))
        )
        pitch = f"<screw_thread_pitch>{2 * pi * joint.pitch!r}</screw_thread_pitch>" if joint.kind == "screw" else ""
        kept = turned if joint.kind in ("ball", "fixed") else np.eye(3)
        place = _pose(kept, p, relative_to="__model__")
        parts.append(f'<joint name="{joint.name}" type="{joint.kind}">{place}{ends}{said}{pitch}</joint>')
    gravity = f"<gravity>{_vector(scene.gravity)}</gravity>"
    return f'<sdf version="1.10"><world name="w">{gravity}<model name="m">{"".join(parts)}</model></world></sdf>'


def _load(folder, text, **options):
    (folder / "model.sdf").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return gauss.load(folder / "model.sdf", **options)


def _accelerations(scene, state=None):
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(3)) if state is None else State(state.t, state.q, state.v)
    return system, state, system.accelerations(state)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_trees_accelerate_as_the_scene_that_was_written(tmp_path, seed):
    scene = gauss.load("random_tree", n=7, seed=seed, kinds=KINDS)
    system, state, expected = _accelerations(scene)
    again, _, found = _accelerations(_load(tmp_path, _sdf(scene)), state)
    assert again.coordinates == system.coordinates
    assert found == pytest.approx(expected, rel=SAME, abs=SAME * abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("order", ["ABCD", "BCDA"])
def test_loops_are_closed(tmp_path, order):
    scene = four_bar(order)
    state = gauss.compile_scene(scene).initial_state()
    expected = _accelerations(scene, state)[2]
    assert _accelerations(_load(tmp_path, _sdf(scene)), state)[2] == pytest.approx(expected, rel=SAME, abs=SAME)


ARM = """<sdf version="1.10"><model name="m"><pose>1 2 3 0.1 0.2 0.3</pose>
<link name="a">{a}<inertial><mass>2</mass><inertia><ixx>0.2</ixx><iyy>0.3</iyy><izz>0.4</izz></inertia></inertial></link>
<link name="b">{b}<inertial><mass>1</mass></inertial></link>{frame}
<joint name="A" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0 1 0</xyz></axis></joint>
<joint name="B" type="prismatic">{joint}<parent>a</parent><child>{child}</child><axis>{axis}</axis></joint></model></sdf>"""
SIXTH = degrees(pi / 6)
SAID = {
    "in the model": {"b": f"<pose>1 0 0.5 0 0 {0.2 + pi / 6}</pose>"},
    "relative to a link": {"b": f'<pose relative_to="a">0.5 0 0.5 0 0 {pi / 6}</pose>'},
    "in degrees": {"b": f'<pose relative_to="a" degrees="true">0.5 0 0.5 0 0 {SIXTH!r}</pose>'},
    "as a quaternion": {
        "b": f'<pose relative_to="a" rotation_format="quat_xyzw">0.5 0 0.5 0 0 {np.sin(pi / 12)} {np.cos(pi / 12)}</pose>'
    },
    "by a frame": {
        "frame": '<frame name="f" attached_to="a"><pose>0.5 0 0 0 0 0</pose></frame>',
        "b": f'<pose relative_to="f">0 0 0.5 0 0 {pi / 6}</pose>',
    },
    "by a frame of the joint": {
        "joint": f'<pose relative_to="a">0.5 0 0.5 0 0 {pi / 6}</pose>',
        "b": '<pose relative_to="B"/>',
    },
    "child by a frame": {
        "frame": '<frame name="f" attached_to="b"/>',
        "child": "f",
        "b": f'<pose relative_to="a">0.5 0 0.5 0 0 {pi / 6}</pose>',
    },
    "axis of another link": {
        "b": f'<pose relative_to="a">0.5 0 0.5 0 0 {pi / 6}</pose>',
        "axis": f"<xyz expressed_in='a'>{np.cos(pi / 6)} {np.sin(pi / 6)} 0</xyz>",
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SAID)
def test_however_poses_are_said(tmp_path, name):
    given = {"a": "<pose>0.5 0 0 0 0 0.2</pose>", "child": "b", "axis": "<xyz>1 0 0</xyz>", "joint": "", "frame": ""}
    given["b"] = SAID[name]["b"]
    if name == "in the model":  # the origin of b, 0.5 m along x of a, which is turned by 0.2
        given["b"] = f"<pose>{0.5 + 0.5 * cos(0.2)!r} {0.5 * sin(0.2)!r} 0.5 0 0 {0.2 + pi / 6!r}</pose>"
    scene = _load(tmp_path, ARM.format(**given | {key: value for key, value in SAID[name].items() if key != "b"}))
    system = gauss.compile_scene(scene)
    state = system.state([0.4, 0.3], [0.5, -0.7])
    reference = gauss.Scene("m")
    R, p = rotations.from_rpy(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0])
    R_a, p_a = R @ rotations.about_z(0.2), p + R @ [0.5, 0, 0]
    reference.body("a", 2.0, (0.2, 0.3, 0.4), position=p_a, rotation=R_a)
    reference.body("b", 1.0, (1, 1, 1), position=(0.5, 0, 0.5), rotation=rotations.about_z(pi / 6), on="a")
    reference.revolute("A", "ground", "a", axis=(0, 1, 0), frame="a")
    reference.prismatic("B", "a", "b", axis=(1, 0, 0), frame="b")
    expected = gauss.compile_scene(reference).accelerations(gauss.compile_scene(reference).state(state.q, state.v))
    assert system.accelerations(state) == pytest.approx(expected, rel=SAME)


def test_what_resists_is_read(tmp_path):
    axis = """<xyz>1 0 0</xyz><limit><lower>-1</lower><upper>inf</upper></limit><dynamics><damping>2</damping>
    <spring_stiffness>3</spring_stiffness><spring_reference>0.1</spring_reference><friction>0.2</friction></dynamics>
    <mimic joint="A"><multiplier>2</multiplier><offset>0.5</offset><reference>0.1</reference></mimic>"""
    scene = _load(tmp_path, ARM.format(a="", b="", frame="", joint="", child="b", axis=axis))
    spring, coupling = scene.loads["spring of B"], scene.couplings["B mimics A"]
    assert (spring.stiffness, spring.damping, spring.rest) == (3.0, 2.0, 0.1)
    assert scene.joints["B"].limits == (-1.0, 1e16) and scene.set_valued["friction of B"].limit == 0.2
    assert (coupling.ratio, coupling.offset) == pytest.approx((2.0, 0.3))


@pytest.mark.parametrize("root, kind", [(None, "free"), ("free", "free"), ("fixed", "fixed")])
def test_what_nothing_holds_is_free(tmp_path, root, kind):
    scene = _load(tmp_path, '<sdf><model name="m"><link name="a"><pose>0 0 1 0 0 0</pose></link></model></sdf>', root=root)
    assert [joint.kind for joint in scene.joints.values()] == [kind] and scene.bodies["a"].position == (0, 0, 1)


@pytest.mark.parametrize("upper, expected", [("inf", (-1.0, None)), ("0.5", (-1.0, 0.5))])
def test_limits_become_stops_on_request(tmp_path, upper, expected):
    axis = f"<xyz>1 0 0</xyz><limit><lower>-1</lower><upper>{upper}</upper></limit>"
    text = ARM.format(a="", b="", frame="", joint="", child="b", axis=axis)
    assert _load(tmp_path, text).contacts == {}
    stop = _load(tmp_path, text, limits="stops").contacts["stop of B"]
    assert (stop.lowest, stop.highest) == expected
    with pytest.raises(FileError, match="limits: expected 'start' or 'stops'"):
        _load(tmp_path, text, limits="stop")


def test_contact_coefficients_of_a_link_are_named(tmp_path):
    text = _sdf(four_bar("ABCD"))
    path = tmp_path / "model.sdf"
    path.write_text(text.replace("<inertial", "<contact><lateral_friction>1</lateral_friction></contact><inertial", 1))
    with pytest.warns(NotImportedWarning, match="not read: contact coefficients of links"):
        assert toml_text(gauss.load(path)) == toml_text(_load(tmp_path, text))


def test_a_public_robot_with_loops():
    path = next(f for f in _robot_files() if f.name == "cassie_v2.sdf").locate()
    with pytest.warns(NotImportedWarning, match="not read: collisions, plugins, damping and friction of ball joints"):
        scene = gauss.load(path)
    assert len(scene.bodies) == 23 and len(scene.joints) == 27
    assert sum(body.mass for body in scene.bodies.values()) == pytest.approx(32.94, abs=1e-9)


def _robot_files():
    import importlib.metadata

    return [file for file in importlib.metadata.files("example-robot-data") if file.suffix == ".sdf"]


LINK = '<link name="a"/><link name="b"/>'
HINGE = '<joint name="A" type="{}"><parent>a</parent><child>b</child>{}</joint>'
REFUSED = {  # the model, what the message says, and the line
    "a gearbox": (LINK + HINGE.format("gearbox", ""), "type 'gearbox' is not modelled", 2),
    "no axis": (LINK + "\n" + HINGE.format("revolute", ""), "<axis> is missing", 3),
    "an unknown element": (LINK + "\n<buoyancy/>", "<buoyancy> of model 'm' is not modelled", 3),
    "no number": (LINK + HINGE.format("revolute", "<axis>\n<xyz>0 x 1</xyz></axis>"), "<xyz> needs 3 numbers", 3),
    "an unknown child": (LINK + HINGE.format("ball", "").replace(">b<", ">bb<"), "no link, joint or frame 'bb'. Did you", 2),
    "a pose of itself": ('<link name="a"><pose relative_to="a">0 0 0 0 0 0</pose></link>', "relative to itself", 2),
    "a name twice": ('<link name="a"/>\n<link name="a"/>', "'a' of <link> is taken by <link>", 3),
    "a nested model without links": (LINK + '\n<model name="n"/>', "no links", 3),
    "an include without a file": ("<include><uri>model://x</uri></include>", "no such model", 2),
    "a screw that does not turn": (
        LINK + HINGE.format("screw", "<thread_pitch>0</thread_pitch><axis/>"),
        "<thread_pitch> of 0",
        2,
    ),
    "limits the wrong way round": (
        LINK + HINGE.format("revolute", "<axis>\n<limit><lower>1</lower><upper>0</upper></limit></axis>"),
        "above the upper one",
        3,
    ),
    "a damped universal joint": (
        LINK
        + HINGE.format("universal", "<axis2><xyz>1 0 0</xyz>\n<dynamics><damping>1</damping></dynamics></axis2><axis/>"),
        "damping of a universal joint",
        3,
    ),
    "inertia of no collision": ('<link name="a"><inertial auto="true"/></link>', "no collision with a volume", 2),
    "inertia of a mesh": (
        '<link name="a"><inertial auto="true"/>\n<collision name="c"><geometry><mesh/></geometry></collision></link>',
        "not computed",
        3,
    ),
    "a link that is led": ('<link name="a"><kinematic>true</kinematic></link>', "<kinematic> of link 'a'", 2),
    "a canonical link of another model": ('<model name="n" canonical_link="x"><link name="l"/></model>', "no link 'x'", 2),
    "static": ("<static>true</static>" + LINK, "nothing moves", 1),
    "no links": ("", "no links", 1),
    "a huge number": ('<link name="a"><inertial><mass>1e300</mass></inertial></link>', "holds 1e300", 2),
    "entities": ("", "entities", 1),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_modelled_is_refused_by_line(tmp_path, name):
    inner, words, line = REFUSED[name]
    head = '<!DOCTYPE s [<!ENTITY a "b">]>' if name == "entities" else ""
    with pytest.raises(FileError, match=rf"model.sdf:{line}: .*{words}"):
        _load(tmp_path, f'{head}<sdf version="1.10"><model name="m">\n{inner}</model></sdf>')
