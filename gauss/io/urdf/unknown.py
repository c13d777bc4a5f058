"""What is refused before the parser: elements that are no URDF, and links and joints that make no tree.

URDF is a tree. Loops, couplings and the like are elements of dialects (URDF+, Drake, Gazebo); without them a robot is
another one: they are refused, as misspelt ones are. What moves a mechanism only in one simulator, as plugins of Gazebo do,
is named by a warning. The tree is checked here, because the parser drops links or gives no reason.
"""

import re
import warnings
from difflib import get_close_matches
from xml.etree.ElementTree import Element

from gauss.errors import FileError, NotImportedWarning, did_you_mean, listed
from gauss.io.guard import Source

# Children that URDF knows, and those of common tools that do not move a mechanism by themselves.
KNOWN = {
    "robot": {"link", "joint", "material", "transmission", "gazebo", "sensor", "ros2_control", "version", "group"}
    | {"loop", "coupling"},
    "link": {"inertial", "visual", "collision", "contact", "sensor", "surface", "self_filter", "material"}
    | {"collision_checking", "self_collision_checking"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"}
    | {"hardwareInterface"},
    "inertial": {"origin", "mass", "inertia"},
}
COUPLING_WORDS = "loop|clos|coupl|constrain|joint|gear|differential|tendon|bushing|spring|damper|weld|mimic|cable|rope|belt"
LISTS = {
    "passive_joint",
    "group_state",
    "end_effector",
    "disable_collisions",
    "collision_filter_group",
}  # name links, couple none
PLUGINS = "mimic|loop|coupl|gear|differential|spring|underactuated"  # of Gazebo, by their names
FALSE, TRUE = ("false", "0"), ("true", "1")
FORCED = {
    "turnGravityOff": TRUE,
    "gravity": FALSE,
    "kinematic": TRUE,
}  # children of a link, and the values that move it otherwise
SPRINGS = ("springStiffness", "springReference")
ONCE = {"inertial", "origin", "mass", "inertia", "parent", "child", "axis", "limit", "dynamics", "mimic"}
SIMILARITY = 0.75  # how alike a misspelt name is to what was meant
DEEPEST_CHAIN = (
    3000  # links, each on the one before: for 4000 Pinocchio's parser, which calls itself for each, ends the process
)
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
Tree = dict[str, tuple[str, Element]]  # link → the link that it hangs on, and the joint by which


def refuse_couplings(source: Source):
    """Refuse what makes another mechanism of the tree, elements that look like misspelt ones, and repeated ones.

    FileError naming every coupling, or the first misspelt or second element, with file and line.
    """
    parts = [part for part in source.root if part.tag in KNOWN]
    inertials = [inertial for part in parts for inertial in part.findall("inertial")]
    for element in (source.root, *parts, *inertials):
        _require_known_children(source, element)
    places = {part.get("name") for part in parts}
    unknown = [child for child in source.root if child.tag not in KNOWN["robot"]]
    found = [_located(source, child) for child in unknown if _is_coupling(child, places)]
    if found:
        beside = source.path.with_suffix(".loops.toml").name
        raise FileError(
            f"{source.path}: not read, and without it the robot is another mechanism: {listed(found)}. "
            f"Say it in {beside} beside the file (joints that close loops, couplings), and remove it here."
        )


def _require_known_children(source: Source, element: Element):
    """Refuse a misspelt element, and one that stands twice where one is read."""
    names = KNOWN[element.tag]
    for child in element:
        if child.tag in ONCE and child is not element.find(child.tag):
            raise FileError(f"{source.place(child)}: <{child.tag}> stands twice in one <{element.tag}>; keep one.")
        meant = get_close_matches(child.tag.lower(), names, n=1, cutoff=SIMILARITY) if child.tag not in names else []
        if meant:
            raise FileError(f"{source.place(child)}: <{child.tag}> of <{element.tag}>: did you mean <{meant[0]}>?")


def warn_of_rest(source: Source):
    """Warn of what no reader of URDF knows, and of what moves the robot in Gazebo only.

    Warns
    -----
    NotImportedWarning
        Naming every such element with file and line.
    """
    parts = [source.root, *(part for part in source.root if part.tag in ("link", "joint"))]
    strange = [child for part in parts for child in part if child.tag not in KNOWN[part.tag] and _may_move(child)]
    found = [
        ("no URDF, and not read", strange),
        ("of <gazebo>, not read, though it moves the robot there", _moving_in_gazebo(source.root)),
    ]
    left = [f"{what}: {listed(_located(source, element) for element in elements)}" for what, elements in found if elements]
    if left:
        warnings.warn(f"{source.path}: {'; '.join(left)}.", NotImportedWarning, stacklevel=4)


def _is_coupling(element: Element, places: set) -> bool:
    """Whether an element binds parts of the robot: by its name, or because it names two of them."""
    tag = element.tag.rpartition(":")[2]
    if tag in LISTS:
        return False
    texts = [text for part in element.iter() for text in (*part.attrib.values(), (part.text or "").strip())]
    return bool(re.search(COUPLING_WORDS, tag.lower())) or len(places.intersection(texts) - {element.get("name")}) > 1


def _moving_in_gazebo(root: Element) -> list[Element]:
    return [element for block in root.findall("gazebo") for element in block.iter() if _moves_in_gazebo(element)]


def _moves_in_gazebo(element: Element) -> bool:
    """Whether an element of a <gazebo> block changes how the robot moves."""
    if element.tag == "plugin":
        return bool(re.search(PLUGINS, f"{element.get('filename')} {element.get('name')}".lower()))
    if element.tag == "joint":  # elsewhere the name of one
        return element.find("parent") is not None or element.find("child") is not None
    return element.tag in SPRINGS or _is_forced(element)


def _may_move(element: Element) -> bool:
    return element.tag not in FORCED or _is_forced(element)


def _is_forced(element: Element) -> bool:
    given = (element.get("value") or element.text or "").strip().lower()
    return given in FORCED.get(element.tag, ())


def _located(source: Source, element: Element) -> str:
    named = element.get("filename") or element.get("name")
    return f"<{element.tag}>{f' {named!r}' if named else ''} ({source.place(element)})"


def require_tree(source: Source):
    """Refuse names that stand twice, joints without a kind or a link, and links that do not hang on one root.

    FileError with the line of the element, its name and what is wrong.
    """
    links = _by_name(source, "link")
    parents: Tree = {}
    for name, joint in _by_name(source, "joint").items():
        what = f"{source.place(joint)}: joint {name!r}"
        if joint.get("type") not in KINDS:
            kind = joint.get("type", "")
            raise FileError(f"{what}: a URDF has no joints of the type {kind!r}. {did_you_mean(kind, KINDS)}")
        parent, child = (_end(joint, tag) for tag in ("parent", "child"))
        for tag, end in (("parent", parent), ("child", child)):
            if end not in links:
                raise FileError(f"{what}: its <{tag}> is no link, {end!r}. {did_you_mean(end, links)}")
        if child in parents:
            other = parents[child][1].get("name")
            raise FileError(
                f"{what}: link {child!r} is already the child of joint {other!r}, but a URDF is a tree; close the loop by a "
                "<loop> of URDF+."
            )
        parents[child] = parent, joint
    _require_one_root(source, links, parents)


def _by_name(source: Source, tag: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in source.root.findall(tag):
        name = element.get("name", "")
        if not name:
            raise FileError(f"{source.place(element)}: <{tag}> has no name.")
        if name in found:
            raise FileError(f"{source.place(element)}: {tag} {name!r} stands in {source.place(found[name])} already.")
        found[name] = element
    return found


def _end(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _require_one_root(source: Source, links: dict[str, Element], parents: Tree):
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        place = source.place(links[roots[1]])
        raise FileError(f"{place}: links {listed(map(repr, roots))} are children of no joint; a URDF has one such link.")
    hanging = dict.fromkeys(roots, 0)  # number of links below
    for name in links:
        way: dict[str, None] = {}
        while name not in hanging and name not in way:
            way[name] = None
            name = parents[name][0]
        if name not in hanging:
            place = source.place(parents[name][1])
            raise FileError(f"{place}: links {listed(map(repr, way))} hang on one another in a circle, and not on a root.")
        for link in reversed(way):
            hanging[link] = hanging[parents[link][0]] + 1
            if hanging[link] >= DEEPEST_CHAIN:
                place = source.place(parents[link][1])
                raise FileError(f"{place}: more than {DEEPEST_CHAIN} links hang on one another; the parser takes no more.")
