"""Models that an SDFormat file includes, read from the folder of the file or below a folder that the user names.

    <include><uri>model://NAME</uri> <name/> <pose/> <static/> </include>  →  <model name="NAME"> … </model>

A URI names a file or a folder: relative, ``file://``, ``model://``, or on a server (``https://…/models/NAME``); of the
latter only a copy on disk is read. A folder's model is the file that its model.config names, or model.sdf (SDFormat
specification, "Composition").
"""

import os
import re
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import MOST_INCLUDES, Source, read_xml, require_inside
from gauss.io.numbers import number
from gauss.io.sdf.elements import TRUE, text
from gauss.io.sdf.scopes import MODEL, NAMED, Scope

MOST_FOLDERS = 100_000  # folders that are searched for a model
SCHEME = re.compile(r"[a-z]+://")
ON_SERVER = ("http://", "https://")
MODEL_FILE = "model.sdf"
UNBOUNDED = ("lower", "upper", "effort", "velocity")  # limits, where files hold the largest double for none
MOVED = ("static", "pose")  # children of <include> that replace those of the model


class Includes:
    """Includes of one file.

    Parameters
    ----------
    source : Source
        The file; the elements of included models get their places in it, too.
    root_folder : Path, optional
        Folder that included files may lie in, beside that of the file.
    leave_out : bool
        Whether models that are not found are left out.

    Attributes
    ----------
    missing : list of str
        URIs of what was left out.
    """

    def __init__(self, source: Source, root_folder: Path | None, leave_out: bool = False):
        self.whole, self.root_folder, self.count = source, root_folder, 0
        self.leave_out, self.missing = leave_out, list[str]()
        self.home = source.path.resolve().parent

    def expand(self, element: Element, path: Path, seen: tuple[Path, ...] = ()):
        """Put the models that an element includes, and that these include, in the places of the includes.

        FileError if a model is not found, includes itself, or there are too many.
        """
        for child in list(element):
            if child.tag == "include":
                place = list(element).index(child)
                element[place : place + 1] = self._models(child, path, (*seen, path.resolve()))
            elif child.tag in ("world", "model"):
                self.expand(child, path, seen)

    def _models(self, include: Element, path: Path, seen: tuple[Path, ...]) -> list[Element]:
        """Model that an include stands for; none if it is left out."""
        place = self.whole.place(include)
        self.count += 1
        if self.count > MOST_INCLUDES:
            raise FileError(f"{place}: more than {MOST_INCLUDES} models are included; write them into fewer files.")
        file = self._file(include, path)
        if file is None:
            self.missing.append(text(include, "uri"))
            return []
        if file in seen:
            raise FileError(f"{place}: includes {file.name}, which includes it again.")
        model = self._read(include, file)
        self.expand(model, file, seen)
        return merged(self.whole, include, model) if include.get("merge") in TRUE else [model]

    def _read(self, include: Element, file: Path) -> Element:
        """Model of a file, with the name, pose and so on that the include gives it."""
        inner = read_xml(file, ("sdf",), limits=UNBOUNDED, loose_comments=True)
        self.whole.places.update(inner.places)
        found = [child for child in inner.root if child.tag in ("model", "actor", "light")]
        if len(found) != 1:
            place = self.whole.place(include)
            raise FileError(f"{place}: {file} holds {len(found)} models; a file of one can be included.")
        model = found[0]
        for tag in ("name", "placement_frame"):
            if text(include, tag):
                model.set(tag, text(include, tag))
        for given in (include.find(tag) for tag in MOVED):
            if given is not None:
                for former in model.findall(given.tag):
                    model.remove(former)
                model.insert(0, given)
        model.extend(include.findall("plugin"))
        return model

    def _file(self, include: Element, path: Path) -> Path | None:
        """File that an include names; None if there is none and it is left out."""
        uri, place = text(include, "uri"), self.whole.place(include)
        if not uri:
            raise FileError(f"{place}: <include> without <uri>; name the model there.")
        found = self._named(uri, path)
        if found is not None:
            return self._allowed(include, found)
        if self.leave_out:
            return None
        where = "it is on a server; get a copy of it" if uri.startswith(ON_SERVER) else "no such model"
        raise FileError(
            f"{place}: includes {uri!r}: {where} below the folder of the file, or below another that "
            "root_folder= names; or leave it out by missing='left out'."
        )

    def _named(self, uri: str, path: Path) -> Path | None:
        """Model file of a URI: where it says, else in a folder of its name below that of the file, or of the user."""
        named, below = SCHEME.sub("", uri), [self.home] + ([self.root_folder] if self.root_folder else [])
        for home in [] if uri.startswith(ON_SERVER) else [path.resolve().parent, *below]:
            found = model_in(home / named.lstrip("/"))
            if found:
                return found
        parts = [part for part in PurePosixPath(named).parts if number(part) is None]  # without a version on a server
        return next((found for home in below if parts and (found := search(home, parts[-1]))), None)

    def _allowed(self, include: Element, found: Path) -> Path:
        require_inside(self.whole, include, self.home, str(found), self.root_folder)
        return found.resolve()


def merged(source: Source, include: Element, model: Element) -> list[Element]:
    """Parts of a model that become parts of the model that includes it, and the frame that they are relative to.

    FileError if the model has a placement frame, which is not read here.
    """
    if model.get("placement_frame"):
        place = source.place(include)
        raise FileError(f"{place}: a merged model with a placement frame is not read; give its pose instead.")
    if model.tag != "model":
        return []
    name = f"_merged__{model.get('name')}__model__"
    frame = Element("frame", {"name": name, "attached_to": Scope(source, model).canonical})
    source.places[frame] = source.place(include)
    _pose_of(frame, model.find("pose"), MODEL)
    parts = [part for part in model if part.tag in NAMED]
    for part in parts:
        if part.tag in ("link", "model"):
            _pose_of(part, part.find("pose"), name)
        elif part.tag == "frame" and not part.get("attached_to"):
            part.set("attached_to", name)
        for one in part.iter() if part.tag != "model" else part.findall("pose"):
            _rename(one, name)
    return [frame, *parts]


def _pose_of(element: Element, pose: Element | None, base: str):
    """Give an element a pose that is relative to a frame where it does not say to what."""
    if pose is None:
        pose = Element("pose")
    if pose not in list(element):
        element.append(pose)
    if not pose.get("relative_to"):
        pose.set("relative_to", base)


def _rename(element: Element, frame: str):
    """Let an element refer to a frame in place of its model."""
    for key in ("relative_to", "expressed_in", "attached_to"):
        if element.get(key) == MODEL:
            element.set(key, frame)
    if element.tag in ("parent", "child") and (element.text or "").strip() == MODEL:
        element.text = frame


def model_in(place: Path) -> Path | None:
    """Model file that a path names: itself, or that of a folder, of its newest version on a copy of a server."""
    if place.is_file():
        return place
    if not place.is_dir():
        return None
    for file in (*_configured(place), place / MODEL_FILE):
        if file.is_file():
            return file
    versions = sorted((number(one.name) or 0.0, one) for one in place.iterdir() if number(one.name) is not None)
    return model_in(versions[-1][1]) if versions else None


def _configured(folder: Path) -> list[Path]:
    """Files that the model.config of a folder names, of the newest version of the format first."""
    if not (folder / "model.config").is_file():
        return []
    named = read_xml(folder / "model.config", ("model",), loose_comments=True).root.findall("sdf")
    named.sort(key=lambda element: number(element.get("version", "0")) or 0.0, reverse=True)
    return [folder / (element.text or "").strip() for element in named if (element.text or "").strip()]


def search(home: Path, name: str) -> Path | None:
    """Model file of the folder of a name below another, the first in the order of names."""
    for count, (folder, inner, _) in enumerate(os.walk(home)):
        inner.sort()
        if count > MOST_FOLDERS:
            return None
        for one in inner:
            if one.lower() == name.lower():
                found = model_in(Path(folder) / one)
                if found:
                    return found
    return None
