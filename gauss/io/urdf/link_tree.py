"""The tree that links and joints of a URDF file make: checked here, because the parser drops links or gives no reason."""

from xml.etree.ElementTree import Element

from gauss.errors import FileError, did_you_mean, listed
from gauss.io.guard import Source

DEEPEST_CHAIN = (
    3000  # links, each on the one before: for 4000 Pinocchio's parser, which calls itself for each, ends the process
)
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
Tree = dict[str, tuple[str, Element]]  # link → the link that it hangs on, and the joint by which


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
