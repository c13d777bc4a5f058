"""References in docstrings, resolved by the object that they name: ``gauss.dynamics.rules.Plan`` leads to ``gauss.Plan``."""

from importlib import import_module

from gauss.cli.docs.reference import public_names


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
