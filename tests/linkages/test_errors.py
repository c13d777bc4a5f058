"""Linkages that cannot be: each is refused with the reason, and nothing wrong is returned."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gauss
from gauss.errors import FileError, GaussError, LinkageError, NearSingularWarning, SceneError, SimulationError
from gauss.io.catalog import linkage_files as shipped
from gauss.linkages import LinkJoint

NUMBERS = st.one_of(st.floats(), st.integers(), st.text(max_size=3), st.none(), st.booleans())


def _bar(r1=0.5, r2=0.6, r3=0.4, r4=0.9):
    linkage = gauss.Linkage("bar")
    for name in ("crank", "coupler", "rocker"):
        linkage.link(name, 1.0, 0.1)
    linkage.revolute("A", "ground", "crank")
    linkage.revolute("B", "crank", "coupler", at=(r1, 0))
    linkage.revolute("C", "rocker", "coupler", at=(r3, 0), child_at=(r2, 0))
    linkage.revolute("D", "ground", "rocker", at=(r4, 0))
    linkage.drive("A", speed=2.0)
    return linkage


def test_positions_that_do_not_close_say_which_do():
    """|B − D| = r2 + r3 at the ends: r1² + r4² − 2 r1 r4 cos θ = (r2 + r3)²."""
    linkage = _bar()
    end = np.arccos((0.25 + 0.81 - 1.0) / 0.9)
    ((low, high),) = linkage.closing_ranges()
    assert (low, high) == pytest.approx((-end, end), abs=1e-12)
    with pytest.raises(LinkageError, match=r"RRR.*\(coupler, rocker\).*3.14") as error:
        linkage.cycle()
    assert "too short to reach by 0.4 m" in str(error.value)
    assert f"from {low:.6g} rad ({np.degrees(low):.4g}°) to {high:.6g} rad" in str(error.value)
    linkage.cycle(np.linspace(0.99 * low, 0.99 * high, 50))


@pytest.mark.parametrize(
    "linkage, words",
    [
        (_bar(r2=2.5), "too long to fold by"),
        (_bar(r1=0.1, r2=0.1, r3=0.1, r4=2.0), "It closes at no crank angle: check the lengths"),
    ],
)
def test_lengths_that_do_not_close(linkage, words):
    with pytest.raises(LinkageError, match=words):
        linkage.cycle([np.pi / 3])


def test_a_short_rod_and_a_far_guide():
    linkage = gauss.load_linkage("slider_crank")
    guide = linkage.joints.pop("D")
    linkage.prismatic("D", guide.parent, guide.child, at=(0.0, 1.0))
    ((low, high),) = linkage.closing_ranges()
    assert (low, high - 2 * np.pi) == pytest.approx((np.arcsin(-0.5), -np.pi - np.arcsin(-0.5)), abs=1e-12)
    with pytest.raises(LinkageError, match="too short to reach its guide by 0.2 m"):
        linkage.cycle([-np.pi / 2])


def test_an_offset_that_the_block_cannot_take():
    linkage = gauss.load_linkage("shaper")
    guide = linkage.joints["P23"]
    linkage.joints["P23"] = LinkJoint("P23", "prismatic", guide.parent, guide.child, at=(0.0, 0.4))
    with pytest.raises(LinkageError, match="pivot.*offset"):
        linkage.cycle([-np.pi / 2])


def test_near_singular_positions_are_flagged_and_singular_ones_refused():
    linkage = _bar()
    end = linkage.closing_ranges()[0][1]
    with pytest.warns(NearSingularWarning, match="condition number 3.*e\\+04"):
        linkage.cycle([end - 1e-9])
    with pytest.raises(LinkageError, match="too near a singular position"):  # half a unit of the angle is 1e-6 of the rest
        linkage.cycle([end - 1e-10])
    (kappa,) = linkage.cycle([0.1]).condition().values()
    assert 1.0 <= kappa[0] < 100.0
    parallelogram = _bar(0.5, 1.0, 0.5, 1.0)
    with pytest.raises(LinkageError, match="singular at crank angle 0 rad"):
        parallelogram.cycle([0.0])
    linkage = gauss.load_linkage("scotch_yoke")
    slot = linkage.joints.pop("P23")
    linkage.prismatic("P23", slot.parent, slot.child, angle=0.0)
    with pytest.raises(LinkageError, match="singular|does not close"):
        linkage.cycle([1.0])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.NearSingularWarning")
def test_a_class_three_group_that_is_torn():
    linkage = gauss.load_linkage("class_three")
    pin = linkage.joints.pop("B")
    linkage.revolute("B", pin.parent, pin.child, at=(0.3, 0.0))
    linkage.drive("A", speed=9.0, start=1.0)
    ((low, high),) = linkage.closing_ranges()
    near = linkage.cycle([low + 1e-6, high - 1e-6], speed=1.0)  # velocities grow like the inverse root of the distance
    assert np.abs(near.link("ternary").omega).min() > 1e2
    with pytest.raises(LinkageError, match="crank angles"):
        linkage.cycle()
    linkage.drive("A", speed=9.0, start=2.5)
    with pytest.raises(LinkageError, match="links ternary"):
        linkage.cycle()


def _without(name):
    linkage = _bar()
    del linkage.joints[name]
    return linkage


def _six_r():
    linkage = gauss.load_linkage("class_three")
    linkage.poses.clear()
    return linkage


def _overconstrained():
    """A joint too many at one place, one too few at another: the count is right and the linkage is not."""
    linkage = _bar()
    linkage.link("x", 1.0)
    linkage.link("y", 1.0)
    linkage.revolute("X", "ground", "rocker", at=(2.0, 0.0))
    linkage.revolute("Y", "ground", "x", at=(3.0, 0.0))
    linkage.revolute("Z", "x", "y", at=(0.5, 0.0))
    return linkage


def _three_slides():
    linkage = gauss.Linkage("slides")
    for name in ("crank", "i", "j"):
        linkage.link(name, 1.0)
    linkage.revolute("A", "ground", "crank")
    linkage.prismatic("P", "crank", "i")
    linkage.prismatic("Q", "i", "j", angle=1.0)
    linkage.prismatic("S", "ground", "j", angle=2.0)
    linkage.drive("A")
    return linkage


def _dangling():
    linkage = _bar()
    for name in ("u", "v"):
        linkage.link(name, 1.0)
    linkage.revolute("U", "rocker", "u", at=(0.1, 0))
    linkage.revolute("V", "u", "v", at=(0.1, 0))
    linkage.revolute("W", "u", "v", at=(0.2, 0))
    return linkage


def _higher_class():
    """Class IV: two ternary links on the crank and the ground, joined by two binary links; solved only together."""
    linkage = gauss.Linkage("class IV")
    for name in ("crank", "s", "t", "a", "b"):
        linkage.link(name, 1.0)
    linkage.revolute("A", "ground", "crank")
    for k, (parent, child) in enumerate([("crank", "s"), ("ground", "t"), ("s", "a"), ("a", "t"), ("s", "b"), ("b", "t")]):
        linkage.revolute(f"J{k}", parent, child, at=(0.1 * k, 0.2), child_at=(0.0, 0.1 * k))
    linkage.drive("A")
    return linkage


def _loose():
    """Two links hang loose, and two others are joined by a joint too many."""
    linkage = _dangling()
    for name in ("z", "w"):
        linkage.link(name, 1.0)
        linkage.revolute(f"to {name}", "v", name, at=(0.3, 0))
    linkage.revolute("Y", "u", "v", at=(0.4, 0))
    return linkage


@pytest.mark.parametrize(
    "linkage, words",
    [
        (_without("D"), "freedoms; a linkage that one crank drives has 1: a joint is missing"),
        (_overconstrained(), "link 'rocker' is held by the joints 'D' and 'X' at once"),
        (_three_slides(), "none of them can turn"),
        (_dangling(), "the links 'u' and 'v' are joined twice"),
        (_higher_class(), "the links 's', 't', 'a', 'b' form a group of a higher class"),
        (_loose(), "link 'z' has only 1 joint and is not determined"),
        (_six_r(), "give its pose"),
        (gauss.Linkage("empty"), "has no drive"),
    ],
)
def test_what_does_not_decompose_says_why(linkage, words):
    with pytest.raises(LinkageError, match=words):
        linkage.chain  # noqa: B018


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda bar: bar.drive("E"), "driven joint 'E' does not exist"),
        (lambda bar: bar.drive("B"), "a crank turns on a pin whose parent is 'ground'"),
        (lambda bar: bar.mode("B", 1), "no such joint has a mode"),
        (lambda bar: bar.mode("C", 0), "expected \\+1 or −1"),
        (lambda bar: bar.pose("rocker", (0, 0, 0)), "no such ternary link"),
    ],
)
def test_what_is_said_of_the_chain(act, words):
    bar = _bar()
    act(bar)
    with pytest.raises(LinkageError, match=words):
        bar.cycle([0.0])


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda bar: bar.link("crank"), "the name is taken"),
        (lambda bar: bar.link("ground"), "the name is taken"),
        (lambda bar: bar.link("x", mass=-1.0), "mass"),
        (lambda bar: bar.link("x", inertia=1.0), "without mass"),
        (lambda bar: bar.revolute("A", "ground", "rocker"), "the name is taken"),
        (lambda bar: bar.revolute("E", "ground", "roker"), "Did you mean 'rocker'"),
        (lambda bar: bar.revolute("E", "rocker", "rocker"), "binds two links"),
        (
            lambda bar: LinkJoint("E", "revolute", "crank", "rocker", angle=1.0),
            "no meaning for a pin",
        ),
        (lambda bar: LinkJoint("E", "screw", "crank", "rocker"), "unknown type"),
        (lambda bar: bar.load("ground", (1.0, 0.0)), "no link 'ground'"),
        (lambda bar: bar.load("rocker", (1.0, 0.0, 0.0)), "expected 2 numbers"),
        (lambda bar: bar.load("rocker", axes="body"), "'world' or 'link'"),
        (lambda bar: bar.load("rocker", law=3.0), "law must be a function"),
        (lambda bar: bar.load("rocker", resisting=1), "true or false"),
        (lambda bar: bar.motor([0.0], [1.0]), "two or more increasing"),
        (lambda bar: bar.motor([0.0, 0.0], [1.0, 2.0]), "two or more increasing"),
        (lambda bar: bar.drive("A", speed=np.nan), "finite"),
        (lambda bar: bar.add("rocker"), "expected a PlanarLink"),
    ],
)
def test_what_is_typed(act, words):
    with pytest.raises(SceneError, match=words):
        act(_bar())


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda found: found.link("roker"), "Did you mean 'rocker'"),
        (lambda found: found.reaction("E"), "no joint 'E'"),
        (lambda found: found.slide("B"), "is a pin"),
        (lambda found: found.reaction("B", axes="x"), "no link 'x'"),
    ],
)
def test_what_is_asked_of_a_cycle(act, words):
    with pytest.raises(LinkageError, match=words):
        act(_bar().cycle([0.3]))


@pytest.mark.parametrize("angles", ["x", [], [np.nan], [[0.0]], [None]])
def test_angles_that_are_none(angles):
    with pytest.raises(LinkageError, match="angles: expected"):
        _bar().cycle(angles)


def test_shipped_linkages_close_all_the_way():
    assert set(shipped()) == {"class_three", "four_bar", "scotch_yoke", "shaper", "six_bar", "slider_crank"}
    for name in shipped():
        assert gauss.load_linkage(name).closing_ranges() == [(-np.pi, np.pi)]


@pytest.mark.parametrize(
    "text, words",
    [
        ("name = 3", "non-empty name"),
        ("[[lnk]]\nname = 'a'", "Did you mean 'link'"),
        ("[link]\nname = 'a'", "double brackets"),
        ("[[crank]]\njoint = 'A'", "single brackets"),
        ("[[link]]\nname = 'a'\nmas = 1.0", "Did you mean 'mass'"),
        ("[[link]]\nmass = 1.0", "missing name"),
        ("[[link]]\nname = 'a'\npose = [1.0]", "expected 3 numbers"),
        ("[[joint]]\nname = 'A'\ntype = 'revolute'\nparent = 'ground'\nchild = 'a'", "no link 'a'"),
        ("not toml", "not a TOML file"),
    ],
)
def test_files_that_are_none(tmp_path, text, words):
    path = tmp_path / "linkage.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as error:
        gauss.load_linkage(path)
    assert "linkage.toml" in str(error.value)


def test_names_that_are_no_linkage(tmp_path):
    with pytest.raises(FileError, match="Did you mean 'four_bar'"):
        gauss.load_linkage("four_baar")
    with pytest.raises(FileError, match="no such file"):
        gauss.load_linkage(tmp_path / "none.toml")


@pytest.mark.slow
@given(mass=NUMBERS, inertia=NUMBERS, com=st.lists(NUMBERS, max_size=3), at=st.lists(NUMBERS, max_size=3), angle=NUMBERS)
def test_any_link_and_joint_is_sound_or_refused(mass, inertia, com, at, angle):
    """Whatever is typed: nothing else than an error of gauss comes, and no number that is not finite gets through."""
    linkage = _bar()
    try:
        link = linkage.link("x", mass, inertia, com)
        joint = linkage.prismatic("P", "ground", "x", at=at, angle=angle)
    except GaussError:
        return
    assert np.isfinite([link.mass, link.inertia, *link.com, *joint.at, joint.angle]).all()


WRONG_MOTORS = {
    "raises": lambda t, angle, speed: {}[t],
    "None": lambda t, angle, speed: None,
    "text": lambda t, angle, speed: "x",
    "two": lambda t, angle, speed: [1.0, 2.0],
    "not finite later": lambda t, angle, speed: np.nan if t > 0.05 else 1.0,
    "None later": lambda t, angle, speed: None if t > 0.05 else 1.0,
}


@pytest.mark.parametrize("wrong", WRONG_MOTORS)
def test_a_motor_without_a_torque_is_named(wrong):
    chain = gauss.load_linkage("four_bar").chain
    with pytest.raises(gauss.GaussError, match=r"four-bar: motor: at t = .* s its law"):
        gauss.linkages.run(chain, WRONG_MOTORS[wrong], 0.1)


RUNS = {
    "times": [[0.0, 5.0], [-1.0, 0.5], [0.5, 0.2], [np.nan], []],
    "breaks": [[np.nan], ["late"]],
    "speed": [np.nan, "fast"],
    "angle": [np.inf],
    "step": ["short", True],
    "added_inertia": [None, -1.0, np.nan],
}


@pytest.mark.parametrize("name, value", [(name, value) for name, values in RUNS.items() for value in values])
def test_arguments_of_a_run_that_are_none_are_named(name, value):
    with pytest.raises((LinkageError, SimulationError), match=name):
        gauss.load_linkage("four_bar").run(1.0, lambda t, angle, speed: 1.0, **{name: value})


@pytest.mark.parametrize("angles", [[], [0.0, np.nan], "all"])
def test_angles_of_work_that_are_none_are_refused(angles):
    with pytest.raises(LinkageError, match="crank angles"):
        gauss.load_linkage("four_bar").work(angles)
