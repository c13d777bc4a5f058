"""Pages of the reference: every public name, grouped by task, with the pages and examples that use it.

Names of the packages that one types (``gauss``, ``gauss.linkages`` …) have a page each; rooms inside have one page.
References in docstrings are resolved by the object that they name: ``gauss.dynamics.rules.Plan`` leads to ``gauss.Plan``.
"""

import inspect
from functools import cache
from importlib import import_module

from gauss.cli.docs.groups import GROUPS, ROOMS, Group
from gauss.cli.docs.uses import uses

MEMBERS = (
    ":members:\n   :inherited-members: Exception, BaseException, tuple, object, int, str, float, Mapping, Env, VectorEnv"
)


@cache
def public_names() -> dict[int, str]:
    """Public names by the identity of what they name: the first group that has it counts."""
    found: dict[int, str] = {}
    for group in GROUPS:
        for name in group.names:
            found.setdefault(id(thing_of(name)), name)
    for room in ROOMS:
        for name in _of_room(room):
            found.setdefault(id(thing_of(f"{room}.{name}")), f"{room}.{name}")
    return found


def thing_of(name: str):
    """What a full public name names."""
    module, _, last = name.rpartition(".")
    return getattr(import_module(module), last)


def pages() -> dict[str, str]:
    """Pages in reStructuredText by their names."""
    used = uses()
    made = {"reference/index.rst": _index()}
    for group in GROUPS:
        made[f"reference/{group.key}.rst"] = _of_group(group)
        made |= {f"reference/names/{name}.rst": _of_name(name, group, used.get(name, [])) for name in group.names}
    return made | {f"reference/{room}.rst": _room(room) for room in ROOMS}


def summary(thing) -> str:
    """First sentence of a docstring; of what is numpy's, that it is."""
    if not _is_own(thing):
        return _foreign(thing)
    return (inspect.getdoc(thing) or "").strip().partition("\n\n")[0].replace("\n", " ")


def _index() -> str:
    lines = [*_title("Reference"), "", "Every public name, by task. ``import gauss`` is all that the first groups need.", ""]
    lines += [".. toctree::", "   :maxdepth: 1", "   :caption: By task", "", *(f"   {group.key}" for group in GROUPS), ""]
    lines += ["Rooms of the package, for those who extend it: each page lists what the room hands to the others.", ""]
    lines += [".. toctree::", "   :maxdepth: 1", "   :caption: Rooms", "", *(f"   {room}" for room in ROOMS), ""]
    for group in GROUPS:
        lines += [
            "",
            f":doc:`{group.key}`",
            f"   {', '.join(f':doc:`{_short(name)} <names/{name}>`' for name in group.names)}",
        ]
    return "\n".join(lines) + "\n"


def _of_group(group: Group) -> str:
    lines = [*_title(group.title), "", group.text, "", ".. list-table::", "   :widths: 30 70", ""]
    for name in group.names:
        lines += [f"   * - :doc:`{_short(name)} <names/{name}>`", f"     - {_plain(summary(thing_of(name)))}"]
    return "\n".join(lines) + "\n"


def _of_name(name: str, group: Group, used: list[tuple[str, str]]) -> str:
    lines = [":orphan:", "", *_title(name), "", f":doc:`../{group.key}`", "", *_documented(name)]
    if used:
        lines += ["", ".. rubric:: Used in", "", *(f"* :doc:`{title} </{page}>`" for page, title in used)]
    return "\n".join(lines) + "\n"


def _room(room: str) -> str:
    module = import_module(room)
    own = [name for name in _of_room(room) if public_names()[id(thing_of(f"{room}.{name}"))] == f"{room}.{name}"]
    others = {name: public_names()[id(thing_of(f"{room}.{name}"))] for name in _of_room(room) if name not in own}
    lines = [*_title(room), "", *(inspect.getdoc(module) or "").splitlines(), ""]
    if others:
        lines += ["Documented elsewhere: " + ", ".join(f":py:obj:`{name}`" for name in sorted(others.values())) + ".", ""]
    for name in own:
        lines += ["", *_documented(f"{room}.{name}")]
    return "\n".join(lines) + "\n"


def _of_room(room: str) -> list[str]:
    return sorted(import_module(room).__all__)


def _is_own(thing) -> bool:
    return (getattr(thing, "__module__", None) or "").startswith("gauss") or inspect.ismodule(thing)


def _is_function(thing) -> bool:
    return callable(thing) and hasattr(thing, "__name__")


def _foreign(thing) -> str:
    if _is_function(thing):
        return f"numpy's ``{thing.__name__}``: of numbers, arrays, and in traced laws."
    return f"``{thing}``" if isinstance(thing, float | int | str) else f"A {type(thing).__name__}."


def _documented(name: str) -> list[str]:
    thing = thing_of(name)
    if not _is_own(thing):
        return [
            f".. py:{'function' if _is_function(thing) else 'data'}:: {name}{'(x)' * _is_function(thing)}",
            "",
            f"   {_foreign(thing)}",
        ]
    if inspect.isclass(thing):
        return [f".. autoclass:: {name}", f"   {MEMBERS}"]
    if inspect.isroutine(thing):
        return [f".. autofunction:: {name}"]
    if inspect.ismodule(thing):
        return [f".. automodule:: {name}", "   :members:", "   :no-index:"]
    return [f".. py:data:: {name}", "", f"   {_foreign(thing)}"]


def _title(text: str) -> list[str]:
    return [text, "=" * len(text)]


def _short(name: str) -> str:
    return name.removeprefix("gauss.")


def _plain(text: str) -> str:
    return text.rstrip(":") or "–"


def found(name: str) -> object:
    """Object of a dotted name; None if there is none."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            thing: object = import_module(".".join(parts[:k]))
        except ImportError:
            continue
        for part in parts[k:]:
            thing = getattr(thing, part, None)
        return thing
    return None


def setup(app):
    """Let Sphinx ask here where it knows no target."""
    app.connect("missing-reference", resolved)
    app.connect("autodoc-skip-member", skipped)


def resolved(app, env, node, contents):
    """Reference to the page of the same object under its public name; None where it has none."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"]
    name = public_names().get(id(found(target if target.startswith("gauss") else f"gauss.{target}")))
    if name is None or name == target:
        return None
    domain = env.get_domain("py")
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", name, node, contents)


def skipped(app, what, name, thing, skip, options) -> bool | None:
    """Leave out members that are another library's, whose docstrings have their own markup."""
    return True if (getattr(thing, "__module__", None) or "gauss").partition(".")[0] == "ctypes" else None
