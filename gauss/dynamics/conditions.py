"""Conditions of the rules by which plans are made: what a system has to be for each kind of machine code.

A condition takes a :class:`gauss.dynamics.rules.Question` and returns what speaks against it, in words.
"""

from collections.abc import Callable

from gauss.dynamics.laws import Laws, asks_where
from gauss.dynamics.rules import Question
from gauss.system import System, build, phase_scene, sides
from gauss.system.build import slips
from gauss.system.work import MOST_WORK

LARGE = 40  # bodies of a tree from which on a sweep along it is faster than straight-line code, and is compiled sooner
WIDE = 128  # rates of a scene with loops from which on it is not written out as a whole: that takes many seconds
MOST_MEETINGS = 100  # of loops, for each body: where more of them share a branch, calls loop by loop do not pay
WIDEST = 128  # rates of a system whose whole step is compiled; longer steps are put together by Python
WIDEST_CONTACT = 48  # rates beside contacts, and
MOST_CONTACT_ROWS = 96  # rows of contacts, up to which a step is compiled whole: its matrices are dense


def is_large(system) -> bool:
    """Whether the compiled dynamics of a system sweep along its tree, instead of being written out."""
    return _n_bodies(system.parts) > LARGE and not system.has_closures


def has_large_loops(system) -> bool:
    """Whether the compiled dynamics of a system are called link by link and loop by loop, instead of being written out."""
    parts = system.parts
    if not any(part.closing for part in parts) or any(part.couplings or part.relations or part.trains for part in parts):
        return False
    if not all(bound.on_coordinates for bound in system.loads):
        return False
    if system.n_v <= WIDE and _closing_work(parts) <= MOST_WORK:
        return False
    return sum(part.meetings for part in parts) <= MOST_MEETINGS * _n_bodies(parts)


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = [f"{name!r} is one-sided" for name in system.scene.contacts]
    reasons += [f"{name!r} holds up to a limit" for name in system.scene.grips]
    reasons += [f"{name!r} loses power" for name in system.scene.losses if name not in system.scene.grips]
    if not system.parts:
        reasons.append("nothing in it can move")
    if not has_large_loops(system) and (work := _closing_work(system.parts)) > MOST_WORK:
        reasons.append(f"its loops share so many links that about {work:.0e} operations would be written down")
    if is_large(system):
        on_bodies = [bound.load.name for bound in system.loads if not bound.on_coordinates]
        reasons += [f"{name!r} acts on one of more than {LARGE} bodies" for name in on_bodies]
    return reasons


def _closing_work(parts) -> int:
    return sum(part.closing_work for part in parts)


def _n_bodies(parts) -> int:
    return sum(part.n_bodies for part in parts)


def own_backend(ask: Question) -> list[str]:
    """A backend that was asked for solves every state."""
    return (
        []
        if isinstance(ask.backend, str) and ask.backend == "auto"
        else [f"backend {named(ask.backend)!r} is asked for, which solves state by state"]
    )


def named(backend) -> str:
    """Name of a backend."""
    return backend if isinstance(backend, str) else getattr(backend, "name", type(backend).__name__)


def compilable(ask: Question) -> list[str]:
    """The forward dynamics are one smooth function."""
    return obstacles(ask.system) if ask.system.dynamics is not None else ["it was built without machine code"]


def traced_laws(ask: Question) -> list[str]:
    """All laws are expressions."""
    return [f"the law of {name!r} cannot be traced ({why})" for name, why in ask.laws.reasons.items()]


def laws_beside(ask: Question) -> list[str]:
    """Laws that Python calls give forces on coordinates, and ask for nothing but time, coordinates and rates."""
    outside = [b.load.name for b in ask.laws.called if not b.on_coordinates or asks_where(b.load)]
    return [f"the law of {name!r} asks where bodies are, or acts on one" for name in outside]


def loads_beside(ask: Question) -> list[str]:
    """The same of all loads: kernels of links know none."""
    outside = [b.load.name for b in ask.system.loads if not b.on_coordinates or asks_where(b.load)]
    return [f"{name!r} asks where bodies are, or acts on one" for name in outside]


def few_bodies(ask: Question) -> list[str]:
    """The tree is small enough to be written out as straight-line code."""
    return [f"it has more than {LARGE} bodies"] if is_large(ask.system) else []


def written_out(ask: Question) -> list[str]:
    """So are the tree and its loops."""
    return few_bodies(ask) + (["its loops are too many to be written out"] if has_large_loops(ask.system) else [])


def narrow(ask: Question) -> list[str]:
    """A whole step is short enough to be compiled."""
    n_v = ask.system.n_v
    return [f"{n_v} rates are more than {WIDEST}"] if n_v > WIDEST else []


def large_tree(ask: Question) -> bool:
    """Whether the tree is so large that kernels of links pay."""
    return is_large(ask.system)


def large_loops(ask: Question) -> bool:
    """Whether there are so many loops that kernels of links and loops pay."""
    return has_large_loops(ask.system)


def contacts_alone(ask: Question) -> list[str]:
    """Frictionless contacts are all that is not smooth, and there are few of them."""
    scene = ask.system.scene
    others = [f"{name!r} has friction" for name, contact in scene.contacts.items() if getattr(contact, "friction", 0.0)]
    others += [f"{name!r} holds up to a limit" for name in scene.grips]
    others += [f"{name!r} loses power" for name in scene.losses]
    return others or written_out(ask) or small_contact_problem(ask)


def small_contact_problem(ask: Question) -> list[str]:
    """Dense matrices of the contact problem are worth their while."""
    scene = ask.system.scene
    rows = len(sides(scene)) + 2 * len(slips(scene)) + len(scene.grips)
    found = [f"its contacts have {rows} rows, more than {MOST_CONTACT_ROWS}"] if rows > MOST_CONTACT_ROWS else []
    n_v = ask.system.n_v
    return found + ([f"{n_v} rates beside contacts are more than {WIDEST_CONTACT}"] if n_v > WIDEST_CONTACT else [])


def smooth_system(system: System) -> System:
    """The system without contacts, friction and limited forces, made once."""
    make = lambda: build(phase_scene(system.scene), system.dynamics.anew())  # noqa: E731
    return system.dynamics.on_demand((smooth_system,), make)


def smooth(condition: Callable[[Question], list[str]]) -> Callable[[Question], list[str]]:
    """Condition on the same system without contacts, friction and limited forces."""
    return lambda ask: condition(smooth_question(ask))


def smooth_question(ask: Question) -> Question:
    """The same of the system without contacts, friction and limited forces."""
    system = smooth_system(ask.system)
    return ask._replace(system=system, laws=Laws(system, ask.laws.trace))


def has_contacts(ask: Question) -> bool:
    """Whether there are one-sided constraints."""
    return bool(ask.system.contacts.placed) and ask.system.dynamics is not None
