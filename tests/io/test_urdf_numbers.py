"""Numbers of URDF files: each is read as it stands, or refused with its place; a link never loses its inertia in silence."""

import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.io.numbers import number
from gauss.io.urdf.numbers import COUNTS
from gauss.io.urdf.robots import robot
from gauss.scene.toml import toml_text

ARM = """<robot name="r">
<link name="base"/>
<link name="arm">
<inertial><origin xyz="0.1 0.2 -0.3" rpy="0.1 0.2 0.3"/>
<mass value="2.0"/>
<inertia ixx="1.0" ixy="0.01" ixz="-0.02" iyy="1.1" iyz="0.03" izz="1.2"/></inertial>
<collision><origin xyz="0 0 0.25" rpy="0 0 0.5"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
<collision><geometry><sphere radius="0.2"/></geometry></collision>
<collision><geometry><capsule radius="0.2" length="0.4"/></geometry></collision>
</link>
<link name="hand">
<inertial><mass value="0.5"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
</link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0 0.5 1" rpy="0.3 0.5 -0.2"/><axis xyz="0 0.6 0.8"/>
<limit lower="-1.5" upper="1.25" effort="10" velocity="3"/><dynamics damping="0.7" friction="0.2"/></joint>
<joint name="k" type="prismatic"><parent link="arm"/><child link="hand"/><axis xyz="1 0 0"/>
<limit lower="-0.5" upper="0.5" effort="10" velocity="3"/><mimic joint="j" multiplier="0.4" offset="0.1"/></joint>
</robot>"""
EVERYTHING = {"limits": "start", "resistance": True, "collisions": True}
FORMS = {  # ways to write the same number
    "blanks": " {} ",
    "a new line": "{}\n",
    "a tab": "\t{}",
    "an exponent": "{}e0",
    "a plus": "+{}",
    "many zeros": "000{}",
}
NONE = ["", " ", "1kg", "0x10", "1,5", "nan", "inf", "-inf", "1e", "1_0", "\u0661", "1e999", "--1", "1 2", "one"]
QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def _load(folder, text: str, **options):
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return gauss.load(path, **options)


def _places(text: str = ARM) -> list[tuple[int, str, int]]:
    """Every attribute that holds numbers: number of the element in the file, attribute, how many numbers."""
    elements = list(ElementTree.fromstring(text).iter())
    return [(k, key, COUNTS[e.tag][key]) for k, e in enumerate(elements) for key in e.attrib if key in COUNTS.get(e.tag, {})]


def _with(place: tuple[int, str, int], change) -> str:
    """The file with one attribute changed by a function of its text."""
    root = ElementTree.fromstring(ARM)
    element = list(root.iter())[place[0]]
    element.set(place[1], change(element.get(place[1])))
    return ElementTree.tostring(root, encoding="unicode")


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_number_is_the_same_however_it_is_written(tmp_path, form):
    expected = toml_text(_load(tmp_path, ARM, **EVERYTHING))
    for place in _places():

        def changed(text):
            after_minus = "+" in FORMS[form] or "0{}" in FORMS[form]  # which a sign cannot stand before
            return " ".join(word if after_minus and word[0] == "-" else FORMS[form].format(word) for word in text.split())

        assert toml_text(_load(tmp_path, _with(place, changed), **EVERYTHING)) == expected


@pytest.mark.slow
@pytest.mark.parametrize("text", NONE)
def test_what_is_no_number_is_refused_with_its_place(tmp_path, text):
    for place in _places():
        with pytest.raises(FileError, match=rf"robot.urdf:\d+: <\w+>( {place[1]}: expected .* number| .*holds 1e999)"):
            _load(tmp_path, _with(place, lambda old: text))


@pytest.mark.slow
@QUICK
@given(data=st.data())
def test_any_text_is_the_number_that_it_says_or_refused_with_its_place(tmp_path, data):
    """Second route: the element is taken out of the scene that Pinocchio's parser makes of clean text."""
    place = data.draw(st.sampled_from(_places()))
    mutate = data.draw(st.sampled_from(["{}{}", "{1}{0}"]))
    tail = data.draw(
        st.sampled_from(["\n", "\t ", "kg", "e2", "e+", ".", ",5", "inf", "0", "e-400", "\u00a0", "f"]) | st.text(max_size=3)
    )
    try:
        text = _with(place, lambda old: mutate.format(old, tail))
        words = list(ElementTree.fromstring(text).iter())[place[0]].get(place[1]).split()
    except ElementTree.ParseError:
        return
    read = [number(word) for word in words]
    if len(read) != place[2] or None in read:
        with pytest.raises(FileError, match=r"robot.urdf(:\d+)?: "):
            _load(tmp_path, text)
        return
    clean = _with(place, lambda old: " ".join(map(repr, read)))
    try:
        expected = toml_text(_load(tmp_path, clean, **EVERYTHING))
    except FileError:  # such as an inertia that no body has
        with pytest.raises(FileError, match=r"robot.urdf(:\d+)?: "):
            _load(tmp_path, text, **EVERYTHING)
        return
    assert toml_text(_load(tmp_path, text, **EVERYTHING)) == expected


@pytest.mark.parametrize(
    "part, words",
    [
        (' value="2.0"', "<mass> value: expected a number.*there is none"),
        (' ixz="-0.02"', "<inertia> ixz: expected a number.*there is none"),
        ('<mass value="2.0"/>', "<inertial> has no <mass>"),
        (' xyz="0 0.6 0.8"', "<axis> xyz: expected 3 numbers.*there is none"),
        (' size="0.1 0.2 0.3"', "<box> size: expected 3 numbers"),
    ],
)
def test_what_is_missing_is_refused_with_its_place(tmp_path, part, words):
    assert part in ARM
    with pytest.raises(FileError, match=rf"robot.urdf:\d+: {words}"):
        _load(tmp_path, ARM.replace(part, ""))


@pytest.mark.parametrize(
    "part", [' effort="10" velocity="3"', ' damping="0.7" friction="0.2"', ' rpy="0.1 0.2 0.3"', ' offset="0.1"']
)
def test_what_may_be_missing_is_not_needed(tmp_path, part):
    assert part in ARM
    assert len(_load(tmp_path, ARM.replace(part, "")).joints) == 2


@pytest.mark.parametrize("old, new", [("rpy=", "rpz="), ("ixz=", "Ixz="), ("multiplier=", "multipler=")])
def test_misspelt_attributes_are_refused_with_their_place(tmp_path, old, new):
    with pytest.raises(FileError, match=rf"robot.urdf:\d+: <\w+>.* {new[:-1]!r}.*Did you mean {old[:-1]!r}"):
        _load(tmp_path, ARM.replace(old, new))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "talos_reduced", "solo12"])
def test_no_link_of_a_robot_loses_its_mass(tmp_path, name):
    """Total mass and its first moment by the XML alone, with a new line after every number."""
    path = robot(name)
    root = ElementTree.parse(path).getroot()
    for element in root.iter():
        for key in COUNTS.get(element.tag, {}):
            if key in element.keys():
                element.set(key, f"{element.get(key)}\n")
    masses = [float(mass.get("value")) for mass in root.iterfind("link/inertial/mass")]
    scene = _load(tmp_path, ElementTree.tostring(root, encoding="unicode"), root="free")
    assert sum(body.mass for body in scene.bodies.values()) == pytest.approx(sum(masses), rel=1e-14)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        assert toml_text(scene) == toml_text(gauss.load(path, root="free"))


@pytest.mark.parametrize("far", ["1e16", "1.79769e+308", "1.7976931348623157e308"])
def test_limits_beyond_all_measure_are_none(tmp_path, far):
    one = _load(tmp_path, ARM.replace('lower="-1.5"', f'lower="-{far}"'), limits="stops")
    assert (one.contacts["stop of j"].lowest, one.contacts["stop of j"].highest) == (None, 1.25)
    both = _load(tmp_path, ARM.replace('lower="-1.5" upper="1.25"', f'lower="-{far}" upper="{far}"'), limits="stops")
    assert both.joints["j"].limits is None and "stop of j" not in both.contacts


@pytest.mark.parametrize("axis", ["", '<axis xyz="1 0 0"/>', '<axis xyz="0 0 -1"/>'])
def test_planes_that_the_parser_would_turn_are_refused(tmp_path, axis):
    plane = ARM.replace('<axis xyz="0 0.6 0.8"/>', axis).replace('"j" type="revolute"', '"j" type="planar"')
    with pytest.raises(FileError, match=r"robot.urdf:14: joint 'j': a planar joint.*along z"):
        _load(tmp_path, plane, mimic=False)
    straight = (
        plane.replace(axis, '<axis xyz="0 0 1"/>')
        if axis
        else ARM.replace("0 0.6 0.8", "0 0 1").replace("revolute", "planar")
    )
    assert _load(tmp_path, straight, mimic=False).joints["j"].kind == "planar"


FLOATING = ARM.replace('name="j" type="revolute"', 'name="j" type="floating"')


def test_a_robot_that_floats_already_is_not_let_float_twice(tmp_path):
    assert gauss.compile_scene(_load(tmp_path, FLOATING, mimic=False)).n_v == 7
    with pytest.raises(FileError, match=r"robot.urdf:14: joint 'j' lets the robot float already.*root='fixed'"):
        _load(tmp_path, FLOATING, root="free", mimic=False)
    heavy = FLOATING.replace(
        '<link name="base"/>', '<link name="base">' + ARM[ARM.index("<inertial>") : ARM.index("<collision>")] + "</link>"
    )
    system = gauss.compile_scene(_load(tmp_path, heavy, root="free", mimic=False))
    assert system.n_v == 13 and np.isfinite(system.accelerations(system.initial_state())).all()


def test_the_same_numbers_move_the_arm(tmp_path):
    """A new line after one moment of inertia is no reason for another motion."""
    hinge = ARM.replace('ixz="-0.02"', 'ixz="-2e-2&#10;"')
    motions = [gauss.compile_scene(_load(tmp_path, text)).accelerations for text in (ARM, hinge)]
    one, two = (accelerations(accelerations.__self__.initial_state()) for accelerations in motions)
    assert (one == two).all()


@pytest.mark.peer
def test_other_parsers_agree_with_the_file_as_it_is(tmp_path):
    """Pinocchio's own reading of a clean file, by its own file reader."""
    import pinocchio as pin

    path = Path(tmp_path) / "robot.urdf"
    scene = _load(tmp_path, ARM, mimic=False)
    model = pin.buildModelFromUrdf(str(path))
    for index, name in enumerate(["arm", "hand"], start=1):
        body = scene.bodies[name]
        assert body.mass == model.inertias[index].mass
        assert (np.array(body.com) == model.inertias[index].lever).all()


def test_one_scale_of_a_mesh_is_that_of_all_axes(tmp_path):
    corners = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\n"
    (tmp_path / "m.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    box = '<box size="0.1 0.2 0.3"/>'
    one, three = (
        _load(tmp_path, ARM.replace(box, f'<mesh filename="m.obj" scale="{scale}"/>'), collisions=True)
        for scale in ("0.5", "0.5 0.5 0.5")
    )
    assert toml_text(one) == toml_text(three)


@pytest.mark.parametrize("head", ['\n <?xml version="1.0"?>', "<!-- two -- dashes -->"])
def test_a_beginning_that_xml_does_not_allow_is_read_as_others_do(tmp_path, head):
    assert toml_text(_load(tmp_path, head + ARM)) == toml_text(_load(tmp_path, ARM))
