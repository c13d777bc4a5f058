"""Untrusted YAML files as texts and lists with their lines: nothing is constructed; aliases and tags are refused."""

import re
from pathlib import Path
from typing import NamedTuple

from gauss.errors import FileError, extra
from gauss.scene.file_contents import contents

LARGEST_TEXT = 1_000_000  # bytes; the largest known file has 2 000
DEEPEST_LISTS = 8  # lists inside lists


class Marked(NamedTuple):
    """A text, or a list of such, and where it stands ("robot.yaml:3")."""

    value: "str | list[Marked]"
    place: str


def yaml_entries(path: Path) -> dict[str, Marked]:
    """Entries of the mapping that a YAML file holds.

    FileError if it cannot be read, or holds aliases, tags, or a key twice.
    """
    with extra("yaml"):
        import yaml  # few robots need it
    try:
        text = contents(path, LARGEST_TEXT).decode("utf-8")
        if re.search(r"[\[{]\s*" * DEEPEST_LISTS, text):
            raise FileError(f"{path}: lists are nested more than {DEEPEST_LISTS - 1} deep.")
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) or getattr(event, "tag", None):
                raise FileError(f"{path}:{event.start_mark.line + 1}: anchors, aliases and tags are not read.")
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        return _mapping(yaml, path, node)
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: cannot be read: {error}.") from error
    except RecursionError:
        raise FileError(f"{path}: lists are nested too deep.") from None
    except yaml.YAMLError as error:
        raise FileError(f"{path}: not YAML: {' '.join(str(error).split())}.") from error


def _mapping(yaml, path: Path, node) -> dict[str, Marked]:
    if not isinstance(node, yaml.MappingNode):
        return {}
    found: dict[str, Marked] = {}
    for key, entry in node.value:
        place = f"{path}:{key.start_mark.line + 1}"
        if not isinstance(key, yaml.ScalarNode):
            raise FileError(f"{place}: a key is no text; write a name there.")
        if key.value in found:
            raise FileError(f"{place}: the key {key.value!r} stands twice.")
        found[key.value] = _marked(yaml, path, entry)
    return found


def _marked(yaml, path: Path, node) -> Marked:
    place = f"{path}:{node.start_mark.line + 1}"
    if isinstance(node, yaml.SequenceNode):
        return Marked([_marked(yaml, path, entry) for entry in node.value], place)
    return Marked(node.value if isinstance(node, yaml.ScalarNode) else "", place)
