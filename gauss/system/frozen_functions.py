"""Refusal of functions of the user that have changed since they were differentiated.

Efforts are evaluated in every motion and may change from one to the next. Residuals, gap functions and prescribed motions
are differentiated once, when the system is built. A function that changes afterwards, by a variable that it closes over,
would leave the rows of another mechanism.
"""

from dataclasses import fields

import numpy as np

from gauss.codegen import Function, Graph
from gauss.errors import SceneError
from gauss.scene import Contact, Scene
from gauss.system.symbolic_mechanism import Symbols


def written_laws(system) -> dict[str, str]:
    """Residuals of the functions of relations, unilateral and set-valued elements as they are now, as text by name."""
    return {relation.name: _text(system, relation) for relation in _with_functions(system.scene)}


def refuse_changed(system):
    """Raise a SceneError if a function that became rows of a system has changed since."""
    for name, text in written_laws(system).items() if system.written else ():
        if text != system.written[name]:
            raise SceneError(
                f"{name!r}: its function has changed since the scene was compiled, and its rows have not: "
                "compile the scene anew, gauss.compile_scene(scene)."
            )


def _with_functions(scene: Scene):
    every = [*scene.relations.values(), *scene.contacts.values(), *scene.set_valued.values()]
    names = {kind: () if kind is Contact else _fields(kind) for kind in {type(relation) for relation in every}}
    return [relation for relation in every if any(callable(getattr(relation, name)) for name in names[type(relation)])]


def _fields(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _text(system, relation) -> str:
    view = Symbols(system, Graph())
    try:
        residuals = np.ravel(np.concatenate(view.residuals(relation)))
    except Exception as error:  # a function that has changed may fail in any way
        return f"{type(error).__name__}: {error}"
    return Function("law", [], list(residuals)).text()
