"""Layers of an untrusted USD file, checked before they are composed: none from elsewhere, none too large, not too many."""

import os
import re
from pathlib import Path

from gauss.errors import FileError, extra
from gauss.io.guard import checked_root

with extra("usd"):
    from pxr import Sdf, Tf, Usd

LARGEST_LAYER = 200_000_000  # bytes: those of scanned environments hold meshes
MOST_LAYERS = 1000
LONGEST_REASON = 300  # letters: USD quotes the line of the layer, which may be all of it
OWN_PLACE = re.compile(r"Error in '.*' at line \d+ in file .* : ")


def opened_stage(path: Path, root_folder=None) -> Usd.Stage:
    """Composed stage of a file, all of whose layers lie in its folder, or in one that the user names.

    FileError if a layer lies elsewhere, is missing or too large, or USD refuses it.
    """
    if not path.is_file():
        raise FileError(f"{path}: there is no such file.")
    roots = [folder.resolve() for folder in (path.parent, checked_root(path, root_folder)) if folder is not None]
    waiting, known = [path.resolve()], set[Path]()
    while waiting:
        layer_path = waiting.pop()
        if layer_path in known:
            continue
        known.add(layer_path)
        if len(known) > MOST_LAYERS:
            raise FileError(f"{path}: it is composed of more than {MOST_LAYERS} layers.")
        layer = _layer(path, layer_path)
        waiting += [_within(path, layer, name, roots) for name in layer.GetCompositionAssetDependencies() if name]
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise FileError(f"{path}: USD refuses it: {error}") from error


def _layer(path: Path, layer_path: Path) -> Sdf.Layer:
    if layer_path.stat().st_size > LARGEST_LAYER:
        raise FileError(f"{path}: layer {layer_path.name!r} is larger than {LARGEST_LAYER // 10**6} MB.")
    try:
        layer = Sdf.Layer.FindOrOpen(str(layer_path))
    except Tf.ErrorException as error:
        raise FileError(f"{path}: USD refuses layer {layer_path.name!r}: {_reason(error, layer_path)}") from error
    except UnicodeDecodeError as error:  # USD quotes the line in its message
        raise FileError(f"{path}: USD refuses layer {layer_path.name!r}, which is no text in UTF-8: {error}") from error
    if layer is None:
        raise FileError(f"{path}: USD cannot read layer {layer_path.name!r}.")
    return layer


def _reason(error: Exception, layer_path: Path) -> str:
    """Message of USD without the places in its own sources: the one that has the line of the layer, if one has."""
    said = [OWN_PLACE.sub("", line).strip(" \t'") for line in str(error).splitlines()]
    said = [line.replace(f"{layer_path.parent}{os.sep}", "") for line in said if line]
    first = said[0] if said else "it is no layer of USD"
    found = next((line for line in said if line.startswith(f"{layer_path.name}:")), first)
    return found if len(found) <= LONGEST_REASON else f"{found[:LONGEST_REASON]}…"


def _within(path: Path, layer: Sdf.Layer, name: str, roots: list[Path]) -> Path:
    """File of a layer that another names."""
    found = Path(layer.ComputeAbsolutePath(name)).resolve()
    if not any(found.is_relative_to(root) for root in roots):
        raise FileError(f"{path}: layer {name!r} lies outside of the folder of the file; name its root_folder=.")
    if not found.is_file():
        raise FileError(f"{path}: there is no layer {name!r}.")
    return found
