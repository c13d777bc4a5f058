"""SDFormat worlds: several, nested, static and included models against the same mechanism in one model."""

import warnings
from math import pi

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.system import random_state
from gauss.system.frames import relative

SAME = 1e-12  # relative: the same numbers, but for rounding of the poses that are composed

MASS = "<inertial><mass>2</mass><inertia><ixx>0.2</ixx><iyy>0.3</iyy><izz>0.4</izz></inertia></inertial>"
HINGE = '<joint name="{}" type="revolute"><parent>{}</parent><child>{}</child><axis><xyz>0 1 0</xyz></axis></joint>'
UPPER = f'<link name="a"><pose>0 0 1 0.1 0 0</pose>{MASS}</link>' + HINGE.format("A", "world", "a")
LOWER = f'<link name="b"><pose>{{}}</pose>{MASS}</link>'


def _load(folder, text, **options):
    (folder / "world.sdf").write_text(f'<sdf version="1.10">{text}</sdf>')
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return gauss.load(folder / "world.sdf", **options)


def _world(*parts) -> str:
    return f'<world name="w">{"".join(parts)}</world>'


def _model(name: str, *parts, more: str = "") -> str:
    return f'<model name="{name}" {more}>{"".join(parts)}</model>'


def _included(folder, name: str, *parts, more: str = "") -> None:
    (folder / name).mkdir(parents=True)
    (folder / name / "model.sdf").write_text(f'<sdf version="1.10">{_model("as it was", *parts, more=more)}</sdf>')


WHOLE = _model("m", "<pose>1 2 3 0.1 0.2 0.3</pose>", UPPER, LOWER.format("0.5 0 0.4 0 0.2 0"), HINGE.format("B", "a", "b"))
TURNED = "<pose>0.5 0 0.4 0 0.2 0</pose>"
AS_WRITTEN = {  # the same two links, b in another model or scope
    "nested": _model(
        "m", "<pose>1 2 3 0.1 0.2 0.3</pose>", UPPER, _model("n", TURNED, LOWER.format("")), HINGE.format("B", "a", "n::b")
    ),
    "by its model": _model(
        "m", "<pose>1 2 3 0.1 0.2 0.3</pose>", UPPER, _model("n", TURNED, LOWER.format("")), HINGE.format("B", "a", "n")
    ),
    "placed by a frame": _model(
        "m",
        "<pose>1 2 3 0.1 0.2 0.3</pose>",
        UPPER,
        _model("n", TURNED, LOWER.format("0 0 0.2 0 0 0"), more='placement_frame="b"'),
        HINGE.format("B", "a", "n::b"),
    ),
    "relative to a link": _model(
        "m",
        "<pose>1 2 3 0.1 0.2 0.3</pose>",
        UPPER,
        _model("n", '<pose relative_to="f"/>', LOWER.format("")),
        f'<frame name="f" attached_to="a"><pose relative_to="__model__">{TURNED[6:-7]}</pose></frame>',
        HINGE.format("B", "__model__", "n::b"),
    ),
    "included": _model(
        "m", "<pose>1 2 3 0.1 0.2 0.3</pose>", UPPER, f"<include><uri>model://leg</uri><name>n</name>{TURNED}</include>",
        HINGE.format("B", "a", "n::b"),
    ),
    "merged": _model(
        "m", "<pose>1 2 3 0.1 0.2 0.3</pose>", UPPER, f'<include merge="true"><uri>leg</uri>{TURNED}</include>',
        HINGE.format("B", "a", "b"),
    ),
}  # fmt: skip


def _accelerations(scene):
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(1))
    return gauss.solve(gauss.assemble(system, state)).qdd


@pytest.mark.parametrize("name", AS_WRITTEN)
def test_scopes_are_one_mechanism(tmp_path, name):
    expected = _accelerations(_load(tmp_path, WHOLE))
    _included(tmp_path / "models", "leg", LOWER.format(""))
    found = _accelerations(_load(tmp_path, AS_WRITTEN[name]))
    assert found == pytest.approx(expected, rel=SAME)


def test_models_of_a_world_move_by_themselves(tmp_path):
    still = _model("ground_plane", "<static>true</static>", '<link name="top"><pose>0 0 0.5 0 0 0</pose></link>')
    box = _model("box", "<pose>0 0 4 0 0 0</pose>", f'<link name="l">{MASS}</link>')
    scene = _load(tmp_path, _world(still, WHOLE, box, '<frame name="mark"><pose>1 0 0 0 0 0</pose></frame>'))
    assert set(scene.bodies) == {"m::a", "m::b", "box::l"} and scene.joints["box::l is free"].kind == "free"
    assert scene.frames["ground_plane::top"].body == "ground" and scene.frames["mark"].position == (1, 0, 0)
    assert scene.gravity == (0.0, 0.0, -9.8) and scene.name == "w"
    alone = _load(tmp_path, _world(WHOLE))
    system = gauss.compile_scene(scene)
    states = gauss.compile_scene(alone).reference
    found = gauss.solve(gauss.assemble(system, system.reference)).qdd
    expected = gauss.solve(gauss.assemble(gauss.compile_scene(alone), states)).qdd
    joints = [system.joint(name).v.start for name in ("m::A", "m::B")]
    assert found[joints] == pytest.approx(expected, rel=SAME)
    assert found[system.joint("box::l is free").v] == pytest.approx([0, 0, -9.8, 0, 0, 0], abs=1e-12)


def test_joints_of_a_world_bind_models_and_static_ones_are_ground(tmp_path):
    still = _model("wall", "<static>true</static>", '<link name="l"/>')
    boxes = (_model(name, f'<link name="l">{MASS}</link>') for name in ("one", "two"))
    joints = HINGE.format("J", "wall", "one") + HINGE.format("K", "one", "two::l")
    scene = _load(tmp_path, _world(still, *boxes, joints))
    assert [(joint.parent, joint.child) for joint in scene.joints.values()] == [("ground", "one::l"), ("one::l", "two::l")]


def test_gravity_of_old_worlds_stands_with_the_solver(tmp_path):
    scene = _load(tmp_path, _world("<physics><gravity>0 1 -2</gravity></physics>", WHOLE))
    assert scene.gravity == (0.0, 1.0, -2.0)


def test_links_without_gravity_do_not_fall(tmp_path):
    scene = _load(tmp_path, _model("m", f'<link name="l"><gravity>false</gravity>{MASS}</link>'))
    assert _accelerations(scene)[:3] == pytest.approx(np.zeros(3), abs=1e-12)


def _solid(shape: str, pose: str = "") -> str:
    return f'<collision name="c">{pose}<geometry>{shape}</geometry></collision>'


R, LENGTH = 0.2, 0.5
SOLIDS = {  # volume, moments at unit density about the centre
    "<box><size>0.2 0.4 0.6</size></box>": (0.048, 0.004 * np.array([0.52, 0.40, 0.20])),
    f"<sphere><radius>{R}</radius></sphere>": (4 / 3 * pi * R**3, 8 / 15 * pi * R**5 * np.ones(3)),
    f"<cylinder><radius>{R}</radius><length>{LENGTH}</length></cylinder>": (
        pi * R**2 * LENGTH,
        pi * R**2 * LENGTH * np.array([R**2 / 4 + LENGTH**2 / 12] * 2 + [R**2 / 2]),
    ),
    "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>": (0.008 * pi, 0.0016 * pi * np.array([0.13, 0.10, 0.05])),
}


@pytest.mark.parametrize("shape", SOLIDS)
def test_inertia_of_solids(tmp_path, shape):
    volume, moments = SOLIDS[shape]
    link = f'<link name="l"><inertial auto="true"><density>300</density></inertial>{_solid(shape)}</link>'
    body = _load(tmp_path, _model("m", link)).bodies["l"]
    assert body.mass == pytest.approx(300 * volume) and body.inertia[:3] == pytest.approx(300 * moments)


def test_a_capsule_is_a_cylinder_and_a_ball_in_halves(tmp_path):
    """Of slices: m = ρ ∫ π r² dz, J_z = ρ ∫ π r⁴/2 dz, J_x = J_z/2 + ρ ∫ π r² z² dz."""
    shape = _solid(f"<capsule><radius>{R}</radius><length>{LENGTH}</length></capsule>")
    body = _load(tmp_path, _model("m", f'<link name="l"><inertial auto="true"/>{shape}</link>')).bodies["l"]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    parts = [(0.5 * LENGTH * nodes, 0.5 * LENGTH * weights, np.full(20, R**2))]
    tip = 0.5 * R * (nodes + 1.0)
    parts.append((LENGTH / 2 + tip, R * weights, R**2 - tip**2))  # both ends
    integral = lambda f: 1000 * sum(w @ f(z, square) for z, w, square in parts)  # noqa: E731
    J_z = integral(lambda z, square: pi * square**2 / 2)
    assert body.mass == pytest.approx(integral(lambda z, square: pi * square))
    J_x = J_z / 2 + integral(lambda z, square: pi * square * z**2)
    assert body.inertia[:3] == pytest.approx([J_x, J_x, J_z])


def test_inertia_of_several_solids_is_that_of_their_bodies_together(tmp_path):
    box, ball = list(SOLIDS)[:2]
    poses = "<pose>0.3 0 0.1 0.2 0.3 0</pose>", "<pose>-0.1 0.2 0 0 0 0</pose>"
    auto = '<inertial auto="true"/>'
    both = _load(tmp_path, _model("m", f'<link name="l">{auto}{_solid(box, poses[0])}{_solid(ball, poses[1])}</link>'))
    links = [
        f'<link name="{k}">{pose}{auto}{_solid(shape)}</link>'
        for k, shape, pose in zip("ab", (box, ball), poses, strict=True)
    ]
    weld = '<joint name="W" type="fixed"><parent>a</parent><child>b</child></joint>'
    apart = _load(tmp_path, _model("m", *links, weld))
    one, parts = both.bodies["l"], [apart.bodies[name] for name in "ab"]
    mass = sum(part.mass for part in parts)
    com = sum(part.mass * np.array(part.position) for part in parts) / mass
    J = np.zeros((3, 3))
    for part in parts:
        axes, d = relative(apart, "ground", part.name)[0], np.array(part.position) - com
        J += axes @ np.diag(part.inertia[:3]) @ axes.T + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    assert one.mass == pytest.approx(mass) and one.com == pytest.approx(com)
    assert one.inertia == pytest.approx([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]], abs=1e-12)


def test_a_screw_of_the_former_pitch_is_left_handed(tmp_path):
    screw = (
        '<joint name="S" type="screw"><parent>world</parent><child>l</child><axis/><thread_pitch>-4</thread_pitch></joint>'
    )
    assert _load(tmp_path, _model("m", f'<link name="l">{MASS}</link>', screw)).joints["S"].pitch == 0.25


def test_a_joint_of_one_angle_is_locked(tmp_path):
    axis = "<axis><xyz>0 1 0</xyz><limit><lower>0.3</lower><upper>0.3</upper></limit></axis>"
    text = _model("m", UPPER.replace("<axis><xyz>0 1 0</xyz></axis>", axis))
    system = gauss.compile_scene(_load(tmp_path, text))
    assert system.initial_state().q == pytest.approx([0.3])


def test_models_are_found_below_the_folder_that_is_named(tmp_path):
    _included(tmp_path / "models" / "some", "leg", LOWER.format(""))
    (tmp_path / "models" / "some" / "leg" / "model.config").write_text(
        '<model><sdf version="1.4">old.sdf</sdf><sdf version="1.10">model.sdf</sdf></model>'
    )
    (tmp_path / "worlds").mkdir()
    text = _world("<include><uri>https://server/1.0/owner/models/Leg/3</uri><static>0</static></include>")
    with pytest.raises(FileError, match=r"world.sdf:1: includes .*on a server; get a copy"):
        _load(tmp_path / "worlds", text)
    assert list(_load(tmp_path / "worlds", text, root_folder=tmp_path).bodies) == ["b"]


def test_models_that_are_not_there_are_left_out_on_request(tmp_path):
    text = _world(WHOLE, "<include><uri>https://server/models/tree</uri></include>")
    (tmp_path / "world.sdf").write_text(f'<sdf version="1.10">{text}</sdf>')
    with pytest.warns(NotImportedWarning, match="included models that are not there: https://server/models/tree"):
        scene = gauss.load(tmp_path / "world.sdf", missing="left out")
    assert list(scene.bodies) == ["a", "b"]
    with pytest.raises(FileError, match="missing.*'left out'"):
        gauss.load(tmp_path / "world.sdf", missing="gone")


def test_comments_and_declarations_that_xml_forbids_are_read(tmp_path):
    text = f'\n<?xml version="1.0"?>\n<!-- a -- b --->\n<sdf version="1.10">{WHOLE}</sdf>'
    (tmp_path / "world.sdf").write_text(text)
    assert len(gauss.load(tmp_path / "world.sdf").bodies) == 2


REFUSED = {
    "two worlds": (_world(WHOLE) + "<world/>", "one world"),
    "no model": (_world(), "no model in it"),
    "nothing that moves": (
        _world(*(_model(k, "<static>1</static>", '<link name="l"/>') for k in "ab")),
        "all models are static",
    ),
    "root of several": (_world(WHOLE, WHOLE.replace('"m"', '"n"')), "one model that moves; this has 2"),
    "population": (_world(WHOLE, "<population/>"), "<population> is not read"),
    "a state": (_world(WHOLE, "<state/>"), "<state> is not read"),
    "an unknown part of a world": (_world(WHOLE, "<magic/>"), "<magic> of world 'w' is not modelled"),
    "a name of another scope": (_world(WHOLE, HINGE.format("J", "world", "m::c")), "no link, joint or frame 'c'"),
    "a model twice": (_world(WHOLE, WHOLE), "'m' of <model> is taken by <model>"),
    "a frame of itself": (_model("m", UPPER, '<frame name="f" attached_to="f"/>'), "attached to itself"),
    "a file outside": ("<include><uri>../../secret.sdf</uri></include>", "no such model"),
    "no uri": ("<include/>", "without <uri>"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_world_is_refused_by_line(tmp_path, name):
    text, words = REFUSED[name]
    with pytest.raises(FileError, match=f"world.sdf(:1)?: .*{words}"):
        _load(tmp_path, text, root="free")


def test_files_outside_are_refused(tmp_path):
    _included(tmp_path, "leg", LOWER.format(""))
    (tmp_path / "worlds").mkdir()
    text = "<include><uri>../leg</uri></include>"
    with pytest.raises(FileError, match="names the file .* outside its own folder"):
        _load(tmp_path / "worlds", text)
    assert list(_load(tmp_path / "worlds", text, root_folder=tmp_path).bodies) == ["b"]


def test_includes_that_repeat_or_multiply_are_refused(tmp_path, monkeypatch):
    _included(tmp_path, "leg", "<include><uri>leg</uri></include>", LOWER.format(""))
    with pytest.raises(FileError, match="includes model.sdf"):
        _load(tmp_path, "<include><uri>leg</uri></include>")
    monkeypatch.setattr("gauss.io.sdf.includes.MOST_INCLUDES", 20)
    for k in range(6):
        twice = "".join(f"<include><uri>{k + 1}</uri><name>{n}</name></include>" for n in "ab")
        _included(tmp_path, f"n{k}", twice.replace(">" + str(k + 1) + "<", f">n{k + 1}<"))
    _included(tmp_path, "n6", LOWER.format(""))
    with pytest.raises(FileError, match="more than 20 models are included"):
        _load(tmp_path, "<include><uri>n0</uri></include>")
