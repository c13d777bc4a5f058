"""SDFormat: the frame of the model itself, worlds of Gazebo, limits that are none, and numbers that are none."""

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.io.numbers import number
from gauss.scene.toml import toml_text

ARM = """<sdf version="1.10"><model name="m"{of_model}><pose>0.5 0 1 0.1 0 0.3</pose>
<link name="a"><pose>0 0.2 0 0 0.4 0</pose><inertial><mass>2</mass></inertial></link>
<link name="b"><pose>0.3 0 -1 0 0 0.7</pose><inertial><pose>0.1 0 0 0 0 0</pose></inertial></link>
<frame name="f"{of_frame}><pose>0 0.1 0.2 0.3 0 0</pose></frame>
<joint name="A" type="revolute"><parent>world</parent><child>{first}</child>{pose}<axis><xyz>0 0.6 0.8</xyz></axis></joint>
<joint name="B" type="revolute"><parent>{parent}</parent><child>{child}</child>
<axis><xyz{of_axis}>1 0 0</xyz><limit><lower>{lower}</lower><upper>{upper}</upper><effort>-1</effort></limit>
<dynamics><damping>0.5</damping></dynamics></axis></joint>
</model></sdf>"""
PLAIN = {"of_model": "", "of_frame": "", "first": "a", "pose": "", "parent": "a", "child": "b", "of_axis": ""}
PLAIN |= {"lower": "-1.5", "upper": "1.5"}
BACK = "<pose relative_to='__model__'/>"  # the joint stays at the frame of the model where its child is that
WAYS = {  # two ways to say the same
    "child": ({"first": "__model__"}, {"first": "a", "pose": BACK}),
    "child, the second link": (
        {"of_model": ' canonical_link="b"', "parent": "b", "child": "a", "first": "__model__"},
        {"of_model": ' canonical_link="b"', "parent": "b", "child": "a", "first": "b", "pose": BACK},
    ),
    "parent": ({"parent": "__model__"}, {}),
    "a frame": ({"of_frame": ' attached_to="__model__"'}, {}),
    "a frame, the second link": (
        {"of_frame": ' attached_to="__model__"', "of_model": ' canonical_link="b"'},
        {"of_model": ' canonical_link="b"'},
    ),
    "an axis": ({"of_axis": ' expressed_in="__model__"', "child": "b"}, {"of_axis": ' expressed_in="whole"'}),
}
WHOLE = '<frame name="whole"><pose relative_to="__model__"/></frame>\n<joint name="A"'


def _load(folder, text: str, ending=".sdf", **options):
    path = folder / f"model{ending}"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return gauss.load(path, **options)


def _arm(**parts) -> str:
    return ARM.format(**PLAIN | parts).replace('<joint name="A"', WHOLE)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_the_frame_of_the_model_is_carried_by_its_canonical_link(tmp_path, way):
    one, other = (_load(tmp_path, _arm(**parts)) for parts in WAYS[way])
    assert toml_text(one) == toml_text(other)
    system = gauss.compile_scene(one)
    assert np.isfinite(system.accelerations(system.initial_state())).all()


def test_a_canonical_link_that_is_none_is_refused(tmp_path):
    with pytest.raises(FileError, match="model.sdf:1: canonical_link: no link 'c'.*Known: a, b"):
        _load(tmp_path, _arm(of_model=' canonical_link="c"'))


@pytest.mark.parametrize("ending", [".world", ".WORLD"])
def test_worlds_of_gazebo_are_read_as_what_they_are(tmp_path, ending):
    model = _arm()
    world = model.replace('<model name="m">', '<world name="w"><gravity>0 0 -3</gravity><model name="m">')
    world = world.replace("</model>", "</model></world>")
    scene = _load(tmp_path, world, ending)
    assert scene.gravity == (0.0, 0.0, -3.0)
    assert toml_text(scene).splitlines()[2:] == toml_text(_load(tmp_path, model)).splitlines()[2:]


FAR = ["1.79769e+308", "1.7976931348623157e+308", "1.79769313486232e+308", "1e16", "1e17", "inf", "Infinity"]


@pytest.mark.parametrize("far", FAR)
def test_limits_beyond_all_measure_are_none(tmp_path, far):
    both = _load(tmp_path, _arm(lower=f"-{far}", upper=far), limits="stops")
    assert both.joints["B"].limits is None and not both.contacts
    one = _load(tmp_path, _arm(upper=f"+{far}"), limits="stops")
    stop = one.contacts["stop of B"]
    assert (stop.lowest, stop.highest) == (-1.5, None)


@pytest.mark.parametrize("element", ["pose", "mass", "xyz", "damping"])
@pytest.mark.parametrize("text", ["1.79769e+308", "1e400"])
def test_elsewhere_such_numbers_are_refused(tmp_path, element, text):
    whole = _arm()
    begin = whole.index(f"<{element}>") + len(element) + 2
    with pytest.raises(FileError, match=rf"model.sdf:\d+: <{element}> holds {text[:2]}"):
        _load(tmp_path, whole[:begin] + whole[begin:].replace(whole[begin : whole.index("<", begin)], text, 1))


def test_what_is_said_twice_is_refused(tmp_path):
    with pytest.raises(FileError, match="model.sdf:2: <mass> stands twice"):
        _load(tmp_path, _arm().replace("<mass>2</mass>", "<mass>2</mass><mass>3</mass>"))


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_text_is_the_number_that_it_says_or_refused_with_its_place(tmp_path, data):
    tail = data.draw(
        st.sampled_from(["\n", "\t", "kg", "_0", "e1", ",5", "nan", "0x", "\u0661", "."]) | st.text("0123e+-. ", max_size=3)
    )
    whole = _arm().replace("<mass>2</mass>", f"<mass>2{tail}</mass>")
    words = f"2{tail}".split()
    if len(words) != 1 or number(words[0]) is None:
        with pytest.raises(FileError, match="model.sdf:2: <mass> needs a number"):
            _load(tmp_path, whole)
    elif number(words[0]) <= 1e20:
        assert _load(tmp_path, whole).bodies["a"].mass == float(words[0])
