"""One number of a real model file is changed: what is read says what the file says, or the file is refused with the place.

The mutations are those of exporters, editors and locales. A number in another form is the same number; what is no number is
refused by element; what was not changed is read as before.
"""

import importlib.metadata
import re
import tomllib
import warnings
from functools import cache
from xml.etree import ElementTree

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gauss
from gauss.errors import GaussError, NotImportedWarning
from gauss.io.catalog import shipped
from gauss.io.numbers import numbers
from gauss.io.urdf.numbers import COUNTS
from gauss.io.urdf.robots import robot
from gauss.scene.toml import toml_text

ROBOTS = ("allegro_hand_description/urdf/allegro_left_hand", "panda", "solo12", "z1", "double_pendulum_simple", "laikago")
SAME = {"a new line": "{}\n", "blanks": "  {}  ", "a tab": "\t{}"}  # forms of the same numbers
OTHER = {"blank": "", "white": " \n", "unit": "{}kg", "hex": "0x10", "comma": "{},5", "infinite": "inf", "undefined": "nan"}
OTHER |= {"huge": "1e300", "beyond": "1e999", "one more": "{} 1", "a word": "one", "digits apart": "{}_0"}
READ = {"limits": "start", "resistance": True, "collisions": True}
SOME = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
# Numbers of SDFormat that a scene is made of, but limits, which may be infinite.
OF_SDF = {"pose": 6, "mass": 1, "ixx": 1, "ixy": 1, "iyy": 1, "izz": 1, "xyz": 3, "damping": 1, "spring_stiffness": 1}
OF_MJCF = '(?<=[a-z]=")[-.0-9][-+.0-9e ]*(?=")'
WALKER = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9"/>
<worldbody><body name="a" pos="0 0 1" euler="0 0.5 0">
<joint name="j" axis="0 0 1" damping="0.1" armature="0.3" stiffness="2" springref="0.2"/>
<geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0" density="500"/>
<body name="b" pos="0.5 0 0" quat="1 0.1 0 0"><joint name="k" axis="0 1 0.5" frictionloss="0.4"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="0.1 0.2 0.25"/></body></body></worldbody>
<actuator><position joint="j" kp="3"/><motor joint="k" gear="3" ctrlrange="-1 2"/></actuator></mujoco>"""


def _load(folder, ending: str, text: str, **options) -> str:
    """Scene of a text, as text."""
    path = folder / f"model{ending}"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return toml_text(gauss.load(path, **options))


def _refused(folder, ending: str, text: str, place: str, **options):
    with pytest.raises(GaussError, match=place) as caught:
        _load(folder, ending, text, **options)
    assert "Traceback" not in str(caught.value)


@cache
def _robot(name: str) -> str:
    return robot(name).read_text(encoding="utf-8")


@cache
def _public(ending: str) -> str:
    file = next(file for file in importlib.metadata.files("example-robot-data") if file.name == ending)
    return file.locate().read_text(encoding="utf-8")


def _changed(root, element, key: str | None, form: str) -> str:
    old = element.get(key) if key else element.text
    new = form.format(old)
    if key:
        element.set(key, new)
    else:
        element.text = new
    return ElementTree.tostring(root, encoding="unicode")


@pytest.mark.slow
@SOME
@given(name=st.sampled_from(ROBOTS), data=st.data())
def test_numbers_of_robots(tmp_path, name, data):
    root = ElementTree.fromstring(_robot(name))
    parts = [part for part in root if part.tag in ("link", "joint")]
    places = [(e, key) for part in parts for e in part.iter() for key in e.keys() if key in COUNTS.get(e.tag, {})]
    element, key = data.draw(st.sampled_from(places))
    form = data.draw(st.sampled_from([*SAME, *OTHER]))
    if form in SAME:
        text = _changed(root, element, key, SAME[form])
        assert _load(tmp_path, ".urdf", text, root="free", **READ) == _load(
            tmp_path, ".urdf", _robot(name), root="free", **READ
        )
        return
    if element.tag == "limit" and form == "huge":
        return  # no limit
    place = rf"model.urdf:\d+: <{element.tag}> {key}"
    _refused(tmp_path, ".urdf", _changed(root, element, key, OTHER[form]), place, root="free", **READ)


@pytest.mark.slow
@SOME
@given(data=st.data())
def test_numbers_of_a_model_in_sdformat(tmp_path, data):
    whole = _public("cassie_v2.sdf")
    root = ElementTree.fromstring(whole)
    links = [part for part in root.find(".//model") if part.tag in ("link", "joint")]
    still = {
        e for link in links for tag in ("visual", "collision", "sensor") for part in link.findall(tag) for e in part.iter()
    }
    places = [e for part in links for e in part.iter() if e.tag in OF_SDF and e not in still and (e.text or "").strip()]
    element = data.draw(st.sampled_from(places))
    form = data.draw(st.sampled_from([*SAME, *OTHER]))
    if element.tag == "pose" and form in ("blank", "white"):
        return  # which SDFormat takes for the identity
    if form in SAME:
        assert _load(tmp_path, ".sdf", _changed(root, element, None, SAME[form])) == _load(tmp_path, ".sdf", whole)
        return
    assert numbers(OTHER[form].format(element.text), OF_SDF[element.tag]) is None or form == "huge"
    _refused(tmp_path, ".sdf", _changed(root, element, None, OTHER[form]), rf"model.sdf:\d+: <{element.tag}>")


@SOME
@given(data=st.data())
def test_numbers_of_a_model_in_mjcf(tmp_path, data):
    pytest.importorskip("mujoco")
    spans = [match.span() for match in re.finditer(OF_MJCF, WALKER)]
    begin, end = data.draw(st.sampled_from(spans))
    form = data.draw(st.sampled_from([*SAME, *OTHER]))
    if form in SAME:
        text = WALKER[:begin] + SAME[form].format(WALKER[begin:end]) + WALKER[end:]
        assert _load(tmp_path, ".xml", text) == _load(tmp_path, ".xml", WALKER)
        return
    if form in ("hex", "one more"):
        return  # MuJoCo reads the first, and takes several numbers in many places
    mutated = OTHER[form].format(WALKER[begin:end])
    if form == "infinite" and "range" in WALKER[begin - 12 : begin]:
        return
    _refused(tmp_path, ".xml", WALKER[:begin] + mutated + WALKER[end:], "model.xml")


@SOME
@given(name=st.sampled_from(sorted(shipped())), data=st.data())
def test_numbers_of_shipped_scenes(tmp_path, name, data):
    """TOML has its own numbers: what it takes for one is one, but inf and nan are none of a mechanism."""
    lines = shipped()[name].read_text(encoding="utf-8").splitlines()
    whole = "\n".join(line.partition("#")[0] for line in lines)
    spans = [match.span() for match in re.finditer(r"(?<=[=\[,] )-?\d+\.\d+", whole)]
    if not spans:
        return
    begin, end = data.draw(st.sampled_from(spans))
    form = data.draw(st.sampled_from(["unit", "comma", "infinite", "undefined", "beyond", "a word", "blank"]))
    text = whole[:begin] + OTHER[form].format(whole[begin:end]) + whole[end:]
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        _refused(tmp_path, ".toml", text, r"model.toml: .*line \d+")
        return
    try:
        read = _load(tmp_path, ".toml", text)
    except GaussError as error:
        assert re.search("model.toml: ", str(error))
    else:  # a comma makes two numbers of one, which only lists of any length take
        assert form in ("comma", "blank") and read != _load(tmp_path, ".toml", whole)
