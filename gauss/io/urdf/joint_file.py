"""Loops, joint types and motors of a URDF file, in a YAML file beside it (the format of example-parallel-robots).

closed_loop: [[frame, frame], …]    pairs of links whose frames meet
type: [6d, 3d, …]                   6d: the frames coincide; 3d: their origins do
joint_name, joint_type              joints of the URDF that are replaced: SPHERICAL, UJOINT_XY (also YZ, ZX, …), FIXED
name_mot: […]                       actuated joints, which become inputs of the scene
"""

from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from gauss.errors import FileError, SceneError, did_you_mean
from gauss.io.guard import Source
from gauss.io.urdf.closures import FrameOnLink, LoopClosure
from gauss.io.yaml_nodes import Marked, yaml_entries
from gauss.scene import Scene

ENDINGS = (".yaml", ".yml")
LOOP_TYPES = {"3d": "ball", "6d": "fixed"}
AXIS_OF = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}
UNIVERSAL = {f"UJOINT_{one}{other}": (one, other) for one, other in permutations(AXIS_OF, 2)}
JOINT_TYPES = ("SPHERICAL", "FIXED", *UNIVERSAL)
KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")


@dataclass(frozen=True)
class JointFile:
    """Contents of the file."""

    closures: tuple[tuple[LoopClosure, str], ...] = ()  # loop joints, each with its place
    # type that replaces that of a joint of the URDF, with its place, by the name of the joint
    kinds: dict[str, Marked] | None = None
    motors: tuple[Marked, ...] = ()  # actuated joints

    def replaced(self, source: Source) -> Source:
        """URDF file with the types of its joints replaced; ball joints are hinges in it, see :attr:`balls`.

        FileError if there is no such joint, or it does not move.
        """
        if not self.kinds:
            return source
        root = Element(source.root.tag, source.root.attrib)
        places, found = dict(source.places), set()
        for element in source.root:
            name = element.get("name", "")
            if element.tag == "joint" and name in self.kinds:
                found.add(name)
                if element.get("type") == "fixed":
                    raise FileError(
                        f"{self.kinds[name].place}: joint {name!r} is fixed in the URDF; only one that moves is replaced."
                    )
                made = _joints(element, str(self.kinds[name].value))
                places |= dict.fromkeys((part for one in made for part in one.iter()), source.place(element))
                root.extend(made)
            else:
                root.append(element)
        missing = next((name for name in self.kinds if name not in found), None)
        if missing is not None:
            names = [joint.get("name", "") for joint in source.root.findall("joint")]
            raise FileError(f"{self.kinds[missing].place}: joint_name: no joint {missing!r}. {did_you_mean(missing, names)}")
        return replace(source, root=root, places=places)

    @property
    def balls(self) -> set[str]:
        """Names of the joints that are ball joints."""
        return {name for name, kind in (self.kinds or {}).items() if kind.value == "SPHERICAL"}

    def add_to(self, scene: Scene, source: Source):
        """Add the loops and the inputs of the motors.

        A frame that is no link may be a joint: the frame of the link that it moves.

        FileError if a frame or joint does not exist; the message says where.
        """
        for closure, place in self.closures:
            try:
                closure.with_ends(lambda name: _link_of(source, name)).add_to(scene)
            except SceneError as error:
                raise FileError(f"{place}: {error}") from error
        for motor in self.motors:
            try:
                scene.input(str(motor.value), str(motor.value))
            except SceneError as error:
                raise FileError(f"{motor.place}: name_mot: {error}") from error


def joint_file(path: Path) -> JointFile:
    """Loops, joint types and motors of the YAML file beside a URDF file; nothing if there is none that names any.

    FileError if it is not understood; the message says where.
    """
    beside = next((path.with_suffix(ending) for ending in ENDINGS if path.with_suffix(ending).is_file()), None)
    if beside is None:
        return JointFile()
    entries = yaml_entries(beside)
    if not {"closed_loop", "joint_name"} & set(entries):
        return JointFile()  # of another tool
    unknown = next((key for key in entries if key not in KEYS), None)
    if unknown is not None:
        raise FileError(f"{entries[unknown].place}: unknown key {unknown!r}. {did_you_mean(unknown, KEYS)}")
    lists = {key: _list(entries[key], key) if key in entries else [] for key in KEYS}
    _require_as_many(beside, lists, "closed_loop", "type")
    _require_as_many(beside, lists, "joint_name", "joint_type")
    pairs = zip(lists["closed_loop"], lists["type"], strict=True)
    closures = tuple((_closure(pair, kind), pair.place) for pair, kind in pairs)
    kinds = _kinds(lists["joint_name"], lists["joint_type"])
    return JointFile(closures, kinds, tuple(_name(motor, "name_mot") for motor in lists["name_mot"]))


def _closure(pair: Marked, kind: Marked) -> LoopClosure:
    frames = [str(_name(frame, "closed_loop").value) for frame in _list(pair, "closed_loop")]
    if len(frames) != 2:
        raise FileError(f"{pair.place}: closed_loop: expected pairs of frames, got {len(frames)} in one.")
    chosen = str(_name(kind, "type").value).lower()
    if chosen not in LOOP_TYPES:
        raise FileError(f"{kind.place}: type {kind.value!r} of a loop. {did_you_mean(chosen, LOOP_TYPES)}")
    return LoopClosure(f"{frames[0]} to {frames[1]}", LOOP_TYPES[chosen], FrameOnLink(frames[0]), FrameOnLink(frames[1]))


def _link_of(source: Source, name: str) -> str:
    """Link that a frame belongs to: of its own name, or moved by the joint of this name.

    SceneError if a link has this name, and a joint that moves another link.
    """
    moved = {joint.get("name"): joint.find("child") for joint in source.root.findall("joint")}
    child = moved.get(name)
    link = name if child is None else child.get("link", "")
    if link != name and any(one.get("name") == name for one in source.root.findall("link")):
        raise SceneError(f"the frame {name!r} may be the link of this name, or {link!r}, which the joint {name!r} moves.")
    return link


def _kinds(names: list[Marked], types: list[Marked]) -> dict[str, Marked]:
    found: dict[str, Marked] = {}
    for name, kind in zip(names, types, strict=True):
        joint = str(_name(name, "joint_name").value)
        if joint in found:
            raise FileError(f"{name.place}: joint_name: {joint!r} stands twice.")
        if str(_name(kind, "joint_type").value) not in JOINT_TYPES:
            raise FileError(f"{kind.place}: joint_type {kind.value!r}. {did_you_mean(str(kind.value), JOINT_TYPES)}")
        found[joint] = kind
    return found


def _joints(element: Element, kind: str) -> list[Element]:
    """Elements that stand for a joint of a type."""
    name = element.get("name", "")
    kept = [part for part in element if part.tag in ("origin", "parent", "child")]
    if kind not in UNIVERSAL:
        made = Element("joint", {"name": name, "type": "fixed" if kind == "FIXED" else "continuous"})
        made.extend(kept)
        return [made]
    between = f"{name} cross"  # link without mass
    first, last = (Element("joint", {"name": f"{name}_{axis}", "type": "continuous"}) for axis in UNIVERSAL[kind])
    first.extend(part for part in kept if part.tag != "child")
    last.extend(part for part in kept if part.tag == "child")
    SubElement(first, "child", link=between)
    SubElement(last, "parent", link=between)
    for made, axis in zip((first, last), UNIVERSAL[kind], strict=True):
        SubElement(made, "axis", xyz=AXIS_OF[axis])
    return [Element("link", name=between), first, last]


def _require_as_many(path: Path, lists, one: str, other: str):
    if len(lists[one]) != len(lists[other]):
        raise FileError(f"{path}: {one} has {len(lists[one])} entries, {other} {len(lists[other])}; each needs its own.")


def _name(entry: Marked, key: str) -> Marked:
    if not isinstance(entry.value, str) or not entry.value:
        raise FileError(f"{entry.place}: {key}: expected a name.")
    return entry


def _list(entry: Marked, key: str) -> list[Marked]:
    if isinstance(entry.value, str):
        raise FileError(f"{entry.place}: {key}: expected a list, got {entry.value[:40]!r}.")
    return entry.value
