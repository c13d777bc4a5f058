"""Conditions of the rules that select a plan: the properties that each kind of machine code requires of a system.

A condition takes a :class:`gauss.dynamics.rules.Question` and returns its violations in words; none where it holds.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import wraps

import numpy as np

from gauss.codegen import callbacks_are_available
from gauss.dynamics.composite_bodies import CompositeBodies
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rnea import KinematicTree
from gauss.dynamics.rules import Question, named
from gauss.dynamics.store import cached
from gauss.errors import SimulationError
from gauss.integrators import ExplicitPair, FixedStep
from gauss.scene import ClosedGap, Collider, Contact, Points
from gauss.scene.contact_pairs import have_closed_form
from gauss.scene.patch_distances import no_closed_form
from gauss.system import System, build, phase_scene, sides, whole
from gauss.system.contact_mode import of_shapes, slips
from gauss.system.elimination_cost import MOST_SHARED_JOINTS, MOST_WORK

LARGE_TREE_BODIES = 40  # bodies of a tree above which kernels of links run and compile faster than straight-line code
MOST_RATES = 128  # rates of a scene with loops above which straight-line code takes many seconds to compile
MOST_COUPLING_WORK = 10_000  # operations for couplings above which kernels are as fast, and compiled in a fifth of the time
# Pairs of loops that share a joint of the tree, per body, up to which kernels of loops are made within seconds; they are
# slower than straight-line code above MOST_SHARED_JOINTS
MOST_SHARED_BY_KERNELS = 500
WIDEST = 128  # rates up to which steps are compiled whose code grows faster than the scene, as by their dense matrices
WIDEST_CONTACT = 48  # rates up to which a step with contacts is compiled: its matrices are dense
MOST_CONTACT_ROWS = 96  # rows of contacts up to which it is
# Operations of the gap functions up to which a step is compiled with them: more take longer to compile than kernels of pairs
# of shapes, whose steps are as fast.
MOST_CONTACT_OPERATIONS = 1_000
CONTACT_OPERATIONS = {  # of the gap functions of a pair of shapes in the coordinates of the scene, measured
    ("HalfSpace", "Sphere"): 122,
    ("Sphere", "Sphere"): 661,
    ("Capsule", "Sphere"): 969,
    ("Box", "Sphere"): 1_386,
    ("Capsule", "HalfSpace"): 257,
    ("Capsule", "Capsule"): 1_557,
    ("Box", "Capsule"): 18_255,
    ("Box", "HalfSpace"): 635,
    ("Box", "Box"): 42_787,
}
LEAST_EIGENVALUE = 1e-9  # of a mass matrix with a diagonal of ones: smaller ones are rounding
MOST_CLOSED_GAPS = 24  # of a phase up to which its code is made before its first evaluation: that of more takes seconds
WIDEST_MECHANISM = 128  # rates up to which the mass matrix of a mechanism is dense straight-line code
MOST_ROWS = 10  # loop constraints of a linear model in straight-line code: 15, of a Stewart platform, take minutes


def refuse_motionless(system: System, what: str):
    """Raise a SimulationError for a system in which nothing can move, which leaves nothing to do."""
    if not system.n_v:
        raise SimulationError(f"{what}: nothing in scene {system.scene.name!r} can move; give a joint that moves.")


def is_large(system) -> bool:
    """Whether the compiled dynamics are a recursion over kernels of links, instead of straight-line code."""
    return _n_bodies(system.subsystems) > LARGE_TREE_BODIES and not system.has_closures


def has_large_loops(system) -> bool:
    """Whether the compiled dynamics are a call graph of kernels of links and loops, instead of straight-line code."""
    subsystems = system.subsystems
    bound = any(subsystem.relations or subsystem.trains for subsystem in subsystems)
    if bound or not any(subsystem.loop_joints or subsystem.couplings for subsystem in subsystems):
        return False
    if system.n_v <= MOST_RATES and _loop_work(subsystems) <= MOST_WORK and _coupling_work(subsystems) <= MOST_COUPLING_WORK:
        return False
    if _share_few_joints(subsystems):
        return True
    return _share_few_joints_in_kernels(subsystems) and _loop_work(subsystems) > MOST_WORK


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled as one smooth function; none if they are."""
    reasons, is_short = kernel_obstacles(system), has_large_loops(system) and _share_few_joints(system.subsystems)
    if not is_short and (work := _loop_work(system.subsystems)) > MOST_WORK:
        reasons.append(f"its loops share so many links that straight-line code would have about {work:.0e} operations")
    return reasons


def kernel_obstacles(system) -> list[str]:
    """Reasons why they are not compiled as kernels of links and loops, either."""
    reasons = [f"{name!r} is unilateral" for name in system.scene.contacts]
    reasons += _limits_and_losses(system.scene)
    return reasons if system.subsystems else [*reasons, "nothing in it can move"]


def _limits_and_losses(scene) -> list[str]:
    limits = [f"{name!r} has a limited force" for name in scene.set_valued]
    return limits + [f"{name!r} has losses" for name in scene.losses if name not in scene.set_valued]


def _loop_work(subsystems) -> int:
    return sum(subsystem.loop_elimination_work for subsystem in subsystems)


def _coupling_work(subsystems) -> int:
    """Work of the couplings alone."""
    coupled = [subsystem for subsystem in subsystems if subsystem.couplings]
    return _loop_work(coupled) - _loop_work([replace(subsystem, couplings=()) for subsystem in coupled])


def _share_few_joints(subsystems) -> bool:
    """Whether few pairs of loops share a joint of the tree."""
    return sum(subsystem.shared_joints for subsystem in subsystems) <= MOST_SHARED_JOINTS * _n_bodies(subsystems)


def _share_few_joints_in_kernels(subsystems) -> bool:
    """Whether few do where kernels eliminate loops that stand on each other one after the other."""
    shared = sum(subsystem.joints_shared_in_kernels for subsystem in subsystems)
    return shared <= MOST_SHARED_BY_KERNELS * _n_bodies(subsystems)


def _n_bodies(subsystems) -> int:
    return sum(subsystem.n_bodies for subsystem in subsystems)


def own_backend(ask: Question) -> list[str]:
    """No backend was named: a named one solves every state."""
    automatic = isinstance(ask.backend, str) and ask.backend == "auto"
    return [] if automatic else [f"backend {named(ask.backend)!r} is asked for, which solves state by state"]


def compilable(ask: Question) -> list[str]:
    """The forward dynamics are one smooth function."""
    return obstacles(ask.system) if ask.system.dynamics is not None else ["it was built without machine code"]


def compilable_by_kernels(ask: Question) -> list[str]:
    """The forward dynamics are smooth, as kernels of links and loops."""
    return kernel_obstacles(ask.system) if ask.system.dynamics is not None else ["it was built without machine code"]


def traced_laws(ask: Question) -> list[str]:
    """No law is an opaque callback."""
    return [f"the law of {name!r} cannot be traced ({why})" for name, why in ask.laws.reasons.items()]


def has_opaque_laws(ask: Question) -> bool:
    """Whether a law is an opaque callback."""
    return bool(ask.laws.called)


def callbacks(ask: Question) -> list[str]:
    """All laws are traced, or machine code can call Python here."""
    return [] if callbacks_are_available() else traced_laws(ask)


def few_bodies(ask: Question) -> list[str]:
    """The tree is small enough for straight-line code."""
    return [f"it has more than {LARGE_TREE_BODIES} bodies"] if is_large(ask.system) else []


def few_loops(ask: Question) -> list[str]:
    """The loops are few enough for straight-line code."""
    return ["its loops are too many for straight-line code"] if has_large_loops(ask.system) else []


def few_loop_rows(ask: Question) -> list[str]:
    """The loop constraints are few enough to write the response to each of them out, several times."""
    rows = sum(one.n_loop_constraints for one in ask.system.subsystems)
    return [f"{rows} loop constraints are more than {MOST_ROWS}"] if rows > MOST_ROWS else []


def written_out(ask: Question) -> list[str]:
    """The tree and its loops are small enough for straight-line code."""
    return few_bodies(ask) + few_loops(ask)


def narrow(ask: Question) -> list[str]:
    """The step is explicit, or the system is small enough for a compiled one."""
    n_v, is_explicit = ask.system.n_v, not (explicit(ask) or ask.drift.partitioned)
    return [f"{n_v} rates are more than {WIDEST}"] if n_v > WIDEST and not is_explicit else []


def explicit(ask: Question) -> list[str]:
    """The integrator solves no equations."""
    method = ask.method
    found = isinstance(method, ExplicitPair | FixedStep) and not method.mechanical
    return [] if found else [f"integrator {getattr(method, 'name', method)!r} is implicit"]


def no_held_inputs(ask: Question) -> list[str]:
    """Inputs are not held between samples: the machine code of the step has none."""
    return ["its inputs are held between samples"] if ask.held else []


def large_tree(ask: Question) -> bool:
    """Whether kernels of links are faster than straight-line code."""
    return is_large(ask.system)


def large_loops(ask: Question) -> bool:
    """Whether kernels of links and loops are faster than straight-line code."""
    return has_large_loops(ask.system)


def contacts_alone(ask: Question) -> list[str]:
    """Frictionless contacts are the only non-smooth elements, and few."""
    scene = ask.system.scene
    others = [f"{name!r} has friction" for name, contact in scene.contacts.items() if getattr(contact, "friction", 0.0)]
    others += _limits_and_losses(scene)
    return others or written_out(ask) or small_contact_problem(ask)


def small_contact_problem(ask: Question) -> list[str]:
    """The contact problem is small enough for dense matrices."""
    scene = ask.system.scene
    rows = len(scene.contacts) + len(scene.set_valued)  # at least: a million are not counted one by one
    if rows <= MOST_CONTACT_ROWS:
        rows = len(sides(scene)) + 2 * len(slips(scene)) + len(scene.set_valued)
    found = [f"its contacts have {rows} rows or more, beyond {MOST_CONTACT_ROWS}"] if rows > MOST_CONTACT_ROWS else []
    n_v = ask.system.n_v
    return found + ([f"{n_v} rates beside contacts are more than {WIDEST_CONTACT}"] if n_v > WIDEST_CONTACT else [])


def few_closed_gaps(ask: Question) -> list[str]:
    """The closed gaps of a phase are few, and no more than its rates: code for redundant ones takes long to compile."""
    closed = sum(isinstance(relation, ClosedGap) for relation in ask.system.scene.relations.values())
    most = min(ask.system.n_v, MOST_CLOSED_GAPS)
    return [f"{closed} closed gaps are more than {most}"] if closed > most else []


def definite_mass_matrix(ask: Question) -> list[str]:
    """The mass matrix of the tree is positive definite at the reference pose: else machine code may divide by zero."""
    system = ask.system
    if system.Phi.all():
        return []
    at_rest = np.zeros(system.n_v)
    tree = KinematicTree(whole(system), system.reference.q, at_rest)
    moved = np.concatenate([np.r_[tree.subsystem.joints[edge.constraint].v] for edge in tree.edges])
    M = CompositeBodies(tree, at_rest).mass_matrix()[np.ix_(moved, moved)].astype(float)
    size = np.sqrt(np.abs(np.diag(M)))
    is_definite = size.all() and np.linalg.eigvalsh(M / np.outer(size, size))[0] > LEAST_EIGENVALUE
    return [] if is_definite else ["a body has no inertia in a direction in which it moves"]


def few_contact_operations(ask: Question) -> list[str]:
    """The gap functions of contacts are short enough to be written out."""
    scene = ask.system.scene
    if not shapes_in_contact(ask):
        return []
    found = closed_form_contacts(ask)
    if found:
        return found
    contacts = [contact for contact in scene.contacts.values() if isinstance(contact, Contact)]
    kind = {name: _counted(shape) for name, shape in scene.shapes.items()}
    pairs = Counter((kind[one.shape], kind[one.other]) for one in contacts)
    work = sum(number * _operations(*pair) for pair, number in pairs.items())
    return [f"its contacts would have about {work:.0e} operations"] if work > MOST_CONTACT_OPERATIONS else []


def located_contacts(ask: Question) -> list[str]:
    """Events of contacts can be located: they have no friction, and their distances are closed forms."""
    rough = any(getattr(contact, "friction", 0.0) for contact in ask.system.scene.contacts.values())
    return ["contacts have friction"] if rough else closed_form_contacts(ask)


def closed_form_contacts(ask: Question) -> list[str]:
    """The distances of all shapes that may touch are closed forms."""
    shapes = ask.system.scene.shapes
    contacts = [contact for contact in ask.system.scene.contacts.values() if isinstance(contact, Contact)]
    pairs: dict[tuple[type, type], tuple[Collider, Collider]] = {}
    for one in contacts:
        pair = shapes[one.shape], shapes[one.other]
        pairs.setdefault((type(pair[0]), type(pair[1])), pair)
    odd = next((pair for pair in pairs.values() if not have_closed_form(*pair)), None)
    return [no_closed_form(*odd)] if odd else []


def _counted(shape) -> tuple[str, int]:
    """Kind of a shape, and number of its balls."""
    return ("Sphere", len(shape.corners)) if isinstance(shape, Points) else (type(shape).__name__, 1)


def _operations(one: tuple[str, int], other: tuple[str, int]) -> int:
    """Operations of the gap functions of two shapes with their derivatives, roughly."""
    first, second = sorted((one[0], other[0]))
    return max(one[1], other[1]) * CONTACT_OPERATIONS.get((first, second), 0)


def shapes_in_contact(ask: Question) -> bool:
    """Whether there are contacts of shapes."""
    return any(isinstance(contact, Contact) for contact in ask.system.scene.contacts.values())


def takes_pair_kernels(ask: Question) -> list[str]:
    """Kernels of pairs of shapes take its shapes, and its other constraints are rows of joints."""
    system, scene = ask.system, ask.system.scene
    touching = {name for one in scene.contacts.values() if isinstance(one, Contact) for name in (one.shape, one.other)}
    found = [f"{name!r} has no radius" for name in sorted(touching) if _is_sharp(scene.shapes[name])]
    if are_free_in_contact(system) and not ask.held:
        return found
    if not system.Phi.any() or system.dynamics is None:
        found.append("it was built without machine code")
    n_v = system.n_v
    found += [f"{n_v} rates beside contacts are more than {WIDEST_MECHANISM}"] if n_v > WIDEST_MECHANISM else []
    return found


def are_free_in_contact(system: System) -> bool:
    """Whether contacts of shapes are all that acts on bodies that hang on free joints from the ground or are fixed to it."""
    return _are_free(system) and _touch_alone(system.scene)


def _are_free(system: System) -> bool:
    """Whether all bodies that move are free, and have mass and inertia."""
    kinds = ("free", "fixed")
    free = all(joint.parent < 0 and joint.pair.kind in kinds for joint in system.joints)
    moving = [joint.child for joint in system.joints if joint.pair.n_v]
    return free and bool(moving) and bool(system.Phi.reshape(-1, 6)[moving].all())


def _touch_alone(scene) -> bool:
    """Whether contacts are the only loads and constraints, of shapes that are boxes or have a radius."""
    if scene.loads or scene.relations or scene.couplings or scene.set_valued or not scene.contacts:
        return False
    return of_shapes(scene) and not any(map(_is_sharp, scene.shapes.values()))


def _is_sharp(shape) -> bool:
    """Whether a shape is points without a radius."""
    return isinstance(shape, Points) and not shape.radius


def smooth_system(system: System) -> System:
    """The system without unilateral and set-valued elements, built once."""
    make = lambda: build(phase_scene(system.scene), system.mechanics.anew())  # noqa: E731
    return cached(system, (smooth_system,), make)


def smooth(condition: Callable[[Question], list[str]]) -> Callable[[Question], list[str]]:
    """Condition on the system without unilateral and set-valued elements."""

    @wraps(condition)
    def of_smooth(ask: Question) -> list[str]:
        return condition(smooth_question(ask))

    return of_smooth


def smooth_question(ask: Question) -> Question:
    """The question of the system without unilateral and set-valued elements."""
    system, laws = smooth_system(ask.system), ask.laws
    if laws.of_smooth is None:  # several conditions ask in a row
        laws.of_smooth = Laws(system, laws.trace)
    return ask._replace(system=system, laws=laws.of_smooth)


def has_contacts(ask: Question) -> bool:
    """Whether there are unilateral constraints."""
    return bool(ask.system.scene.contacts) and ask.system.dynamics is not None
