"""Scene files in TOML: one section per kind of element, one key per field of its class. Nothing is executed."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from functools import partial
from pathlib import Path

from gauss import scene as package
from gauss.errors import FileError, SceneError, did_you_mean
from gauss.lazy import LazyTable
from gauss.scene import Scene
from gauss.scene.file_contents import contents

# Section → class, in the order in which elements may refer to each other.
CLASSES = {
    "body": "Body",
    "frame": "Frame",
    "joint": "Joint",
    "coupling": "Coupling",
    "prescribed": "Prescribed",
    "guided": "Guided",
    "coincident": "Coincident",
    "distance": "Distance",
    "on_plane": "OnPlane",
    "on_line": "OnLine",
    "angle": "Angle",
    "linear_coupling": "LinearCoupling",
    "gear": "Gear",
    "rack": "Rack",
    "rolling": "Rolling",
    "knife_edge": "KnifeEdge",
    "sphere": "Sphere",
    "capsule": "Capsule",
    "box": "Box",
    "points": "Points",
    "ellipsoid": "Ellipsoid",
    "cylinder": "Cylinder",
    "cone": "Cone",
    "mesh": "ConvexMesh",
    "half_space": "HalfSpace",
    "height_field": "HeightField",
    "contact": "Contact",
    "stop": "Stop",
    "rope": "Rope",
    "joint_friction": "JointFriction",
    "limited_drive": "LimitedDrive",
    "clutch": "Clutch",
    "freewheel": "Freewheel",
    "lossy_gear": "LossyGear",
    "elastic_link": "ElasticLink",
    "drive": "Drive",
    "force": "Force",
    "joint_spring": "JointSpring",
    "spring": "Spring",
    "start": "Start",
    "input": "Input",
    "output": "Output",
}
SECTIONS = LazyTable(CLASSES, partial(getattr, package))
HEADER_KEYS = ("name", "gravity")
LARGEST_SCENE = 200_000_000  # bytes: meshes and height fields may stand in it
RENAMED_KEYS = {("joint", "type"): "kind"}  # key in the file → field of the class
# A name may be left out: that of the joint serves.
NAMED_BY_SCENE = {"drive": "drive", "prescribed": "drive", "limited_drive": "drive", "stop": "stop"}
NAMED_BY_SCENE |= {"joint_friction": "friction"}


def tables(path: Path) -> dict:
    """Contents of a TOML file."""
    content = contents(Path(path), LARGEST_SCENE)
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except ValueError as error:  # of the syntax, the encoding, or an integer of thousands of digits
        raise FileError(f"{path}: not a TOML file: {error}.") from error
    except RecursionError:
        raise FileError(f"{path}: tables or arrays are nested too deep.") from None


def read_file(source, shipped: dict[str, Path], kind: str, make):
    """Result of a function of the tables of a .toml file, or of a shipped one by name.

    FileError if there is no such thing, or the function refuses it; the message names file and place.
    """
    name, path = str(source), Path(source)
    if path.suffix.lower() != ".toml":
        if path.suffix or path.exists() or name not in shipped:
            raise FileError(f"{name!r} is neither a {kind} file (.toml) nor a shipped {kind}. {did_you_mean(name, shipped)}")
        path = shipped[name]
    data = tables(path)
    try:
        return make(data)
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error


def from_tables(data: dict) -> Scene:
    """Scene of the tables of a file."""
    check_sections(data, [*HEADER_KEYS, *SECTIONS])
    scene = Scene(**{key: data[key] for key in HEADER_KEYS if key in data})
    for made in elements(data, SECTIONS):
        scene.add(made)
    return scene


def check_sections(data: dict, sections: list[str]):
    """Refuse a section that is none of these; SceneError naming it, and the nearest that exist."""
    for key in data:
        if key not in sections:
            raise SceneError(f"unknown section {key!r}. {did_you_mean(key, sections)}")


def elements(data: dict, sections: Mapping) -> Iterator:
    """Yield an element for each entry of the sections, {name: class}."""
    for section in sections:
        for number, entry in enumerate(entries_of(data, section), start=1):
            yield element(section, sections[section], entry, number)


def entries_of(data: dict, section: str) -> list[dict]:
    """Tables of a section, in the order of the file."""
    entries = data.get(section, [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise SceneError(f"section {section!r}: write [[{section}]] with double brackets, once for each.")
    return entries


def element(section: str, kind, entry: dict, number: int):
    """Element of a class, one key of the table for each of its fields."""
    what = f"[[{section}]] {entry.get('name', f'number {number}')!r}"
    if section in NAMED_BY_SCENE and "name" not in entry:
        entry = {"name": f"{NAMED_BY_SCENE[section]} of {entry.get('joint', '?')}"} | entry
    field_of = _keys(section, kind)
    _check_keys(what, kind, entry, field_of)
    return kind(**{field_of[key]: _frozen(value) for key, value in entry.items()})


def _check_keys(what: str, kind, entry: dict, field_of: dict[str, str]):
    """Refuse unknown and missing keys of a table."""
    unknown = [key for key in entry if key not in field_of]
    if unknown:
        raise SceneError(f"{what}: unknown key {unknown[0]!r}. {did_you_mean(unknown[0], field_of)}")
    required = {f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING}
    missing = [key for key, field in field_of.items() if field in required and key not in entry]
    if missing:
        raise SceneError(f"{what}: missing {', '.join(missing)}.")


def _keys(section: str, kind) -> dict[str, str]:
    """Key in the file → field of the class."""
    renamed = {field: key for (where, key), field in RENAMED_KEYS.items() if where == section}
    return {renamed.get(f.name, f.name): f.name for f in fields(kind)}


def _frozen(value):
    """Value as a class takes it: lists as tuples, tables as profiles, a list with profiles in it as one law."""
    if isinstance(value, dict) and "profile" in value:
        return package.profiles.from_table({key: _frozen(entry) for key, entry in value.items()})
    if not isinstance(value, list):
        return value
    entries = tuple(_frozen(entry) for entry in value)
    several = any(callable(entry) and isinstance(entry, package.profiles.Profile) for entry in entries)
    return package.profiles.Several(entries) if several else entries


def write_toml(scene: Scene, path: Path) -> Path:
    """Write a scene; reading it back gives an equal one.

    FileError if a law is a Python function, which no file can hold.
    """
    path = Path(path)
    path.write_text(toml_text(scene), encoding="utf-8")
    return path


def toml_text(scene: Scene) -> str:
    """Contents of the file of a scene; FileError if a law is a Python function, which no file can hold."""
    lines = [_line("name", scene.name), _line("gravity", scene.gravity)]
    for element in _elements(scene):
        section = next((name for name, kind in SECTIONS.items() if type(element) is kind), None)
        if section is None:
            raise FileError(f"{element.what} is written in Python functions, which a file cannot hold.")
        lines += ["", f"[[{section}]]", *(_line(key, value) for key, value in _entries(section, element))]
    return "\n".join(lines) + "\n"


def _line(key: str, value) -> str:
    return f"{key} = {_text(value)}"


def _text(value) -> str:
    if isinstance(value, package.profiles.Profile):
        return "{ " + ", ".join(_line(key, entry) for key, entry in package.profiles.to_table(value).items()) + " }"
    if isinstance(value, package.profiles.Several):
        return f"[{', '.join(_text(entry) for entry in value.entries)}]"
    import json  # scenes are read more often than written

    text = json.dumps(value, ensure_ascii=False)  # strings, numbers and arrays of JSON are those of TOML, but for one:
    return text.replace("\x7f", "\\u007f")


def _elements(scene: Scene):
    constraints = scene.couplings | scene.relations | scene.contacts | scene.set_valued
    groups = (scene.bodies, scene.frames, scene.shapes, scene.joints, constraints, scene.loads, scene.starts)
    for group in (*groups, scene.inputs, scene.outputs):
        yield from group.values()


def _entries(section: str, element):
    """Keys and values that differ from their defaults."""
    for key, name in _keys(section, type(element)).items():
        value, default = getattr(element, name), type(element).__dataclass_fields__[name].default
        if callable(value) and not isinstance(value, package.profiles.Profile | package.profiles.Several):
            raise FileError(f"{section} {element.name!r}: {name} is a Python function, which a file cannot hold.")
        if name == "forces" and value:
            raise FileError(f"{section} {element.name!r}: forces are elements of their own, which this table cannot hold.")
        if value is not None and value != default:
            yield key, value
