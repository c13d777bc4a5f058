"""Scopes of an SDFormat file: a world or a model, with the names in it and their poses.

Every link, joint, frame and nested model is given relative to another of its scope; all are found in the frame of the scope.
A name of a nested scope is written "model::name" (SDFormat specification, "Composition", "Naming and scoping").
"""

from collections.abc import Iterator
from functools import cached_property
from xml.etree.ElementTree import Element

from gauss.errors import FileError, did_you_mean
from gauss.io.guard import Source
from gauss.io.sdf.elements import TRUE, pose, text
from gauss.system.frames import IDENTITY, Pose, compose, invert

MODEL, WORLD, JOINT = "__model__", "world", "::"
NAMED = ("link", "joint", "frame", "model")


class Scope:
    """World, model or nested model.

    Parameters
    ----------
    source : Source
        The file.
    root : Element
        World or model; the outermost element of a file of a model alone, too.
    parent : Scope, optional
        Scope that the model stands in.
    """

    def __init__(self, source: Source, root: Element, parent: "Scope | None" = None):
        self.source, self.root, self.parent = source, root, parent
        self.name = root.get("name", "")
        self.is_static: bool = parent is not None and (parent.is_static or text(root, "static") in TRUE)
        self.elements: dict[str, Element] = {}
        for element in root:
            if element.tag in NAMED:
                name = element.get("name", "")
                against = "is reserved" if name in (MODEL, WORLD) else "is missing" if not name else ""
                if name in self.elements:
                    against = f"is taken by <{self.elements[name].tag}> at {source.place(self.elements[name])}"
                if against:
                    what = f"the name {name!r} of <{element.tag}>"
                    raise FileError(f"{source.place(element)}: {what} {against}; give another.")
                self.elements[name] = element
        self.models = {name: Scope(source, one, self) for name, one in self.elements.items() if one.tag == "model"}
        self._origin = MODEL if parent is not None else WORLD
        self._found: dict[str, Pose | None] = {self._origin: IDENTITY}

    def all(self) -> "Iterator[Scope]":
        """The scope itself, and all that are nested in it."""
        yield self
        for model in self.models.values():
            yield from model.all()

    @cached_property
    def pose(self) -> Pose:
        """Pose (R, p) of the frame of the scope in the world."""
        return IDENTITY if self.parent is None else compose(self.parent.pose, self.parent.of(self.name))

    @cached_property
    def prefix(self) -> str:
        """Prefix of names of the scope in the scene; empty where a file holds one model and nothing beside it."""
        if self.parent is None or (self.parent.parent is None and len(self.parent.elements) == 1):
            return ""
        return f"{self.parent.prefix}{self.name}{JOINT}"

    def of(self, name: str, asked: Element | None = None) -> Pose:
        """Pose (R, p) of a link, joint, frame or model in the frame of the scope.

        FileError if it does not exist, or refers to itself.
        """
        if name in self._found:
            known = self._found[name]
            if known is None:
                raise FileError(f"{self.source.place(asked)}: the pose of {name!r} is given relative to itself.")
            return known
        if name not in self.elements and name.partition(JOINT)[0] in self.models:
            model, _, inner = name.partition(JOINT)
            return compose(self.of(model, asked), self.models[model].of(inner, asked))
        self._found[name] = None  # while it is looked for
        element = self.element(name, asked)
        found = compose(self.of(self._base(element), element), pose(self.source, element.find("pose")))
        marked = element.get("placement_frame") if element.tag == "model" else None
        if marked:
            found = compose(found, invert(self.models[name].of(marked, element)))
        self._found[name] = found
        return found

    def element(self, name: str, asked: Element | None = None) -> Element:
        """Element of a name of this scope; FileError if there is none."""
        if name not in self.elements:
            place = self.source.place(asked)
            raise FileError(f"{place}: no link, joint or frame {name!r}. {did_you_mean(name, self.elements)}")
        return self.elements[name]

    def link(self, name: str, asked: Element) -> str | None:
        """Link that carries a link, frame or model, as a name of this scope; None for the world.

        A joint's frame is carried by its child, a model's by its canonical link.

        FileError if there is no such name, or a frame is attached to itself.
        """
        followed: list[str] = []
        while True:
            if name == WORLD:
                return None
            if name == MODEL:
                return self.canonical
            model, _, inner = name.partition(JOINT)
            if name not in self.elements and model in self.models:
                found = self.models[model].link(inner, asked)
                return None if found is None else f"{model}{JOINT}{found}"
            element = self.element(name, asked)
            if element.tag == "link":
                return name
            if element.tag == "model":
                return f"{name}{JOINT}{self.models[name].canonical}"
            if name in followed:
                raise FileError(f"{self.source.place(element)}: frame {name!r} is attached to itself.")
            followed.append(name)
            name = text(element, "child") if element.tag == "joint" else element.get("attached_to") or self._origin

    def owner(self, path: str) -> "tuple[Scope, str]":
        """Scope of a link that a path as "model::link" names, and its name there."""
        model, _, inner = path.partition(JOINT)
        return (self, path) if path in self.elements else self.models[model].owner(inner)

    @cached_property
    def canonical(self) -> str:
        """Link that carries the frame of a model: that which the model names, or the first, of nested models last.

        FileError if the model names none of its links, or has none.
        """
        named = self.root.get("canonical_link")
        links = [name for name, element in self.elements.items() if element.tag == "link"]
        if named:
            if named not in links and named.partition(JOINT)[0] not in self.models:
                place = self.source.place(self.root)
                raise FileError(f"{place}: canonical_link: no link {named!r}. {did_you_mean(named, links)}")
            return self.link(named, self.root) or named
        if links:
            return links[0]
        if not self.models:
            raise FileError(f"{self.source.place(self.root)}: the model has no links.")
        first = next(iter(self.models))
        return f"{first}{JOINT}{self.models[first].canonical}"

    def _base(self, element: Element) -> str:
        """Name that the pose of an element is relative to."""
        placed = element.find("pose")
        named = "" if placed is None else placed.get("relative_to") or placed.get("frame") or ""
        if named:
            return named
        default = {"joint": text(element, "child"), "frame": element.get("attached_to")}.get(element.tag)
        if default == WORLD and self.parent is not None:
            self._found[WORLD] = invert(self.pose)
        return default or self._origin
