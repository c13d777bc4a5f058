"""Loops and couplings of URDF+, and the YAML file of parallel robots: their meaning, refusals, round trips."""

import json

import numpy as np
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.errors import AssemblyError, FileError, UnphysicalInertiaWarning
from gauss.io.urdf.write import to_urdf

ALIKE = 1e-12  # relative: the same equations, in other coordinates
CLOSED = 1e-10  # of the size of the scene
MOMENTS = '<inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
INERTIAL = '<inertial><origin xyz="{x} 0 0"/><mass value="1"/>' + MOMENTS + "</inertial>"
LINK = '<link name="{}">' + INERTIAL.format(x=0.5) + "</link>"
HINGE = (
    '<joint name="{0}" type="continuous"{3}><parent link="{1}"/><child link="{0}_link"/><origin xyz="{2}"/>'
    '<axis xyz="0 1 0"/></joint>'
)
LOOP = (
    '<loop name="closing" type="{kind}"><predecessor link="{one}"><origin xyz="{x} 0 0"/></predecessor>'
    '<successor link="{other}"><origin xyz="1 0 0"/></successor><axis xyz="0 1 0"/></loop>'
)
COUPLING = (
    '<coupling name="belt"{kind}><predecessor link="{one}"/><successor link="{other}"/><ratio value="{ratio}"/></coupling>'
)


FAR, NEAR = "1.2 0 0.4", "0.6 0 0.8"  # points of the base, the second at the length of a link from the first


def robot(*more: str, independent: str = "", at: str = FAR) -> str:
    """Links crank, rod on the crank, and rocker, hung from two points of the base."""
    flag = f' independent="{independent}"' if independent else ""
    links = "".join(LINK.format(f"{name}_link") for name in ("crank", "rod", "rocker"))
    joints = HINGE.format("crank", "base", "0 0 0", flag) + HINGE.format("rod", "crank_link", "1 0 0", "")
    joints += HINGE.format("rocker", "base", at, "")
    return f'<robot name="r">\n<link name="base"/>{links}{joints}\n{"".join(more)}\n</robot>'


def loaded(folder, text: str, beside: str | None = None, **options) -> gauss.Scene:
    """Scene of a file, with a YAML file beside it."""
    path = folder / "robot.urdf"
    path.write_text(text)
    if beside is not None:
        (folder / "robot.yaml").write_text(beside)
    return gauss.load(path, **options)


def four_bar_of_points() -> gauss.Scene:
    """The same mechanism without URDF+: the ends of rod and rocker coincide in the plane."""
    scene = gauss.Scene("by hand")
    moments = {"mass": 1.0, "inertia": (0.01, 0.1, 0.1), "com": (0.5, 0, 0)}
    scene.body("crank", **moments)
    scene.body("rod", **moments, position=(1, 0, 0))
    scene.body("rocker", **moments, position=(1.2, 0, 0.4))
    scene.revolute("crank", "ground", "crank", axis=(0, 1, 0))
    scene.revolute("rod", "crank", "rod", at=(1, 0, 0), axis=(0, 1, 0))
    scene.revolute("rocker", "ground", "rocker", at=(1.2, 0, 0.4), axis=(0, 1, 0))
    scene.coincident("closing", "rod", "rocker", at=(1, 0, 0), other_at=(1, 0, 0))
    return scene


def accelerations(scene: gauss.Scene, start: dict) -> dict[str, float]:
    """Accelerations of hinges at a state near a start."""
    system = gauss.compile_scene(scene)
    q, v = system.reference.q, np.zeros(system.n_v)
    for name, value in start.items():
        q[system.joint(name).q] = value
    v[system.column("crank")] = 1.0
    state = system.initial_state(q, v)
    found = system.accelerations(state)
    return {name: found[system.column(name)] for name in start}


@pytest.mark.slow
def test_a_loop_closes_frames_that_do_not_meet_in_the_file(tmp_path):
    scene = loaded(tmp_path, robot(LOOP.format(kind="revolute", one="rod_link", other="rocker_link", x=1)))
    start = {"crank": 0.3, "rod": 0.5, "rocker": 0.2}
    expected = accelerations(four_bar_of_points(), start)
    assert accelerations(scene, start) == pytest.approx(expected, rel=1e-9)  # the pose is found to CLOSED
    system = gauss.compile_scene(scene)
    assert sum(one.n_loop_constraints for one in system.subsystems) == 2


@pytest.mark.slow
@pytest.mark.parametrize("kind, at", [("revolute", FAR), ("spherical", FAR), ("fixed", NEAR), ("prismatic", FAR)])
def test_freedoms_of_loops(tmp_path, kind, at):
    loop = LOOP.format(kind=kind, one="rod_link", other="rocker_link", x=1)
    scene = loaded(tmp_path, robot(loop.replace("0 1 0", "1 0 0") if kind == "prismatic" else loop, at=at))
    assert gauss.mobility(gauss.compile_scene(scene)).freedoms == 1


@pytest.mark.slow
def test_a_weld_that_the_lengths_do_not_allow_is_refused_with_its_residual(tmp_path):
    scene = loaded(tmp_path, robot(LOOP.format(kind="fixed", one="rod_link", other="rocker_link", x=1)))
    with pytest.raises(AssemblyError) as refused:
        gauss.compile_scene(scene).initial_state()
    assert list(refused.value.violations) == ["closing"] and refused.value.state is not None


def test_a_coupling_ties_the_sums_of_two_chains(tmp_path):
    scene = loaded(
        tmp_path, robot(COUPLING.format(kind=' type="rolling"', one="rod_link", other="rocker_link", ratio="-2.5"))
    )
    system = gauss.compile_scene(scene)
    state = system.initial_state(q=[0.3, 0.4, 1.0], v=[1.0, 2.0, 0.0])
    place = system.column
    for values in (state.q, state.v, system.accelerations(state)):
        sums = -2.5 * (values[place("crank")] + values[place("rod")]), values[place("rocker")]
        assert sums[0] == pytest.approx(sums[1], abs=CLOSED)


def test_a_coupling_of_two_joints_is_a_ratio_of_their_rates(tmp_path):
    scene = loaded(tmp_path, robot(COUPLING.format(kind="", one="crank_link", other="rocker_link", ratio="6")))
    (coupling,) = scene.couplings.values()
    assert (coupling.driver, coupling.driven, coupling.ratio) == ("crank", "rocker", 6.0)


@pytest.mark.parametrize("value", ["true", "False"])
def test_independent_does_not_change_the_motion(tmp_path, value):
    assert loaded(tmp_path, robot(independent=value)) == loaded(tmp_path, robot())


GOOD = {"kind": "revolute", "one": "rod_link", "other": "rocker_link", "x": 1}
TIED = {"kind": "", "one": "rod_link", "other": "rocker_link", "ratio": "2"}
REFUSED = {
    "unknown link": (
        LOOP.format(**GOOD | {"one": "rodd"}),
        "robot.urdf:3: loop 'closing': predecessor: no link or frame 'rodd'",
    ),
    "unknown type": (LOOP.format(**GOOD | {"kind": "screw"}), "robot.urdf:3: <loop> of type 'screw'"),
    "one body": (LOOP.format(**GOOD | {"other": "rod_link"}), "both frames are on 'rod_link'"),
    "no successor": ('<loop name="c" type="fixed"><predecessor link="rod_link"/></loop>', "has no <successor>"),
    "two axes": (LOOP.format(**GOOD).replace("<axis", '<axis xyz="1 0 0"/><axis'), "stands twice"),
    "strange child": (LOOP.format(**GOOD).replace("<axis", "<damping/><axis"), "<loop> has no <damping>"),
    "no number": (LOOP.format(**GOOD).replace('xyz="1 0 0"', 'xyz="1 0 x"', 1), "<origin> xyz: expected 3 numbers"),
    "no name": (LOOP.format(**GOOD).replace('name="closing" ', ""), "<loop> has no name"),
    "closed twice": (
        LOOP.format(**GOOD) + LOOP.format(**GOOD).replace("closing", "again"),
        "closed there by 'closing' already",
    ),
    "name of a joint": (LOOP.format(**GOOD).replace("closing", "crank"), "the name is taken"),
    "no axis": (LOOP.format(**GOOD).replace('xyz="0 1 0"', 'xyz="0 0 0"'), "axis"),
    "ratio": (COUPLING.format(**TIED | {"ratio": "two"}), "<ratio> value: expected a number"),
    "ratio of 0": (COUPLING.format(**TIED | {"ratio": "0"}), "must not be 0"),
    "no ratio": (COUPLING.format(**TIED).replace('<ratio value="2"/>', ""), "has no <ratio>"),
    "coupled link": (COUPLING.format(**TIED | {"other": "rokcer"}), "coupling 'belt': successor: no link 'rokcer'"),
    "own ancestor": (COUPLING.format(**TIED | {"other": "crank_link"}), "no joint moves the successor 'crank_link'"),
    "kind of coupling": (COUPLING.format(**TIED | {"kind": ' type="sliding"'}), "<coupling> of type 'sliding'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_is_told_with_its_place(tmp_path, case):
    text, words = REFUSED[case]
    with pytest.raises(FileError) as refused:
        loaded(tmp_path, robot(text))
    assert words in str(refused.value) and "robot.urdf:3" in str(refused.value)


def test_independent_must_be_true_or_false(tmp_path):
    with pytest.raises(FileError, match="independent: expected true or false"):
        loaded(tmp_path, robot(independent="maybe"))


# Beside the file: frames held by fixed joints, and joints of other types.
TIP = (
    '<link name="{0}"/><joint name="{0} fixed" type="fixed"><parent link="{1}"/><child link="{0}"/>'
    '<origin xyz="1 0 0"/></joint>'
)
TIPS = TIP.format("tip_A", "rod_link") + TIP.format("tip_B", "rocker_link")


def yaml_of(**entries) -> str:
    """Text of the file; JSON is YAML."""
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in entries.items())


PAIR = {"closed_loop": [["tip_A", "tip_B"]]}


@pytest.mark.parametrize("kind, at", [("3d", FAR), ("6D", NEAR)])
def test_loops_of_the_file_beside(tmp_path, kind, at):
    scene = loaded(tmp_path, robot(TIPS, at=at), yaml_of(**PAIR, type=[kind], name_mot=["crank"]))
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    motion = kinematics(system, state)
    assert motion.position("tip_A") == pytest.approx(motion.position("tip_B"), abs=CLOSED)
    if kind == "6D":
        assert motion.rotation("tip_A") == pytest.approx(motion.rotation("tip_B"), abs=CLOSED)
    assert gauss.mobility(system, state).freedoms == 1 and list(scene.inputs) == ["crank"]


def test_joints_of_other_types(tmp_path):
    beside = yaml_of(**PAIR, type=["3d"], joint_name=["rod", "rocker"], joint_type=["SPHERICAL", "UJOINT_ZX"])
    scene = loaded(tmp_path, robot(TIPS), beside)
    assert scene.joints["rod"].kind == "ball" and {"rocker_Z", "rocker_X"} <= set(scene.joints)
    system = gauss.compile_scene(scene)
    assert gauss.mobility(system).freedoms == 1 + 3 + 2 - 3
    fixed = loaded(tmp_path, robot(TIPS), yaml_of(closed_loop=[], type=[], joint_name=["rod"], joint_type=["FIXED"]))
    assert "rod" not in fixed.joints and "rod_link" in fixed.frames


BESIDE = {
    "no such frame": (
        yaml_of(closed_loop=[["tip_A", "tip_C"]], type=["6d"]),
        "robot.yaml:1: loop 'tip_A to tip_C': successor",
    ),
    "unknown type": (yaml_of(**PAIR, type=["5d"]), "robot.yaml:2: type '5d'"),
    "one frame": (yaml_of(closed_loop=[["tip_A"]], type=["6d"]), "expected pairs of frames"),
    "no list": (yaml_of(closed_loop="tip_A", type=["6d"]), "expected a list"),
    "types missing": (yaml_of(**PAIR), "closed_loop has 1 entries, type 0"),
    "same pair twice": (
        yaml_of(closed_loop=[["tip_A", "tip_B"], ["tip_B", "tip_A"]], type=["6d", "6d"]),
        "already; keep one",
    ),
    "no such joint": (yaml_of(**PAIR, type=["3d"], joint_name=["rot"], joint_type=["FIXED"]), "joint_name: no joint 'rot'"),
    "unknown joint type": (yaml_of(**PAIR, type=["3d"], joint_name=["rod"], joint_type=["BALL"]), "joint_type 'BALL'"),
    "joint twice": (
        yaml_of(**PAIR, type=["3d"], joint_name=["rod", "rod"], joint_type=["FIXED", "FIXED"]),
        "'rod' stands twice",
    ),
    "fixed already": (
        yaml_of(**PAIR, type=["3d"], joint_name=["tip_A fixed"], joint_type=["SPHERICAL"]),
        "is fixed in the URDF",
    ),
    "no such motor": (yaml_of(**PAIR, type=["3d"], name_mot=["motor"]), "name_mot"),
    "unknown key": (yaml_of(**PAIR, type=["3d"], springs=[1]), "unknown key 'springs'"),
    "key twice": (yaml_of(**PAIR) + yaml_of(**PAIR, type=["3d"]), "'closed_loop' stands twice"),
    "alias": ("closed_loop: &a [[tip_A, tip_B]]\ntype: *a\n", "anchors, aliases and tags"),
    "tag": ("closed_loop: !!python/object/apply:os.system ['true']\n", "anchors, aliases and tags"),
    "nested lists": ("closed_loop: " + "[" * 3000 + "]" * 3000, "nested"),
    "no YAML": ("closed_loop: [\n", "not YAML"),
    "a name that is a list": (yaml_of(closed_loop=[[["tip_A"], "tip_B"]], type=["6d"]), "expected a name"),
}


@pytest.mark.parametrize("case", BESIDE)
def test_what_the_file_beside_may_not_say(tmp_path, case):
    text, words = BESIDE[case]
    with pytest.raises(FileError) as refused:
        loaded(tmp_path, robot(TIPS), text)
    assert words in str(refused.value) and "robot.yaml" in str(refused.value)


@pytest.mark.parametrize("text", ["", "a: b\n", "- 1\n", "robots: {a: [1, 2]}\n"])
def test_files_of_other_tools_are_left_alone(tmp_path, text):
    assert len(loaded(tmp_path, robot(TIPS), text).joints) == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrong",
    [INERTIAL.format(x=0).replace('iyy="0.1"', 'iyy="1"'), INERTIAL.format(x=0).replace('mass value="1"', 'mass value="0"')],
)
def test_inertias_of_no_body_are_taken_on_request_only(tmp_path, wrong):
    text = robot().replace(INERTIAL.format(x=0.5), wrong, 1)
    with pytest.raises(FileError, match=r"robot.urdf:2: body 'crank_link'.*inertia='as given'"):
        loaded(tmp_path, text)
    with pytest.warns(UnphysicalInertiaWarning, match="'crank_link'"):
        scene = loaded(tmp_path, text, inertia="as given")
    assert [name for name, body in scene.bodies.items() if body.inertia_as_given] == ["crank_link"]
    assert gauss.crosscheck(scene).passed
    with pytest.raises(FileError, match="inertia must be one of"):
        loaded(tmp_path, text, inertia="any")


def test_negative_moments_are_refused_in_any_case(tmp_path):
    text = robot().replace('ixx="0.01"', 'ixx="-0.01"', 1)
    with pytest.raises(FileError, match="negative principal moment"):
        loaded(tmp_path, text, inertia="as given")


WRITTEN = {
    "hinge": (LOOP.format(**GOOD), None),
    "belt": (COUPLING.format(**TIED), None),
    "points": (TIPS, yaml_of(**PAIR, type=["3d"])),
    "weld": (TIPS, yaml_of(**PAIR, type=["6d"])),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WRITTEN)
def test_loops_are_written_as_they_are_read(tmp_path, case):
    more, beside = WRITTEN[case]
    scene = loaded(tmp_path, robot(more, at=NEAR if case == "weld" else FAR), beside)
    text, rest = to_urdf(scene)
    assert not rest and ("<loop" in text or "<coupling" in text)
    one = scene
    for name in ("first", "second"):
        other = gauss.load(gauss.save(one, tmp_path / f"{name}.urdf"))
        assert list(other.joints) == list(scene.joints) and len(other.relations) == len(scene.relations)
        systems = [gauss.compile_scene(each) for each in (scene, other)]
        state = systems[0].initial_state()
        found = [gauss.solve(gauss.assemble(system, system.state(state.q, state.v))).qdd for system in systems]
        assert found[1] == pytest.approx(found[0], rel=ALIKE, abs=ALIKE * np.abs(found[0]).max())
        one = other
    assert gauss.load(gauss.save(scene, tmp_path / "scene.toml")) == scene
