"""Events of time stepping are complete: a replay of all steps, with modes read off the forces, has the same changes."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import dominoes, floor, free_body
from gauss import Plan
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.kinematics import kinematics
from gauss.system import State
from tests.simulation.test_mechanism_contacts import arm

STEP = 1e-3  # [s]
KERNELS = Plan("time stepping", "pair kernels")
# Of the cone of friction: a contact whose force is farther inside sticks; one that is nearer may slide.
INSIDE, ON = 1e-4, 1e-7
CLEAR = 0.05  # [m/s]: a contact that is faster slides; places of half a step later add ω² r h, 0.02 m/s here
SAME = 5e-4  # [m/s], [rad/s]: redundant forces of the step before, which a step expects, are not the same in a replay
OPEN, STUCK, SLIDES = 0, 1, 2
LEADS = {"opens": {OPEN}, "holds": {STUCK}, "slips": {SLIDES}, "closes": {STUCK, SLIDES}, "impact": {STUCK, SLIDES}}
FROM = {"opens": {STUCK, SLIDES}, "holds": {SLIDES}, "slips": {STUCK}, "closes": {OPEN}, "impact": {OPEN}}


def bouncing():
    """A ball with restitution that bounces and spins."""
    scene = floor("bouncing ball")
    free_body(scene, "ball", 0.004, (0.0, 0.0, 0.2), rate=(0.5, 0.0, 0.0, 0.0, 9.0, 0.0))
    scene.sphere("round", "ball", 0.1)
    scene.contact("touch", "round", "floor", restitution=0.6, friction=0.3)
    return scene


def tumbling():
    """A box thrown onto an edge."""
    scene = floor("tumbling box")
    turn = np.array([np.cos(0.4), 0.2, np.sin(0.4), 0.1])
    free_body(scene, "box", 0.01, (0.0, 0.0, 0.25), rate=(1.0, 0.3, 0.0, 0.5, 4.0, 0.0), turn=turn / np.linalg.norm(turn))
    scene.box("hull", "box", (0.2, 0.3, 0.15))
    scene.contacts_all(friction=0.4)
    return scene


SCENES = {
    "bouncing ball": (bouncing, 0.6),
    "block on an incline": (lambda: gauss.load("block_on_incline"), 0.9),
    "dominoes": (lambda: dominoes(3, push=3.0), 0.5),
    "tumbling box": (tumbling, 0.6),
    "mechanism with a foot": (lambda: arm("arm"), 0.4),
}


def replayed(system, steps: int, states):
    """Possible modes of each contact after each step from the states of a motion, {contact: [set of modes]}."""
    stepper = new_contact_stepper(system)
    table, found = stepper.table, {name: [{OPEN}] for name in stepper.elements}
    for k in range(steps):
        step = stepper.python_step(states[k], STEP)
        np.testing.assert_allclose(step.v, states[k + 1].v, atol=SAME)
        at = kinematics(system, State(states[k].t, states[k].q, step.v))
        modes = {name: [] for name in found}
        near = step.contacts
        for law, force, place, axes in zip(near.law, step.force, near.place, near.axes, strict=True):
            if force[0] > 0.0:
                contact = table.contacts[law]
                modes[contact.name].append(_modes_of_point(at, contact, force, place, axes[1:]))
        for name, points in modes.items():
            most, least = (max((choose(point) for point in points), default=OPEN) for choose in (max, min))
            found[name].append(set(range(least, most + 1)))
    return found


def _modes_of_point(at, contact, force, place, tangents) -> set[int]:
    across, limit = np.hypot(*force[1:]), contact.friction * force[0]
    if not contact.friction or across < (1.0 - INSIDE) * limit:
        return {STUCK}
    bodies = (at.system.scene.shapes[name].body for name in (contact.shape, contact.other))
    one, other = (at.velocity_at(body, place) for body in bodies)
    return {SLIDES} if np.linalg.norm(tangents @ (one - other)) > CLEAR and across > (1.0 - ON) * limit else {STUCK, SLIDES}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_every_change_of_a_contact_is_one_event_and_no_other(name):
    make, end = SCENES[name]
    system = gauss.compile_scene(make())
    motion = gauss.simulate(system, end, integrator="time_stepping", step=STEP, plan=KERNELS, progress=False)
    steps = len(motion) - 1
    possible = replayed(system, steps, [motion.state(k) for k in range(len(motion))])
    events = {(round(event.t / STEP), gap): event for event in motion.events for gap in event.gaps}
    assert len(events) == sum(len(event.gaps) for event in motion.events) > 0  # no contact has two in a step
    assert all(any(abs(event.t - t) < 1e-9 for t in motion.t[1:]) for event in motion.events)
    for contact, modes in possible.items():
        now = modes[0]
        for k in range(1, steps + 1):
            event = events.pop((k, contact), None)
            if event is not None:
                assert now & FROM[event.kind], (contact, k, event)
                now = LEADS[event.kind]
            elif k == 1 and now == {OPEN}:
                now = modes[k]  # a contact that begins closed has no event
            assert now & modes[k], (contact, k, event, now, modes[k])
            now = now & modes[k]
    assert not events
