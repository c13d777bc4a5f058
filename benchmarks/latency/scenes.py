"""Scenes of the table: shipped ones, families, robots; each made inside the process that is timed."""

from collections.abc import Callable
from functools import partial

import gauss
from gauss.io.catalog import shipped

ROBOTS = (
    *("panda", "ur5", "kinova", "xarm7", "z1", "so101", "allegro_left_hand", "baxter", "tiago", "pr2"),
    *("talos", "anymal", "a1", "go2", "laikago", "solo12", "hyq", "g1_29dof_rev_1_0", "simple_humanoid", "icub_reduced"),
)
ARMS = ROBOTS[:10]  # on the ground; the others are free in space
STEPPED = ("block_on_incline", "painleve_rod", "rolling_ball")  # with friction of contacts: time stepping moves them
FEET, SHINS = ("l_ankle", "r_ankle"), ("LLEG_LINK5", "RLEG_LINK5")


def scenes() -> dict[str, Callable[[], gauss.Scene]]:
    """Makers of the scenes by name; those with servos, linkages and rotors have methods of their own and are not here."""
    found: dict[str, Callable] = {name: partial(gauss.load, name) for name in shipped()}
    for name, family, size in _FAMILIES:
        found[name] = partial(gauss.load, family, **({"n": size} if size else {}))
    found["tree of 40 hinges"] = partial(gauss.load, "random_tree", n=40, kinds=("revolute",))
    found["biped, both feet fixed"] = partial(biped, FEET)
    found["biped, ankles locked"] = partial(biped, SHINS)
    return found | {f"robot:{name}": partial(_robot, name) for name in ROBOTS}


_FAMILIES = (
    ("ladder of 10", "n_four_bar", 10),
    ("ladder of 40", "n_four_bar", 40),
    ("ladder of 500", "n_four_bar", 500),
    ("hung chain of 100", "hung_chain", 100),
    ("random tree of 40", "random_tree", 40),
    ("delta robot", "delta_robot", None),
    ("Stewart platform", "stewart_platform", None),
    ("20 Stewart platforms", "stewart_platform", 20),
    ("Andrews' squeezer", "andrews_squeezer", None),
    ("governor", "flyball_governor", None),
)


def biped(links: tuple[str, str]) -> gauss.Scene:
    """Humanoid with two links fixed to the ground: two loops of six rows, redundant where the ankles cannot move."""
    scene = gauss.load("robot:simple_humanoid", root="free")
    for link in links:
        scene.fixed(f"ground {link}", "ground", link)
    return scene


def _robot(name: str) -> gauss.Scene:
    return gauss.load(f"robot:{name}", **({} if name in ARMS else {"root": "free"}))
