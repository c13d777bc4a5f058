"""Report of a system: bodies, freedoms, loops, loads, plans, and the reduction to subsystems."""

import numpy as np

from gauss.codegen.optimiser import OPTIMISER
from gauss.errors import AssemblyError, GaussError, SimulationError, listed

MOST_REASONS = 5  # of a pass, or of a rule of the plan, that are listed
RANK_ROWS = 150  # number of loop constraints up to which freedoms are counted by rank: the time grows with its cube
CLOSE_ROUTES = 1.5  # ratio of estimated costs up to which two routes are called equally fast
MOST_LISTED = 40  # number of joints and names in a list


def _method(system) -> list[str]:
    """Plans of motions and of single states."""
    if system.dynamics is None:
        return ["  solved by: the certified recursion; it was built without machine code"]
    lines, plans = list[str](), system.dynamics.plans(system)
    for what, plan in plans.items():
        lines += [f"  {what}: {line}" if k == 0 else f"    {line}" for k, line in enumerate(str(plan).splitlines())]
        if isinstance(plans["motions"], SimulationError):  # motions go by time stepping, which evaluates none
            continue
        cost, ratio = system.dynamics.cost(system, plan)
        if ratio > CLOSE_ROUTES:
            lines.append(
                f"    about {1e6 * cost:.0f} µs an evaluation (estimated), {ratio:.0f} times the fastest that is barred"
            )
    if equal := system.dynamics.equal_chains(system, plans["accelerations"]):
        words = ", ".join(f"{chains} of {joints} joint{'s' * (joints > 1)}" for chains, joints in equal)
        lines.append(f"    equal chains in the lanes of vector registers, where that code is shorter: {words}")
    lines.append(f"  machine code: {OPTIMISER.status()}")
    costs = system.dynamics.called(system)
    return lines + [
        f"  the law of {name!r} is an opaque Python callback, called in every evaluation: {cost}"
        for name, cost in costs.items()
    ]


def _one_sided(system) -> list[str]:
    """Unilateral constraints, with the number of their gap functions where it is not one."""
    contacts = system.scene.contacts
    if not contacts:
        return []
    counts = {name: len(contact.sides(system.scene)) for name, contact in list(contacts.items())[:MOST_LISTED]}
    more = f" and {len(contacts) - MOST_LISTED} more" if len(contacts) > MOST_LISTED else ""
    words = ", ".join(name if count == 1 else f"{name} ({count} gap functions)" for name, count in counts.items())
    return [f"  unilateral constraints: {words}{more}"]


def _steps_in_contact(system) -> list[str]:
    """What a step of time stepping looks at, and how many bodies may sleep, of scenes with contacts of shapes."""
    if not system.scene.shapes or not system.scene.contacts or system.dynamics is None:
        return []
    parts, pairs, by_grid = system.dynamics.candidate_pairs(system)
    by = f"a grid finds the near ones: its work is that of {parts} parts" if by_grid else "tried one by one in each step"
    return [f"  contacts of shapes: {pairs} pairs of {parts} convex parts, {by}", *_time_step(system), *_sleeping(system)]


def _time_step(system) -> list[str]:
    """Plan of time stepping, and what a step takes at the start."""
    found = system.dynamics.time_step(system)
    if isinstance(found, GaussError):
        return [f"  time stepping: no step from the start, {found}"]
    plan, step = found
    if step is None:
        return [f"  time stepping: {plan.dynamics} dynamics, contacts in the machine code of the scene"]
    solver = "free bodies, Newton's method on a block-sparse matrix" if step.free else "a mechanism, Newton's method"
    kinds = f" ({listed(step.kinds, MOST_REASONS)})" if step.kinds else ""
    groups = len(step.islands)
    islands = f" in {groups} island{'s' * (groups > 1)}, the largest of {max(step.islands)}" if groups else ""
    return [
        f"  time stepping: {plan.dynamics}, the step of {solver}",
        f"    at the start {step.points} near points of {step.pairs} pairs{kinds}{islands}: about "
        f"{max(1.0, 1e6 * step.cost):.0f} µs a step of {step.step:.2g} s (CPU time, measured); more where more bodies touch",
    ]


def _sleeping(system) -> list[str]:
    """How many bodies may sleep in time stepping."""
    found = system.dynamics.sleepers(system)
    if isinstance(found, SimulationError):
        return [f"  sleeping in time stepping: no body, {found}"]
    able, never = found
    rest = f"; never, by laws of time or prescribed motions: {listed(never, MOST_LISTED)}" if never else ""
    return [f"  sleeping in time stepping: {len(able)} of {len(able) + len(never)} moving bodies may{rest}"]


def _freedoms(system, counted: str) -> list[str]:
    """Freedoms by counting, and with loops by rank at the start of the scene."""
    structure, lines = system.structure, [f"  freedoms by counting: {counted}"]
    if not system.has_closures or system.dynamics is None:
        return lines
    closing = sum(rows.stop - rows.start for rows in (structure.constraints[i].rows for i in structure.closures))
    if closing > RANK_ROWS:
        return [
            *lines,
            f"  freedoms are not counted by rank: {closing} loop constraints, see gauss.mobility(system)",
        ]
    try:
        found = str(system.dynamics.mobility(system)).splitlines()
    except AssemblyError as error:
        found = [f"no start that meets the constraints: {error}"]
    except GaussError as error:
        found = [f"freedoms by rank are not counted: {error}"]
    return lines + [f"  {line}" for line in found]


def _reductions(system) -> list[str]:
    """Reductions by each pass, with reasons and savings."""
    written, *stages = system.reduction
    counts = _counts(system, written.subsystems)
    lines = ["", f"  subsystems in joint coordinates: {_listed(counts)} as written"]
    for stage in stages:
        if not stage.why:
            lines.append(f"    {stage.what}: none here")
            continue
        before, counts = counts, _counts(system, stage.subsystems)
        saved = {unit: _less(before[unit], left) for unit, left in counts.items()}
        more = f", and {len(stage.why) - MOST_REASONS} more" if len(stage.why) > MOST_REASONS else ""
        lines += [f"    {stage.what}: {'; '.join(stage.why[:MOST_REASONS])}{more}", f"      saves {_listed(saved)}"]
    return [*lines, f"    reduced: {_listed(counts)}"]


def _less(before: int | None, left: int | None) -> int | None:
    return None if before is None or left is None else before - left


def _listed(counts) -> str:
    return ", ".join(f"{'uncounted' if number is None else number} {unit}" for unit, number in counts.items())


def _counts(system, subsystems) -> dict[str, int | None]:
    return {
        "rows": sum(subsystem.n_rows for subsystem in subsystems),
        "coordinates": sum(subsystem.n_coordinates for subsystem in subsystems),
        "operations": None if system.dynamics is None else system.dynamics.operations(system, subsystems),
    }


def explain(system) -> str:
    """Bodies, joints, freedoms, loops and loads of a system, and how it is solved."""
    structure = system.structure
    loops = [structure.constraints[i].name for i in structure.closures]
    rigid = 6 * structure.n_bodies
    counted = rigid + structure.n_columns - structure.n_rows
    masses = system.Phi[3::6]
    lines = [
        f"scene {system.scene.name!r}: {structure.n_bodies} bodies, {len(system.joints)} joints, "
        f"{len(system.scene.couplings)} couplings, {len(system.scene.relations)} further constraints, "
        f"{len(system.loads)} loads, gravity {list(system.scene.gravity)} m/s²",
        f"  unknowns: {rigid} quasi-accelerations and {structure.n_columns} joint accelerations; {structure.n_rows} rows",
        *_freedoms(system, f"{rigid} + {structure.n_columns} − {structure.n_rows} = {counted}"),
        f"  mass: {masses.sum():.6g} kg in all, bodies from {masses.min():.3g} to {masses.max():.3g} kg",
        f"  scale, to which tolerances are relative: {system.scale}",
        "  loops: none, the joints form a tree"
        if not loops
        else f"  loop constraints, couplings, relations: {', '.join(loops)}",
        *_one_sided(system),
        *([f"  set-valued elements: {listed(system.scene.set_valued, MOST_LISTED)}"] if system.scene.set_valued else []),
        *_steps_in_contact(system),
        *_method(system),
        *_reductions(system),
        "",
        f"  {'joint':24} {'type':12} {'parent → child':36} coordinates",
    ]
    for joint in system.joints[:MOST_LISTED]:
        bodies = " → ".join("ground" if b < 0 else structure.bodies[b] for b in (joint.parent, joint.child))
        names = ", ".join(structure.coordinates[joint.v]) or "–"
        lines.append(f"  {joint.name:24} {joint.pair.kind:12} {bodies:36} {names}")
    if len(system.joints) > MOST_LISTED:
        lines.append(f"  … and {len(system.joints) - MOST_LISTED} more")
    light = [name for name, J in zip(structure.bodies, np.split(system.Phi, structure.n_bodies), strict=True) if not J.all()]
    if light:
        lines.append(f"  without inertia in some direction (joints must carry it): {listed(light, MOST_LISTED)}")
    return "\n".join(lines)
