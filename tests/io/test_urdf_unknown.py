"""What files hold beside URDF: ties are refused, misspelt elements too, the rest is named; harmless elements are let be."""

import warnings

import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROBOT = f"""<robot name="r">
<link name="base"/>
<link name="left">{INERTIAL}</link>
<link name="right">{INERTIAL}</link>
<joint name="l" type="continuous"><parent link="base"/><child link="left"/><axis xyz="0 0 1"/></joint>
<joint name="m" type="continuous"><parent link="base"/><child link="right"/><axis xyz="0 0 1"/></joint>
{{}}
</robot>"""
BOTH = '<a link="left"/><b link="right"/>'
TIES = {
    "loop of another dialect": '<closure name="c" type="revolute"><one link="left"/><other link="right"/></closure>',
    "joint of Drake": f'<drake:joint name="c" type="ball">{BOTH}</drake:joint>',
    "constraint of Drake": f"<drake:ball_constraint>{BOTH}</drake:ball_constraint>",
    "bushing of Drake": '<drake:linear_bushing_rpy><drake:bushing_frameA name="A"/></drake:linear_bushing_rpy>',
    "something of two links": f"<strut>{BOTH}</strut>",
    "something of two joints, as text": "<drive><first>l</first><second> m </second></drive>",
}
LET = [
    '<material name="grey"><color rgba="1 1 1 1"/></material>',
    f'<transmission name="t"><joint name="l"/><joint name="m"/>{BOTH}</transmission>',
    '<sensor name="s"><parent link="left"/></sensor>',
    '<gazebo reference="left"><mu1>0.5</mu1><turnGravityOff>false</turnGravityOff></gazebo>',
    '<gazebo><plugin filename="libgazebo_ros_control.so"><joint>l</joint><joint>m</joint></plugin></gazebo>',
    '<ros2_control name="c"><joint name="l"/><joint name="m"/></ros2_control>',
]
NAMED = {
    "<note> 'n'": '<note name="n"/>',
    "<group_state> 'g'": '<group_state name="g"><joint name="l" value="0"/><joint name="m" value="0"/></group_state>',
    "<plugin> 'libmimic_joint.so'": '<gazebo><plugin filename="libmimic_joint.so"><joint>l</joint></plugin></gazebo>',
    "<joint> 'c'": '<gazebo><joint name="c" type="ball"><parent>left</parent><child>right</child></joint></gazebo>',
    "<turnGravityOff>": '<gazebo reference="left"><turnGravityOff>true</turnGravityOff></gazebo>',
    "<springStiffness>": '<gazebo reference="l"><springStiffness>3</springStiffness></gazebo>',
}


def _path(folder, more: str, whole: str = ROBOT):
    path = folder / "robot.urdf"
    path.write_text(whole.format(more))
    return path


@pytest.mark.parametrize("tie", TIES)
def test_ties_are_refused_with_their_place_and_the_file_that_may_say_them(tmp_path, tie):
    with pytest.raises(
        FileError, match=rf"{TIES[tie][: TIES[tie].index('>')].split()[0].strip('>')}.*robot.urdf:7.*robot.loops.toml"
    ):
        gauss.load(_path(tmp_path, TIES[tie]))


@pytest.mark.parametrize("element", LET)
def test_harmless_elements_are_let_be(tmp_path, element):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(gauss.load(_path(tmp_path, element)).joints) == 2


@pytest.mark.parametrize("name", NAMED)
def test_what_is_not_read_is_named_with_its_place(tmp_path, name):
    with pytest.warns(NotImportedWarning, match=rf"not read.*{name} \(.*robot.urdf:7\)"):
        assert len(gauss.load(_path(tmp_path, NAMED[name])).joints) == 2


@pytest.mark.parametrize("tag, wrong", [("inertial", "Inertial"), ("axis", "axes"), ("joint", "joints"), ("mass", "Mass")])
def test_misspelt_elements_are_refused_with_their_place(tmp_path, tag, wrong):
    whole = ROBOT.replace(f"<{tag} ", f"<{wrong} ").replace(f"<{tag}>", f"<{wrong}>").replace(f"</{tag}>", f"</{wrong}>")
    with pytest.raises(FileError, match=rf"robot.urdf:\d: <{wrong}> of <\w+>: did you mean <{tag}>"):
        gauss.load(_path(tmp_path, "", whole))
